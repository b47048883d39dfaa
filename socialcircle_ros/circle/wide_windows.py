"""The expansion with windows above 3: who joins depends on the order in which points join.

Only the points on a window's edge lead further, and a point that has joined inside of somebody's window does
not, so that V1 and V2 of the paper must be emptied exactly in the order in which they were filled.
"""

from typing import Any

import numpy as np
import numpy.typing as npt
from numba.cpython.unsafe.numbers import trailing_zeros

from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel

WIDEST = 7
"""Widest window that `grow_by_tiles` takes."""

Words = npt.NDArray[np.uint64]

# A tile is 8×8 points in a word: bit 8 r + c is the point at row r and column c of the tile.
_SIDE = 8
_ONE, _TWO, _THREE, _SEVEN, _EIGHT, _LAST = (np.uint64(value) for value in (1, 2, 3, 7, 8, 63))
_ZERO, _COLUMN = np.uint64(0), np.uint64(0x0101010101010101)
_HALF, _LOW = np.uint64(32), np.uint64(0xFFFFFFFF)
_LEAST_TILES = 1500  # of a band that is worth a thread


@kernel
def near(x: Any, y: Any, z: Any, u: Any, v: Any, w: Any, limit: Any) -> Any:
    """Whether two points are less than R apart."""
    dx, dy, dz = u - x, v - y, w - z
    return (dx * dx + dy * dy) + dz * dz < limit


@kernel
def grow_in_order(
    values: Any,
    row_step: int,
    point_step: int,
    seed_row: int,
    seed_column: int,
    limit: Any,
    k: int,
    joined: Any,
    queue: Any,
) -> None:
    """Write who joins with a window of 2k+1 points a side to `joined`, (H, W), which comes empty.

    V1 and V2 of the paper, each emptied in the order in which it was filled, are together one `queue`, (H · W, 2).
    """
    height, width = joined.shape
    joined[seed_row, seed_column] = True
    queue[0, 0], queue[0, 1] = seed_row, seed_column
    first, last = 0, 1
    while first < last:
        row, column = queue[first, 0], queue[first, 1]
        first += 1
        p = row * row_step + column * point_step
        for r in range(max(row - k, 0), min(row + k + 1, height)):
            for c in range(max(column - k, 0), min(column + k + 1, width)):
                if joined[r, c]:
                    continue
                q = r * row_step + c * point_step
                if near(values[p], values[p + 1], values[p + 2], values[q], values[q + 1], values[q + 2], limit):
                    joined[r, c] = True
                    if max(abs(r - row), abs(c - column)) == k:
                        queue[last, 0], queue[last, 1] = r, c
                        last += 1


def grow_by_tiles(
    values: Any,
    row_step: int,
    point_step: int,
    seed: tuple[int, int],
    limit: Any,
    k: int,
    measured: Words,
    community: Words,
) -> Words:
    """The same for windows up to 7, five times as fast: a window lies in four words, and most of it has joined.

    Nearly all of those who are left in a window are outliers, which every window round them would try again.
    They are set aside: who has no link to the 3×3 community of the seed can only join from somebody who is not
    of that community either, so that the windows of its members need not look at them.

    Args:
        values: of the cloud, as `flattened` gives them, with both steps.
        row_step: see there.
        point_step: see there.
        seed: row and column of the initial point I.
        limit: R².
        k: half the window: 2 or 3.
        measured: (H, words) bits of the measured points; bit i of word w is column 64 w + i.
        community: likewise those that links in the 3×3 window join to the seed, under the same R.

    Returns:
        (H, words) bits of those who joined.
    """
    height = len(measured)
    left, members = _tiled(measured), _tiled(community)
    open_, ranges = members.copy(), np.empty((2, *members.shape), values.dtype)
    ranges[0], ranges[1] = np.inf, -np.inf

    def measure(band: slice) -> None:
        _measure_heights(values, row_step, point_step, members, band.start, band.stop, ranges)

    def touch(band: slice) -> None:
        _touch(values, row_step, point_step, limit, k, left, members, ranges, band.start, band.stop, open_)

    for work in (measure, touch):
        in_bands(work, len(members) - 2, members.shape[1], _LEAST_TILES)
    aside = left & ~open_
    queue = np.empty(64 * measured.size, np.uint64)
    _grow_tiles(values, row_step, point_step, seed[0], seed[1], limit, k, members, open_, aside, queue)
    return measured & ~_untiled(open_ | aside, height)


def _tiled(rows: Words) -> Words:
    """Bits (H, words) as tiles (⌈H / 8⌉ + 2, 8 words + 2), with empty ones all round."""
    height, words = rows.shape
    down = (height + _SIDE - 1) // _SIDE
    lines = np.zeros((down * _SIDE, words * _SIDE), np.uint8)
    lines[:height] = np.ascontiguousarray(rows, '<u8').view(np.uint8)
    tiles = np.ascontiguousarray(lines.reshape(down, _SIDE, -1).transpose(0, 2, 1)).view('<u8')[..., 0]
    return np.pad(tiles.astype(np.uint64, copy=False), 1)


