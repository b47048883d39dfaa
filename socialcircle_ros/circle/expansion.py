# SPDX-License-Identifier: Apache-2.0
"""The expansion of the social circle (section 3.2.3).

The seed joins first. When a point has joined, all points in its search window that are less than R away join too.
With a window of 3×3 points all of them are on the edge of the window, so that each becomes an initial point of the
next iteration. The circle is then the connected component of the seed, in whatever order points join. This module
computes that component. Wider windows are in `wide_windows`.

A link is a pair of neighbours that are less than R apart. Links and points are stored as bits, 64 columns in a
word, in planes of shape (H, words + 2): bit i of word w + 1 belongs to column 64 w + i, and the first and the last
word of a row are 0. So 64 comparisons run at once, and the circle grows by words.

A mask of its own shows which points have joined. The paper stores heights in a matrix B instead, with 0 for a
point that has not joined, and so loses the points at height 0 and below.
"""

import numpy as np

from socialcircle_ros.cloud import Cloud, Mask, Memory, flattened, is_measured, load_row, measured_points
from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel

from .arrays import Floats, Integers, Real, Words
from .distances import within_radius
from .wide_windows import WIDEST_BY_TILES, grow_by_tiles, grow_in_order

_WORD = 64

# The planes of links. The other four neighbours are these four, seen from the other point.
_EAST, _SOUTH, _SOUTH_EAST, _SOUTH_WEST, _MEASURED = range(5)

_ZERO, _ONE, _LAST = np.uint64(0), np.uint64(1), np.uint64(63)


