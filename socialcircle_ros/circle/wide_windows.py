# SPDX-License-Identifier: Apache-2.0
"""The expansion (section 3.2.3) with search windows above 3×3 points.

Only points on the edge of a window become initial points of the next iteration, and each point joins only once.
A point that has joined inside one window is not an initial point, even if it is on the edge of another window.
So the result depends on the order in which points join. That order is: the containers V1 and V2 of the paper
are emptied in the order in which they were filled, and each window is scanned row by row.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba.cpython.unsafe.numbers import trailing_zeros

from socialcircle_ros.cloud import Mask, Memory
from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel

from .arrays import Floats, Real, Words
from .distances import within_radius

WIDEST_BY_TILES = 7
"""Widest window that `grow_by_tiles` takes."""

# A tile is 8×8 points in a word: bit 8 r + c is the point at row r and column c of the tile.
_SIDE = 8
_ONE, _TWO, _THREE, _SEVEN, _EIGHT, _LAST = (np.uint64(value) for value in (1, 2, 3, 7, 8, 63))
_ZERO, _COLUMN = np.uint64(0), np.uint64(0x0101010101010101)
_HALF, _LOW = np.uint64(32), np.uint64(0xFFFFFFFF)

_LEAST_TILES_PER_BAND = 1500


class _Tiles(NamedTuple):
    """The cloud as tiles, (T_r, T_c), with a border of empty tiles."""

    measured: Words
    members: Words
    """The points of the seed's 3×3 community."""
    ranges: Floats
    """(2, T_r, T_c) the least and the greatest height of each tile's members; +Inf and -Inf where it has none."""
    linked: Words
    """The members, and the points with a link to a member in their window. Points that join are taken out."""
    unlinked: Words
    """The other measured points. Points that join are taken out."""


def grow_in_order(memory: Memory, shape: tuple[int, int], seed: tuple[int, int], limit: Real, k: int) -> Mask:
    """Grow the circle from the seed, step by step as in the paper.

    Args:
        memory: the cloud.
        shape: (H, W).
        seed: row and column of the initial point I.
        limit: R².
        k: half the window, which has 2k+1 points a side.

    Returns:
        Mask (H, W) of the points that join.
    """
    joined, queue = np.zeros(shape, np.bool_), np.empty((shape[0] * shape[1], 2), np.int32)
    _grow_in_order(memory, seed, limit, k, joined, queue)
    return joined


@kernel
def _grow_in_order(
    memory: Memory, seed: tuple[int, int], limit: Real, k: int, joined: Mask, queue: npt.NDArray[np.int32]
) -> None:
    """Write the points that join to `joined`, (H, W), which comes empty.

    One queue, (H · W, 2), replaces V1 and V2: what is added to V2 follows what is left of V1.
    """
    values, row_step, point_step = memory
    height, width = joined.shape
    joined[seed[0], seed[1]] = True
    queue[0, 0], queue[0, 1] = seed[0], seed[1]
    first, last = 0, 1
    while first < last:  # step 3
        row, column = queue[first, 0], queue[first, 1]
        first += 1
        p = row * row_step + column * point_step
        x, y, z = values[p], values[p + 1], values[p + 2]
        for r in range(max(row - k, 0), min(row + k + 1, height)):
            for c in range(max(column - k, 0), min(column + k + 1, width)):
                if joined[r, c]:  # step 4
                    continue
                q = r * row_step + c * point_step
                if within_radius(x, y, z, values[q], values[q + 1], values[q + 2], limit):  # step 5
                    joined[r, c] = True
                    if max(abs(r - row), abs(c - column)) == k:  # step 6
                        queue[last, 0], queue[last, 1] = r, c
                        last += 1


def grow_by_tiles(
    memory: Memory, seed: tuple[int, int], limit: Real, k: int, measured: Words, community: Words
) -> Words:
    """Grow the circle with a window of 5 or 7 points a side, in a fifth of the time of `grow_in_order`.

    The result is the same. A window lies in at most four tiles. A few operations on words find the points in it
    that have not joined yet.

    Most of these are outliers, which each window round them would try again. So they are kept apart: a point
    without a link to a member of the seed's 3×3 community can only join from a point that is not a member
    either. The windows of members need not try it.

    Args:
        memory: the cloud.
        seed: row and column of the initial point I.
        limit: R².
        k: half the window: 2 or 3.
        measured: (H, words) bits of the measured points; bit i of word w is column 64 w + i.
        community: (H, words) bits of the members of the seed's 3×3 community, for the same R.

    Returns:
        (H, words) bits of the points that join.
    """
    tiles = _tile(memory, limit, k, measured, community)
    _grow_tiles(memory, seed, limit, k, tiles, np.empty(64 * measured.size, np.uint64))
    return measured & ~_untiled(tiles.linked | tiles.unlinked, len(measured))


