# SPDX-License-Identifier: Apache-2.0
"""Where each frame of a focus stack shows the part: its displacement and magnification, and their correction.

Macro lenses magnify as they focus, and a stage that is not aligned with the optical axis moves sideways. Each
frame is compared with the one before it. Phase correlation finds the displacement, see `drift`. Least squares on
thinned copies then refine it together with the magnification: B. D. Lucas, T. Kanade, An iterative image
registration technique with an application to stereo vision, Proc. 7th Int. Joint Conf. Artificial Intelligence
(1981) 674-679. The frame is then interpolated where the first frame has its pixels, with six samples along each
axis: linear or cubic interpolation would blur some frames more than others, which would pass for defocus.

Steep walls on both sides of the middle look like a change of the magnification, because the band in focus moves
along them: on a simulated groove with walls of 45° by 1 % at a numerical aperture of 0.1, and by 4 % at 0.3.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel

from .drift import PhaseCorrelation, thinned
from .measure import Frame

_MOST_SIDE, _LEAST_SIDE = 400, 24
"""Sides of the thinned copies, in thinned pixels."""

_LEAST_BIN = 2
"""Least side of a thinned pixel: the noise of each pixel of the camera stays in place."""

_COARSE = 10
"""Half-width of the window whose mean is subtracted from the copies: uneven light is not texture."""

_LEAST_PIXELS = 100
"""Thinned pixels that two copies must have in common to be compared."""

_MOST_TURNS = 12
_ENOUGH = 0.003
"""The fit ends where it moves the corner of the frame by less, in thinned pixels."""

_LEAST_CORRELATION = 0.3
"""Of two frames once they are registered; below it they cannot be compared."""

_MOST_ERROR = 0.1
"""A combination of displacement and magnification with a larger standard error, in thinned pixels, is left out."""

_TAPS, _SUBPIXELS = 6, 64
"""Samples of the interpolation along an axis, and steps of a pixel in which its weights are tabulated."""


class Motion(NamedTuple):
    """Where a frame shows what the first frame has at p from its middle: at magnification · p + displacement."""

    down: float = 0.0
    """Displacement along y, pixels."""

    right: float = 0.0
    """Displacement along x, pixels."""

    magnification: float = 1.0
    """Relative to that of the first frame."""

    def after(self, before: 'Motion') -> 'Motion':
        """The motion `before`, then this one."""
        return Motion(
            self.magnification * before.down + self.down,
            self.magnification * before.right + self.right,
            self.magnification * before.magnification,
        )


@dataclass(frozen=True)
class Registered:
    """What was corrected in a stack.

    Attributes:
        moved: the largest displacement of a pixel at the corners of the frames, pixels.
        magnification: the largest magnification of a frame relative to that of another one.
        failed: frames that could not be compared with the one before; they count as not moved since then.
    """

    moved: float
    magnification: float
    failed: int


class Registration:
    """Registers the frames of a stack to the first one, in the order in which they come.

    Neighbouring frames should be close in z: what is in focus in one must be recognisable in the next.

    Args:
        shape: (H, W) of the frames.
    """

    def __init__(self, shape: tuple[int, int]) -> None:
        self._shape = shape
        self._correlation = PhaseCorrelation()
        self._previous: NDArray[np.float32] | None = None
        self._motions: list[Motion] = []
        self._failed = 0
        self._inside = _Extent(0, shape[0], 0, shape[1])
        self._registered: Frame | None = None

    def add(self, frame: Frame, colours: NDArray[np.uint8] | None) -> tuple[Frame, NDArray[np.uint8] | None]:
        """Take in a frame, (H, W), and return it as the first frame shows the part.

        The result is overwritten by the next call. `colours`, (H, W, 3), are moved along, without interpolation.
        """
        motion = self._motion_of(frame)
        self._motions.append(motion)
        if motion == Motion():
            return frame, colours
        rows = _sampling(self._shape[0], motion.magnification, motion.down)
        columns = _sampling(self._shape[1], motion.magnification, motion.right)
        self._inside = self._inside.common(rows.inside, columns.inside)
        if self._registered is None or self._registered.dtype != frame.dtype:
            self._registered = np.empty_like(frame)
        registered = self._registered

        def move(band: slice) -> None:
            _resample(frame, rows.band(band), columns, _WEIGHTS, registered[band])

        in_bands(move, *frame.shape)
        if colours is not None:
            colours = colours[np.ix_(rows.nearest, columns.nearest)]
        return registered, colours

    @property
    def result(self) -> Registered:
        """What was corrected so far."""
        height, width = self._shape
        corners = np.array([(y, x) for y in (-height / 2, height / 2) for x in (-width / 2, width / 2)])
        at = np.array([[m.magnification * corners + (m.down, m.right)] for m in self._motions or [Motion()]])
        span = np.ptp(at.reshape(-1, len(corners), 2), axis=0)
        sizes = [motion.magnification for motion in self._motions] or [1.0]
        return Registered(float(np.hypot(*span.T).max()), float(max(sizes) / min(sizes)), self._failed)

    def outside(self, reach: int) -> NDArray[np.bool_]:
        """The pixels that left some frame, or are within `reach` of these, (H, W)."""
        height, width = self._shape
        top, bottom, left, right = self._inside
        outside = np.ones(self._shape, np.bool_)
        outside[
            top + reach * (top > 0) : max(bottom - reach * (bottom < height), 0),
            left + reach * (left > 0) : max(right - reach * (right < width), 0),
        ] = False
        return outside

    def _motion_of(self, frame: Frame) -> Motion:
        side = max(_LEAST_BIN, math.ceil(max(frame.shape) / _MOST_SIDE))
        before = self._motions[-1] if self._motions else Motion()
        if min(frame.shape) < side * _LEAST_SIDE:
            return before
        copy = _textured(np.log(thinned(frame, side)))
        previous, self._previous = self._previous, copy
        displacement = self._correlation.compare(frame)
        if previous is None:
            return before
        start = np.zeros(3)
        if displacement is not None:
            start[:2] = displacement.moved / side
        found = _fit(previous, copy, start)
        if found is None:
            self._failed += 1
            return before
        half = max(copy.shape) / 2
        return Motion(side * found[0], side * found[1], 1 + found[2] / half).after(before)


class _Extent(NamedTuple):
    """Rows from `top` to before `bottom`, columns likewise."""

    top: int
    bottom: int
    left: int
    right: int

    def common(self, rows: tuple[int, int], columns: tuple[int, int]) -> '_Extent':
        """The part that is also in these rows and columns."""
        return _Extent(
            max(self.top, rows[0]),
            min(self.bottom, rows[1]),
            max(self.left, columns[0]),
            min(self.right, columns[1]),
        )


class _Sampling(NamedTuple):
    """Where along an axis the pixels of the first frame are in another one."""

    first: NDArray[np.int32]
    """(n,): the first of the `_TAPS` pixels of the frame that a pixel is interpolated from, unless at the ends."""

    part: NDArray[np.int32]
    """(n,): the row of `_WEIGHTS`."""

    nearest: NDArray[np.int32]
    """(n,): the nearest pixel of the frame."""

    inside: tuple[int, int]
    """From where to before where the pixels are all in the frame."""

    def band(self, rows: slice) -> '_Sampling':
        return self._replace(first=self.first[rows], part=self.part[rows])


def _sampling(size: int, magnification: float, moved: float) -> _Sampling:
    middle = (size - 1) / 2
    at = np.rint((magnification * (np.arange(size) - middle) + middle + moved) * _SUBPIXELS).astype(np.int64)
    beyond = _SUBPIXELS // 2  # half a pixel beyond the middle of the last one is still in the picture
    known = np.flatnonzero((at >= -beyond) & (at <= (size - 1) * _SUBPIXELS + beyond))
    inside = (int(known[0]), int(known[-1]) + 1) if known.size else (0, 0)
    at = np.clip(at, 0, (size - 1) * _SUBPIXELS)
    whole, part = np.divmod(at, _SUBPIXELS)
    nearest = np.minimum((at + _SUBPIXELS // 2) // _SUBPIXELS, size - 1)
    return _Sampling(
        (whole - (_TAPS // 2 - 1)).astype(np.int32), part.astype(np.int32), nearest.astype(np.int32), inside
    )


def _weights() -> NDArray[np.float32]:
    """Weights of the samples for each part of a pixel, (_SUBPIXELS, _TAPS): Lanczos, normalised."""
    distance = np.arange(_TAPS) - (_TAPS // 2 - 1) - (np.arange(_SUBPIXELS) / _SUBPIXELS)[:, np.newaxis]
    weights = np.sinc(distance) * np.sinc(distance / (_TAPS // 2))
    found: NDArray[np.float32] = (weights / weights.sum(axis=1, keepdims=True)).astype(np.float32)
    return found


_WEIGHTS = _weights()


def _textured(copy: NDArray[np.float32]) -> NDArray[np.float32]:
    """A copy without noise and without uneven light, with unit variance."""
    for axis in (0, 1):
        for _ in range(2):
            copy = _mean_along(copy, 1, axis)
    even = _mean_along(_mean_along(copy, _COARSE, 0), _COARSE, 1)
    copy -= even
    copy /= max(float(np.std(copy)), 1e-9)
    return copy


def _mean_along(copy: NDArray[np.float32], half: int, axis: int) -> NDArray[np.float32]:
    """The means over 2 · half + 1 values along an axis, fewer at the ends."""
    moved = np.moveaxis(copy, axis, 0)
    size = len(moved)
    total = np.zeros((size + 1, moved.shape[1]))
    np.cumsum(moved, axis=0, out=total[1:])
    high, low = np.minimum(np.arange(size) + half + 1, size), np.maximum(np.arange(size) - half, 0)
    mean = (total[high] - total[low]) / (high - low)[:, np.newaxis]
    return np.ascontiguousarray(np.moveaxis(mean, 0, axis), np.float32)


def _fit(
    one: NDArray[np.float32], other: NDArray[np.float32], start: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """The motion from one copy to another: down, right, and outward at the middle of the longer side.

    Args:
        one: (h, w), with unit variance.
        other: (h, w), with unit variance.
        start: where the search starts.

    Returns:
        In thinned pixels, without what the texture does not tell; None: the copies do not match.
    """
    down = np.asarray(np.gradient(one, axis=0), np.float32)
    right = np.asarray(np.gradient(one, axis=1), np.float32)
    found, scale = start.astype(np.float64), 1.0
    correlation = 0.0
    matrix, side = np.zeros((3, 3)), np.zeros(3)
    for _ in range(_MOST_TURNS):
        pixels, squares, correlation = _add_up(one, other, down, right, found, scale, matrix, side)
        if pixels < _LEAST_PIXELS:
            return None
        scale = math.sqrt(squares / pixels)
        values, vectors = np.linalg.eigh(matrix)  # which reads the lower half
        known = scale / np.sqrt(np.maximum(values, 1e-12)) < _MOST_ERROR
        if not known.any():
            return None
        step = vectors[:, known] @ ((vectors[:, known].T @ side) / values[known])
        found -= step
        if np.abs(step).sum() < _ENOUGH:
            break
    if not (correlation >= _LEAST_CORRELATION and np.abs(found).max() < min(one.shape) / 4):
        return None
    return found


@kernel
def _add_up(
    one: NDArray[np.float32],
    other: NDArray[np.float32],
    down: NDArray[np.float32],
    right: NDArray[np.float32],
    motion: NDArray[np.float64],
    scale: float,
    matrix: NDArray[np.float64],
    side: NDArray[np.float64],
) -> tuple[int, float, float]:
    """Add up the normal equations of the least squares, and what the fit is judged by.

    Args:
        one: (h, w).
        other: (h, w), sampled where `motion` says.
        down: (h, w), gradient of `one` along y.
        right: (h, w), along x.
        motion: (3,), see `_fit`.
        scale: of the differences; larger ones weigh less.
        matrix: (3, 3), of the normal equations; its lower half is written.
        side: (3,), their right side, written.

    Returns:
        The number of pixels that both copies have, the sum of their squared differences, and their correlation.
    """
    height, width = one.shape
    half = max(height, width) / 2
    middle_y, middle_x = (height - 1) / 2, (width - 1) / 2
    matrix[:] = 0
    side[:] = 0
    squares, product, other_square, one_square, count = 0.0, 0.0, 0.0, 0.0, 0
    for row in range(1, height - 1):
        v = (row - middle_y) / half
        y = row + motion[0] + motion[2] * v
        top = math.floor(y)
        if top < 0 or top >= height - 1:
            continue
        low = y - top
        for column in range(1, width - 1):
            u = (column - middle_x) / half
            x = column + motion[1] + motion[2] * u
            left = math.floor(x)
            if left < 0 or left >= width - 1:
                continue
            along = x - left
            upper = other[top, left] * (1 - along) + other[top, left + 1] * along
            lower = other[top + 1, left] * (1 - along) + other[top + 1, left + 1] * along
            value = upper * (1 - low) + lower * low
            here = one[row, column]
            difference = value - here
            ratio = difference / scale
            weight = 1 / (1 + ratio * ratio / 4)
            gy, gx = down[row, column], right[row, column]
            out = gy * v + gx * u
            wy, wx, wo = weight * gy, weight * gx, weight * out
            matrix[0, 0] += wy * gy
            matrix[1, 0] += wy * gx
            matrix[2, 0] += wy * out
            matrix[1, 1] += wx * gx
            matrix[2, 1] += wx * out
            matrix[2, 2] += wo * out
            side[0] += wy * difference
            side[1] += wx * difference
            side[2] += wo * difference
            squares += difference * difference
            product += value * here
            other_square += value * value
            one_square += here * here
            count += 1
    power = other_square * one_square / max(count, 1)
    return count, squares, product / math.sqrt(max(power * count, 1e-12))


@kernel
def _resample(
    frame: Frame, rows: _Sampling, columns: _Sampling, weights: NDArray[np.float32], registered: Frame
) -> None:
    """Interpolate a frame at the places of `rows` and `columns`; beyond its edge it is its edge.

    Args:
        frame: (H, W).
        rows: of a band of (h,) rows.
        columns: (W,).
        weights: `_WEIGHTS`.
        registered: (h, W), written.
    """
    height, width = frame.shape
    most = np.float32(255 if frame.itemsize == 1 else 65535)
    line = np.empty(width + 2 * _TAPS, np.float32)
    for row in range(registered.shape[0]):
        line[:] = 0
        inner = line[_TAPS : _TAPS + width]
        for k in range(_TAPS):
            pixels = frame[min(max(rows.first[row] + k, 0), height - 1)]
            weight = weights[rows.part[row], k]
            for x in range(width):
                inner[x] += weight * np.float32(pixels[x])
        line[:_TAPS] = inner[0]
        line[_TAPS + width :] = inner[width - 1]
        result = registered[row]
        for x in range(width):
            first, part = columns.first[x] + _TAPS, columns.part[x]
            total = np.float32(0.5)
            for k in range(_TAPS):
                total += weights[part, k] * line[first + k]
            result[x] = min(max(total, np.float32(0)), most)