def _untiled(tiles: Words, height: int) -> Words:
    """`_tiled` back."""
    inner = np.ascontiguousarray(tiles[1:-1, 1:-1], '<u8')
    lines = inner.view(np.uint8).reshape(*inner.shape, _SIDE).transpose(0, 2, 1)
    rows = np.ascontiguousarray(lines.reshape(-1, inner.shape[1])[:height])
    return rows.view('<u8').astype(np.uint64, copy=False)


@kernel
def _in_window(tiles: Words, top: Any, left: Any) -> Any:
    """The 8×8 points from (top, left) on, as a tile, out of the four tiles that they lie in.

    Rows and columns count from the tiles' own corner, 8 before the cloud's.
    """
    r, c = top >> _THREE, left >> _THREE
    right, down = left & _SEVEN, (top & _SEVEN) << _THREE
    kept = _COLUMN * ((_ONE << (_EIGHT - right)) - _ONE)
    above = ((tiles[r, c] >> right) & kept) | ((tiles[r, c + _ONE] << (_EIGHT - right)) & ~kept)
    r += _ONE
    below = ((tiles[r, c] >> right) & kept) | ((tiles[r, c + _ONE] << (_EIGHT - right)) & ~kept)
    return (above >> down) | ((below << _ONE) << (_LAST - down))


@kernel
def _window(k: int, margin: int) -> Any:
    """A window of 2k+1 points a side as a tile, less a `margin` on all sides."""
    bits = _ZERO
    for r in range(margin, 2 * k + 1 - margin):
        for c in range(margin, 2 * k + 1 - margin):
            bits |= _ONE << np.uint64(_SIDE * r + c)
    return bits


@kernel
def _measure_heights(
    values: Any, row_step: int, point_step: int, members: Words, first: int, last: int, ranges: Any
) -> None:
    """Write the least and the greatest z of the members in each tile, of tile rows `first` to before `last`.

    To `ranges`, (2, as members), which come as +Inf and -Inf: nobody.
    """
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
def _touch(
    values: Any,
    row_step: int,
    point_step: int,
    limit: Any,
    k: int,
    measured: Words,
    members: Words,
    ranges: Any,
    first: int,
    last: int,
    open_: Words,
) -> None:
    """Add to the members in `open_` all who have a link to a member in their window.

    Most have heights from which no member round them can be near: the squared distance to any of them is not
    below the square of the difference to the nearer end of their range, because rounding never changes an order.
    """
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
                    if near(x, y, z, values[q], values[q + _ONE], values[q + _TWO], limit):
                        open_[tile_row, tile_column] |= _ONE << place
                        break


@kernel
def _grow_tiles(
    values: Any,
    row_step: int,
    point_step: int,
    seed_row: int,
    seed_column: int,
    limit: Any,
    k: int,
    members: Words,
    open_: Words,
    aside: Words,
    queue: Any,
) -> None:
    """`grow_in_order`, which takes those who join out of `open_` and `aside`.

    The lowest bit of a window stands for its first point in row order. Rows and columns count from the tiles' own
    corner; in `queue` they are the two halves of a word.
    """
    across, down = np.uint64(point_step), np.uint64(row_step)
    window, inside, half = _window(k, 0), _window(k, 1), np.uint64(k)
    row, column = np.uint64(seed_row) + _EIGHT, np.uint64(seed_column) + _EIGHT
    open_[row >> _THREE, column >> _THREE] &= ~_bit(row, column)
    queue[0] = (row << _HALF) | column
    first, last = _ZERO, _ONE
    while first < last:
        row, column = queue[first] >> _HALF, queue[first] & _LOW
        first += _ONE
        p = (row - _EIGHT) * down + (column - _EIGHT) * across
        x, y, z = values[p], values[p + _ONE], values[p + _TWO]
        top, left = row - half, column - half
        bits = _in_window(open_, top, left)
        stranger = not members[row >> _THREE, column >> _THREE] & _bit(row, column)
        if stranger:
            bits |= _in_window(aside, top, left)
        bits &= window
        corner = p - half * (down + across)
        while bits:
            place = trailing_zeros(bits)
            bits &= bits - _ONE
            q = corner + (place >> _THREE) * down + (place & _SEVEN) * across
            if near(x, y, z, values[q], values[q + _ONE], values[q + _TWO], limit):
                r, c = top + (place >> _THREE), left + (place & _SEVEN)
                others = ~_bit(r, c)
                open_[r >> _THREE, c >> _THREE] &= others
                if stranger:
                    aside[r >> _THREE, c >> _THREE] &= others
                if not (inside >> place) & _ONE:
                    queue[last] = (r << _HALF) | c
                    last += _ONE


@kernel
def _bit(row: Any, column: Any) -> Any:
    """The bit of a point in its tile."""
    return _ONE << (((row & _SEVEN) << _THREE) | (column & _SEVEN))