def _tile(memory: Memory, limit: Real, k: int, measured: Words, community: Words) -> _Tiles:
    """Return the tiles of the cloud, for the arguments of `grow_by_tiles`."""
    members = _tiled(community)
    ranges = np.empty((2, *members.shape), memory[0].dtype)
    ranges[0], ranges[1] = np.inf, -np.inf
    tiles = _Tiles(_tiled(measured), members, ranges, members.copy(), np.empty_like(members))

    def measure(band: slice) -> None:
        _measure_heights(memory, tiles, band.start, band.stop)

    def link(band: slice) -> None:
        _link_to_members(memory, limit, k, tiles, band.start, band.stop)

    for work in (measure, link):
        in_bands(work, len(members) - 2, members.shape[1], _LEAST_TILES_PER_BAND)
    np.bitwise_and(tiles.measured, ~tiles.linked, out=tiles.unlinked)
    return tiles


def _tiled(rows: Words) -> Words:
    """Return bits, (H, words), as tiles, (⌈H / 8⌉ + 2, 8 words + 2), with a border of empty ones."""
    height, words = rows.shape
    down = (height + _SIDE - 1) // _SIDE
    lines = np.zeros((down * _SIDE, words * _SIDE), np.uint8)
    lines[:height] = np.ascontiguousarray(rows, '<u8').view(np.uint8)
    tiles = np.ascontiguousarray(lines.reshape(down, _SIDE, -1).transpose(0, 2, 1)).view('<u8')[..., 0]
    return np.pad(tiles.astype(np.uint64, copy=False), 1)


def _untiled(tiles: Words, height: int) -> Words:
    """Return tiles as bits, (H, words): the inverse of `_tiled`."""
    inner = np.ascontiguousarray(tiles[1:-1, 1:-1], '<u8')
    lines = inner.view(np.uint8).reshape(*inner.shape, _SIDE).transpose(0, 2, 1)
    rows = np.ascontiguousarray(lines.reshape(-1, inner.shape[1])[:height])
    return rows.view('<u8').astype(np.uint64, copy=False)


@kernel
def _in_window(tiles: Words, top: np.uint64, left: np.uint64) -> np.uint64:
    """Return the 8×8 points from (top, left) on as a tile, from the four tiles that they lie in.

    Rows and columns count from the corner of the tiles, 8 before that of the cloud.
    """
    r, c = top >> _THREE, left >> _THREE
    right, down = left & _SEVEN, (top & _SEVEN) << _THREE
    kept = _COLUMN * ((_ONE << (_EIGHT - right)) - _ONE)
    above = ((tiles[r, c] >> right) & kept) | ((tiles[r, c + _ONE] << (_EIGHT - right)) & ~kept)
    r += _ONE
    below = ((tiles[r, c] >> right) & kept) | ((tiles[r, c + _ONE] << (_EIGHT - right)) & ~kept)
    window: np.uint64 = (above >> down) | ((below << _ONE) << (_LAST - down))
    return window


@kernel
def _window(k: int, margin: int) -> np.uint64:
    """Return a window of 2k+1 points a side as a tile, without a margin on all sides."""
    bits = _ZERO
    for r in range(margin, 2 * k + 1 - margin):
        for c in range(margin, 2 * k + 1 - margin):
            bits |= _ONE << np.uint64(_SIDE * r + c)
    return bits


@kernel
def _measure_heights(memory: Memory, tiles: _Tiles, first: int, last: int) -> None:
    """Write `ranges` of the tile rows from `first` to before `last`."""
    values, row_step, point_step = memory
    members, ranges = tiles.members, tiles.ranges
    across, down = np.uint64(point_step), np.uint64(row_step)
    for tile_row in range(first + 1, last + 1):
        for tile_column in range(1, members.shape[1] - 1):
            bits = members[tile_row, tile_column]
            low, high = ranges[0, tile_row, tile_column], ranges[1, tile_row, tile_column]
            start = np.uint64(_SIDE * (tile_row - 1)) * down + np.uint64(_SIDE * (tile_column - 1)) * across
            while bits:
                place = trailing_zeros(bits)
                bits &= bits - _ONE
                z = values[start + (place >> _THREE) * down + (place & _SEVEN) * across + _TWO]
                low, high = min(low, z), max(high, z)
            ranges[0, tile_row, tile_column], ranges[1, tile_row, tile_column] = low, high