def divide(xyz: Cloud, seed: tuple[int, int], limit: Real, window: int) -> tuple[Mask, Mask]:
    """Divide the measured points into inliers and outliers: those that join the circle, and those that do not.

    Args:
        xyz: (H, W, 3) organized cloud.
        seed: row and column of the initial point I, which is measured.
        limit: R², in the cloud's own dtype.
        window: side of the search window W in points, odd.

    Returns:
        Two masks (H, W): the inliers and the outliers.
    """
    height, width, _ = xyz.shape
    memory, limit = flattened(xyz), xyz.dtype.type(limit)
    if window > WIDEST_BY_TILES:
        members = grow_in_order(memory, (height, width), seed, limit, window // 2)
        return members, measured_points(xyz) & ~members
    links = _find_links(memory, (height, width), limit)
    measured: Words = links[_MEASURED, :, 1:-1]
    community = _grow_from(seed, links)
    if window > 3:
        community = grow_by_tiles(memory, seed, limit, window // 2, measured, community)
    return _unpacked(community, width), _unpacked(measured & ~community, width)


def _unpacked(words: Words, width: int) -> Mask:
    """Return bits, (H, words), as a mask (H, W)."""
    little = np.ascontiguousarray(words, '<u8').view(np.uint8)
    return np.unpackbits(little, axis=1, count=width, bitorder='little').view(np.bool_)


def _find_links(memory: Memory, shape: tuple[int, int], limit: Real) -> Words:
    """Return the links of all points in four directions, and which points are measured, (5, H, words + 2)."""
    height, width = shape
    words = (width + _WORD - 1) // _WORD
    links = np.zeros((5, height, words + 2), np.uint64)

    def find(band: slice) -> None:
        rows = np.full((3, 4, words * _WORD + 2), np.nan, memory[0].dtype)
        _write_links(memory, width, limit, band.start, band.stop, rows, links)

    in_bands(find, height, width)
    return links


def _grow_from(seed: tuple[int, int], links: Words) -> Words:
    """Return the points that links join to the seed, (H, words)."""
    _, height, words = links.shape
    joined, reached = np.zeros((height, words), np.uint64), np.empty(words, np.uint64)
    first, last = np.full((2, height), words), np.full((2, height), -1)
    _grow(links, seed, joined, first, last, reached)
    return joined[:, 1:-1]


@kernel
def _write_links(
    memory: Memory, width: int, limit: Real, first: int, last: int, rows: Floats, links: Words
) -> None:
    """Write the links and the measured points of the rows from `first` to before `last`.

    NaN or infinite distances are never below the limit. So points that are not measured have no links, and neither
    have the places outside the cloud, which are NaN in `rows`.

    Args:
        memory: the cloud.
        width: of the cloud.
        limit: R².
        first: row.
        last: row.
        rows: (3, 4, 64 words + 2) working memory, full of NaN: two rows of the cloud, and the one below its last.
        links: (5, H, words + 2) is written.
    """
    values, row_step, point_step = memory
    _, height, words = links.shape
    load_row(values, first * row_step, point_step, width, rows[first % 2])
    for row in range(first, last):
        this, below = rows[row % 2], rows[2 if row + 1 == height else (row + 1) % 2]
        if row + 1 < height:
            load_row(values, (row + 1) * row_step, point_step, width, below)
        for word in range(words - 2):
            _write_links_of_word(this, below, limit, links, row, word)


@kernel
def _write_links_of_word(this: Floats, below: Floats, limit: Real, links: Words, row: int, word: int) -> None:
    """Write the links of 64 points, from their row and the row below.

    Comparisons become bits without a branch, so that LLVM vectorises the loop.
    """
    x, y, z = this[0], this[1], this[2]
    u, v, w = below[0], below[1], below[2]
    east = south = south_east = south_west = measured = _ZERO
    for i in range(_WORD):
        bit = np.uint64(i)
        c = np.uint64(word * _WORD + 1) + bit
        a, b = c - _ONE, c + _ONE
        east |= np.uint64(within_radius(x[c], y[c], z[c], x[b], y[b], z[b], limit)) << bit
        south |= np.uint64(within_radius(x[c], y[c], z[c], u[c], v[c], w[c], limit)) << bit
        south_east |= np.uint64(within_radius(x[c], y[c], z[c], u[b], v[b], w[b], limit)) << bit
        south_west |= np.uint64(within_radius(x[c], y[c], z[c], u[a], v[a], w[a], limit)) << bit
        measured |= np.uint64(is_measured(x[c], y[c], z[c])) << bit
    links[_EAST, row, word + 1] = east
    links[_SOUTH, row, word + 1] = south
    links[_SOUTH_EAST, row, word + 1] = south_east
    links[_SOUTH_WEST, row, word + 1] = south_west
    links[_MEASURED, row, word + 1] = measured


@kernel
def _grow(
    links: Words, seed: tuple[int, int], joined: Words, first: Integers, last: Integers, reached: Words
) -> None:
    """Write the points that links join to the seed.

    Sweeps go down and up the grid. From the new points of a row, points of the next row are reached, and from
    these all others along the links of that row. Two or three sweeps reach nearly all points of a surface.
    Later sweeps visit only the words with new points, so that a maze takes little more time than a plane.

    Args:
        links: (5, H, words + 2).
        seed: row and column.
        joined: (H, words + 2) is written; comes full of 0.
        first: (2, H) first word of each row with new points for the next sweep down [0] or up [1]. Comes as
            words + 2: no new points.
        last: (2, H) last word with new points. Comes as -1.
        reached: (words + 2,) working memory.
    """
    _, height, words = links.shape
    row, column = seed
    word = column // _WORD + 1
    reached[word] = _ONE << np.uint64(column % _WORD)
    _join(links[_EAST, row], reached, word, word, joined[row], first[:, row], last[:, row])
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
def _reach_down(links: Words, joined: Words, left: int, right: int, reached: Words) -> None:
    """Write the points of the row below that have a link to a point in `joined`, from word left to right.

    `links`, (5, words + 2), are those of the upper row.
    """
    south, south_east, south_west = links[_SOUTH], links[_SOUTH_EAST], links[_SOUTH_WEST]
    for w in range(left, right + 1):
        before, here, behind = joined[w - 1], joined[w], joined[w + 1]
        reached[w] = (
            (here & south[w])
            | ((here & south_east[w]) << _ONE)
            | ((before & south_east[w - 1]) >> _LAST)
            | ((here & south_west[w]) >> _ONE)
            | ((behind & south_west[w + 1]) << _LAST)
        )


@kernel
def _reach_up(links: Words, joined: Words, left: int, right: int, reached: Words) -> None:
    """Write the points of the row above that have a link to a point in `joined`, from word left to right.

    `links`, (5, words + 2), are those of the upper row.
    """
    south, south_east, south_west = links[_SOUTH], links[_SOUTH_EAST], links[_SOUTH_WEST]
    for w in range(left, right + 1):
        before, here, behind = joined[w - 1], joined[w], joined[w + 1]
        reached[w] = (
            (here & south[w])
            | (((here >> _ONE) | (behind << _LAST)) & south_east[w])
            | (((here << _ONE) | (before >> _LAST)) & south_west[w])
        )


@kernel
def _join(
    east: Words, reached: Words, left: int, right: int, joined: Words, first: Integers, last: Integers
) -> None:
    """Let the reached points of a row join, and all points to which links along the row lead from them.

    Args:
        east: (words + 2,) links along the row.
        reached: (words + 2,) points that join, in the words from `left` to `right`.
        left: word.
        right: word.
        joined: (words + 2,) is written.
        first: (2,) first word with new points, of both sweeps; is lowered.
        last: (2,) last word with new points; is raised.
    """
    words = len(joined)
    carry = _ZERO  # 1 if the last point of the word before has joined and has a link to this word
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
def _widen(first: Integers, last: Integers, word: int) -> None:
    """Include a word in the range from first to last, (2,), of both sweeps."""
    for way in range(2):
        first[way], last[way] = min(first[way], word), max(last[way], word)


@kernel
def _filled(points: np.uint64, east: np.uint64) -> np.uint64:
    """Return the points, and all to which links along the row lead within the word.

    Bit i of `east` is the link of the points i and i + 1. In the direction of higher bits, the carry of an
    addition runs from the lowest point of a run of links to its end. In the other direction nothing carries;
    there the points spread over 1, 2, 4, ... 32 links in turn, a parallel prefix.

    P. M. Kogge and H. S. Stone, "A parallel algorithm for the efficient solution of a general class of recurrence
    equations", IEEE Transactions on Computers C-22 (8), 1973, https://doi.org/10.1109/TC.1973.5009159.
    """
    points |= east ^ (east + (points & east))
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
