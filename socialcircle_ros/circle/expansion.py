"""The expansion of the social circle (section 3.2.3)."""

from typing import Any

import numpy as np

from socialcircle_ros.cloud import Cloud, Mask, flattened, is_measured, load_row, measured_points
from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel

from .wide_windows import WIDEST, Words, grow_by_tiles, grow_in_order, near

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
    if window > WIDEST:
        members, queue = np.zeros((height, width), np.bool_), np.empty((height * width, 2), np.int32)
        grow_in_order(values, row_step, point_step, seed[0], seed[1], limit, window // 2, members, queue)
        return members, measured_points(xyz) & ~members
    words = (width + _WORD - 1) // _WORD
    links = np.zeros((5, height, words + 2), np.uint64)

    def link(band: slice) -> None:
        rows = np.full((3, 4, words * _WORD + 2), np.nan, xyz.dtype)  # round the cloud nothing is measured
        _link(values, row_step, point_step, width, limit, band.start, band.stop, rows, links)

    in_bands(link, height, width)
    joined, reached = np.zeros((height, words + 2), np.uint64), np.empty(words + 2, np.uint64)
    first, last = np.full((2, height), words + 2), np.full((2, height), -1)
    _grow(links, seed[0], seed[1], joined, first, last, reached)
    measured: Words = links[_MEASURED, :, 1:-1]
    community: Words = joined[:, 1:-1]
    if window > 3:
        community = grow_by_tiles(values, row_step, point_step, seed, limit, window // 2, measured, community)
    return _mask(community, width), _mask(measured & ~community, width)


# Window 3: the circle is all that links join to the seed, in whatever order. Links are kept as bits, 64 points
# a word, and the circle grows by words. A plane has a word without a bit before and behind each row.
_EAST, _SOUTH, _SOUTH_EAST, _SOUTH_WEST, _MEASURED = range(5)


def _mask(words: Words, width: int) -> Mask:
    """The bits of a plane, (H, words), as a mask (H, W)."""
    little = np.ascontiguousarray(words, '<u8').view(np.uint8)
    return np.unpackbits(little, axis=1, count=width, bitorder='little').view(np.bool_)


@kernel
def _link(
    values: Any,
    row_step: int,
    point_step: int,
    width: int,
    limit: Any,
    first: int,
    last: int,
    rows: Any,
    links: Any,
) -> None:
    """Write which neighbours are less than R apart, and which points are measured, to `links`, (5, H, words + 2).

    Only of the rows from `first` to before `last`. Bit i of word w + 1 belongs to column 64 w + i. A NaN or an
    infinite distance is never below the limit, so that points that are not measured, and those outside the cloud,
    have no links. `rows`, (3, 4, 64 words + 2), comes full of NaN: the two rows at hand, and that below the
    last one of the cloud.
    """
    _, height, words = links.shape
    load_row(values, first * row_step, point_step, width, rows[first % 2])
    for row in range(first, last):
        this, below = rows[row % 2], rows[2 if row + 1 == height else (row + 1) % 2]
        if row + 1 < height:
            load_row(values, (row + 1) * row_step, point_step, width, below)
        for word in range(words - 2):
            _links_of_word(this, below, limit, links, row, word)


@kernel
def _links_of_word(this: Any, below: Any, limit: Any, links: Any, row: int, word: int) -> None:
    """`_link` of 64 points, from them and the row below."""
    x, y, z = this[0], this[1], this[2]
    u, v, w = below[0], below[1], below[2]
    east = south = south_east = south_west = measured = _ZERO
    for i in range(_WORD):  # vectorised: comparisons become bits without a branch
        bit = np.uint64(i)
        c = np.uint64(word * _WORD + 1) + bit
        a, b = c - _ONE, c + _ONE
        east |= np.uint64(near(x[c], y[c], z[c], x[b], y[b], z[b], limit)) << bit
        south |= np.uint64(near(x[c], y[c], z[c], u[c], v[c], w[c], limit)) << bit
        south_east |= np.uint64(near(x[c], y[c], z[c], u[b], v[b], w[b], limit)) << bit
        south_west |= np.uint64(near(x[c], y[c], z[c], u[a], v[a], w[a], limit)) << bit
        measured |= np.uint64(is_measured(x[c], y[c], z[c])) << bit
    links[_EAST, row, word + 1] = east
    links[_SOUTH, row, word + 1] = south
    links[_SOUTH_EAST, row, word + 1] = south_east
    links[_SOUTH_WEST, row, word + 1] = south_west
    links[_MEASURED, row, word + 1] = measured


@kernel
def _grow(links: Any, seed_row: int, seed_column: int, joined: Any, first: Any, last: Any, reached: Any) -> None:
    """Write the points that links join to the seed to `joined`, (H, words + 2), a plane of bits that comes empty.

    Sweeps down and up the grid: each row hands the points that joined on to the next one, which fills along
    its own links. `first` and `last`, (2, H), tell between which words a row has points that it has not yet handed
    down [0] or up [1]; they come as words + 2 and -1: none. Two or three sweeps reach nearly all of a surface; the
    others look only at the words where something still moves, so that a maze costs little more than a plain.
    `reached`, (words + 2,), is for work.
    """
    _, height, words = links.shape
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
        elif w < left:
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