@kernel
def _link_to_members(memory: Memory, limit: Real, k: int, tiles: _Tiles, first: int, last: int) -> None:
    """Add the points with a link to a member in their window to `linked`, in tile rows `first` to before `last`.

    For most points the heights alone exclude a link. Rounding is monotone, so that the squared distance to a
    member is at least the squared difference to the nearer end of the members' range of heights.
    """
    values, row_step, point_step = memory
    measured, members, ranges, linked = tiles.measured, tiles.members, tiles.ranges, tiles.linked
    across, down = np.uint64(point_step), np.uint64(row_step)
    window, half = _window(k, 0), np.uint64(k)
    for tile_row in range(first + 1, last + 1):
        for tile_column in range(1, members.shape[1] - 1):
            others = measured[tile_row, tile_column] & ~members[tile_row, tile_column]
            if not others:
                continue
            low, high = ranges[0, tile_row, tile_column], ranges[1, tile_row, tile_column]
            for r in range(tile_row - 1, tile_row + 2):
                for c in range(tile_column - 1, tile_column + 2):
                    low, high = min(low, ranges[0, r, c]), max(high, ranges[1, r, c])
            while others:
                place = trailing_zeros(others)
                others &= others - _ONE
                row = np.uint64(_SIDE * tile_row) + (place >> _THREE)
                column = np.uint64(_SIDE * tile_column) + (place & _SEVEN)
                p = (row - _EIGHT) * down + (column - _EIGHT) * across
                x, y, z = values[p], values[p + _ONE], values[p + _TWO]
                off = max(low - z, z - high)
                if low > high or (off > 0 and not off * off < limit):
                    continue
                bits = _in_window(members, row - half, column - half) & window
                corner = p - half * (down + across)
                while bits:
                    at = trailing_zeros(bits)
                    bits &= bits - _ONE
                    q = corner + (at >> _THREE) * down + (at & _SEVEN) * across
                    if within_radius(x, y, z, values[q], values[q + _ONE], values[q + _TWO], limit):
                        linked[tile_row, tile_column] |= _ONE << place
                        break


@kernel
def _grow_tiles(memory: Memory, seed: tuple[int, int], limit: Real, k: int, tiles: _Tiles, queue: Words) -> None:
    """Take the points that join out of `linked` and `unlinked`, in the order of `grow_in_order`.

    The lowest bit of a window is its first point in row order. Rows and columns count from the corner of the
    tiles. In `queue`, (H · W,), they are the two halves of a word.
    """
    values, row_step, point_step = memory
    members, linked, unlinked = tiles.members, tiles.linked, tiles.unlinked
    across, down = np.uint64(point_step), np.uint64(row_step)
    window, inside, half = _window(k, 0), _window(k, 1), np.uint64(k)
    row, column = np.uint64(seed[0]) + _EIGHT, np.uint64(seed[1]) + _EIGHT
    linked[row >> _THREE, column >> _THREE] &= ~_bit(row, column)
    queue[0] = (row << _HALF) | column
    first, last = _ZERO, _ONE
    while first < last:
        row, column = queue[first] >> _HALF, queue[first] & _LOW
        first += _ONE
        p = (row - _EIGHT) * down + (column - _EIGHT) * across
        x, y, z = values[p], values[p + _ONE], values[p + _TWO]
        top, left = row - half, column - half
        bits = _in_window(linked, top, left)
        outside = not members[row >> _THREE, column >> _THREE] & _bit(row, column)  # of the 3×3 community
        if outside:
            bits |= _in_window(unlinked, top, left)
        bits &= window
        corner = p - half * (down + across)
        while bits:
            place = trailing_zeros(bits)
            bits &= bits - _ONE
            q = corner + (place >> _THREE) * down + (place & _SEVEN) * across
            if within_radius(x, y, z, values[q], values[q + _ONE], values[q + _TWO], limit):
                r, c = top + (place >> _THREE), left + (place & _SEVEN)
                others = ~_bit(r, c)
                linked[r >> _THREE, c >> _THREE] &= others
                if outside:
                    unlinked[r >> _THREE, c >> _THREE] &= others
                if not (inside >> place) & _ONE:
                    queue[last] = (r << _HALF) | c
                    last += _ONE


@kernel
def _bit(row: np.uint64, column: np.uint64) -> np.uint64:
    """Return the bit of a point in its tile."""
    return _ONE << (((row & _SEVEN) << _THREE) | (column & _SEVEN))
