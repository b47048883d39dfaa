"""The expansion of the social circle (section 3.2.3)."""

from typing import Any

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Cloud, Mask, flattened, load_row, measured_points
from socialcircle_ros.compiled import kernel

_ZERO, _ONE, _LAST = np.uint64(0), np.uint64(1), np.uint64(63)
_WORD = 64


def expand(xyz: Cloud, seed: tuple[int, int], limit: Any, window: int) -> Mask:
    """Grow the circle from the seed over the grid until nobody joins (steps 1 to 7).

    Args:
        xyz: (H, W, 3) organized cloud.
        seed: row and column of the initial point I, which is measured.
        limit: R², a scalar of the cloud's own dtype.
        window: side of the search window W in points, odd.

    Returns:
        Mask (H, W): True where the point belongs to the circle.
    """
    return divide(xyz, seed, limit, window)[0]


def divide(xyz: Cloud, seed: tuple[int, int], limit: Any, window: int) -> tuple[Mask, Mask]:
    """`expand`, and with it the mask of the outliers: the measured points that did not join.

    Both come from one pass over the cloud.
    """
    height, width, _ = xyz.shape
    values, row_step, point_step = flattened(xyz)
    limit = xyz.dtype.type(limit)
    if window > 3:
        members = _grow_in_order(values, row_step, point_step, height, width, seed[0], seed[1], limit, window // 2)
        return members, measured_points(xyz) & ~members
    links = _links(values, row_step, point_step, height, width, limit)
    joined = _grow(links, seed[0], seed[1])
    return _mask(joined, width), _mask(links[_MEASURED] & ~joined, width)


# Window 3: the circle is all that links join to the seed, in whatever order. Links are kept as bits, 64 points
# a word, and the circle grows by words. A plane has a word without a bit before and behind each row.
_EAST, _SOUTH, _SOUTH_EAST, _SOUTH_WEST, _MEASURED = range(5)


def _mask(words: npt.NDArray[np.uint64], width: int) -> Mask:
    """The bits of a plane as a mask (H, W)."""
    little = np.ascontiguousarray(words[:, 1:-1], '<u8').view(np.uint8)
    return np.unpackbits(little, axis=1, count=width, bitorder='little').view(np.bool_)


@kernel
def _links(values: Any, row_step: int, point_step: int, height: int, width: int, limit: Any) -> Any:
    """Which neighbours are less than R apart, (5, H, words + 2): four planes of links and the measured points.

    Bit i of word w + 1 belongs to column 64 w + i. A NaN or an infinite distance is never below the limit, so
    that points that are not measured, and those outside the cloud, have no links.
    """
    words = (width + _WORD - 1) // _WORD
    planes = np.zeros((5, height, words + 2), np.uint64)
    rows = np.full((2, 4, words * _WORD + 2), np.nan, values.dtype)  # round the cloud nothing is measured
    load_row(values, 0, point_step, width, rows[0])
    for row in range(height):
        this, below = rows[row % 2], rows[(row + 1) % 2]
        if row + 1 < height:
            load_row(values, (row + 1) * row_step, point_step, width, below)
        else:
            below[:] = np.nan
        for word in range(words):
            _links_of_word(this, below, limit, planes, row, word)
    return planes


@kernel
def _links_of_word(this: Any, below: Any, limit: Any, planes: Any, row: int, word: int) -> None:
    """`_links` of 64 points, from them and the row below."""
    x, y, z = this[0], this[1], this[2]
    u, v, w = below[0], below[1], below[2]
    east = south = south_east = south_west = measured = _ZERO
    for i in range(_WORD):  # vectorised: comparisons become bits without a branch
        bit = np.uint64(i)
        c = np.uint64(word * _WORD + 1) + bit
        a, b = c - _ONE, c + _ONE
        east |= np.uint64(_near(x[c], y[c], z[c], x[b], y[b], z[b], limit)) << bit
        south |= np.uint64(_near(x[c], y[c], z[c], u[c], v[c], w[c], limit)) << bit
        south_east |= np.uint64(_near(x[c], y[c], z[c], u[b], v[b], w[b], limit)) << bit
        south_west |= np.uint64(_near(x[c], y[c], z[c], u[a], v[a], w[a], limit)) << bit
        measured |= np.uint64((x[c] - x[c]) + (y[c] - y[c]) + (z[c] - z[c]) == 0) << bit
    planes[_EAST, row, word + 1] = east
    planes[_SOUTH, row, word + 1] = south
    planes[_SOUTH_EAST, row, word + 1] = south_east
    planes[_SOUTH_WEST, row, word + 1] = south_west
    planes[_MEASURED, row, word + 1] = measured


@kernel
def _near(x: Any, y: Any, z: Any, u: Any, v: Any, w: Any, limit: Any) -> Any:
    """Whether two points are less than R apart."""
    dx, dy, dz = u - x, v - y, w - z
    return (dx * dx + dy * dy) + dz * dz < limit


@kernel
def _grow(links: Any, seed_row: int, seed_column: int) -> Any:
    """The points that links join to the seed, as a plane of bits, (H, words + 2).

    Sweeps down and up the grid: each row hands the points that joined on to the next one, which fills along
    its own links. `first` and `last` tell between which words a row has points that it has not yet handed
    down [0] or up [1]. Two or three sweeps reach nearly all of a surface; the others look only at the words
    where something still moves, so that a maze costs little more than a plain.
    """
    _, height, words = links.shape
    joined = np.zeros((height, words), np.uint64)
    first, last = np.full((2, height), words), np.full((2, height), -1)
    reached = np.zeros(words, np.uint64)
    word = seed_column // _WORD + 1
    reached[word] = _ONE << np.uint64(seed_column % _WORD)
    _join(links[_EAST, seed_row], reached, word, word, joined[seed_row], first[:, seed_row], last[:, seed_row])
    moving = True
    while moving:
        moving = False
        for way in range(2):
            for step in range(height - 1):
                row = step if way == 0 else height - 1 - step
                if first[way, row] > last[way, row]:
                    continue
                moving = True
                left, right = max(first[way, row] - 1, 1), min(last[way, row] + 1, words - 2)
                first[way, row], last[way, row] = words, -1
                if way == 0:
                    to = row + 1
                    _reach_down(links[:, row], joined[row], left, right, reached)
                else:
                    to = row - 1
                    _reach_up(links[:, to], joined[row], left, right, reached)
                _join(links[_EAST, to], reached, left, right, joined[to], first[:, to], last[:, to])
    return joined


@kernel
def _reach_down(links: Any, row: Any, left: int, right: int, reached: Any) -> None:
    """Which points of the row below have a link to one that joined in `row`, in the words left to right."""
    south, south_east, south_west = links[_SOUTH], links[_SOUTH_EAST], links[_SOUTH_WEST]
    for w in range(left, right + 1):
        before, here, behind = row[w - 1], row[w], row[w + 1]
        reached[w] = (
            (here & south[w])
            | ((here & south_east[w]) << _ONE)
            | ((before & south_east[w - 1]) >> _LAST)
            | ((here & south_west[w]) >> _ONE)
            | ((behind & south_west[w + 1]) << _LAST)
        )


@kernel
def _reach_up(links: Any, row: Any, left: int, right: int, reached: Any) -> None:
    """Which points of the row above, whose links these are, have a link to one that joined in `row`."""
    south, south_east, south_west = links[_SOUTH], links[_SOUTH_EAST], links[_SOUTH_WEST]
    for w in range(left, right + 1):
        before, here, behind = row[w - 1], row[w], row[w + 1]
        reached[w] = (
            (here & south[w])
            | (((here >> _ONE) | (behind << _LAST)) & south_east[w])
            | (((here << _ONE) | (before >> _LAST)) & south_west[w])
        )


@kernel
def _join(east: Any, reached: Any, left: int, right: int, joined: Any, first: Any, last: Any) -> None:
    """Let the reached points join, and all to which links along the row lead from them, however far.

    `first` and `last`, (2,), are widened to the words in which points joined.
    """
    words = len(joined)
    carry = _ZERO  # whether the last point of the word before has joined, and has a link to this word
    w = left
    while w < words - 1 and (w <= right or carry):
        new = carry & ~joined[w]
        if w <= right:
            new |= reached[w] & ~joined[w]
        if new:
            joined[w] = _filled(joined[w] | new, east[w])
            _widen(first, last, w)
        carry = (joined[w] & east[w]) >> _LAST
        w += 1
    while w > 1:
        w -= 1
        new = (joined[w + 1] << _LAST) & east[w] & ~joined[w]
        if new:
            joined[w] = _filled(joined[w] | new, east[w])
            _widen(first, last, w)
        elif w <= left:
            break


@kernel
def _widen(first: Any, last: Any, word: int) -> None:
    """Take `word` in between the first and the last, (2,), of both ways."""
    for way in range(2):
        first[way], last[way] = min(first[way], word), max(last[way], word)


@kernel
def _filled(points: Any, east: Any) -> Any:
    """`points` and all to which links along the row lead within a word: bit i of `east` joins i and i + 1."""
    # Adding the points to the runs of links carries a one from the lowest point of a run through to its end.
    points |= east ^ (east + (points & east))
    # Nothing carries downward: runs of 1, 2, 4, ... 32 links in turn.
    points |= east & (points >> _ONE)
    east &= east >> _ONE
    points |= east & (points >> np.uint64(2))
    east &= east >> np.uint64(2)
    points |= east & (points >> np.uint64(4))
    east &= east >> np.uint64(4)
    points |= east & (points >> np.uint64(8))
    east &= east >> np.uint64(8)
    points |= east & (points >> np.uint64(16))
    east &= east >> np.uint64(16)
    return points | (east & (points >> np.uint64(32)))


# Larger windows: who joins depends on the order.


@kernel
def _grow_in_order(
    values: Any,
    row_step: int,
    point_step: int,
    height: int,
    width: int,
    seed_row: int,
    seed_column: int,
    limit: Any,
    k: int,
) -> Mask:
    """Who joins with a window of 2k+1 points a side, (H, W).

    V1 and V2 of the paper, each emptied in the order in which it was filled, are together one queue.
    """
    joined = np.zeros((height, width), np.bool_)
    queue = np.empty((height * width, 2), np.int32)
    joined[seed_row, seed_column] = True
    queue[0] = seed_row, seed_column
    first, last = 0, 1
    while first < last:
        row, column = queue[first]
        first += 1
        p = row * row_step + column * point_step
        for r in range(max(row - k, 0), min(row + k + 1, height)):
            for c in range(max(column - k, 0), min(column + k + 1, width)):
                if joined[r, c]:
                    continue
                q = r * row_step + c * point_step
                if _near(values[p], values[p + 1], values[p + 2], values[q], values[q + 1], values[q + 2], limit):
                    joined[r, c] = True
                    if max(abs(r - row), abs(c - column)) == k:
                        queue[last] = r, c
                        last += 1
    return joined
