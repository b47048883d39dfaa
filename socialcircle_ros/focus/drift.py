# SPDX-License-Identifier: Apache-2.0
"""How far the part or the camera moves sideways while a focus stack is taken.

Some frames are compared with each other, by phase correlation of thinned copies: C. D. Kuglin,
D. C. Hines, The phase correlation image alignment method, Proc. Int. Conf. Cybernetics and Society (1975) 163-165.
Three changes make it robust here. The logarithm of the light is taken, so that flicker is a constant. The
magnitudes are kept up to their square root, because frequencies that the defocus suppresses have only noise. And a
displacement counts only along the directions in which the texture tells it.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.kernels.compiled import kernel

from .measure import Frame

_EVERY = 4
"""One frame in this many is compared with the one before it among them."""

_FIRST_EVERY, _FIRST = 2, 16
"""Likewise among the first frames, so that a short stack is covered to its end."""

_MOST_SIDE, _LEAST_SIDE = 128, 16
"""Sides of the thinned frames, in thinned pixels."""

_LEAST_BIN = 2
"""Least side of a thinned pixel: the noise of each pixel of the camera stays in place."""

_REACH = 12
"""Largest displacement between two frames that are compared, in thinned pixels."""

_SMOOTH = 1.0
"""Standard deviation of the low-pass filter, in thinned pixels: it gives the peak a shape that is easy to fit."""

_LOW = 0.02
"""Width of the low frequencies that are left out, cycles per thinned pixel: uneven light is not texture."""

_LEAST_CONTRAST = 0.01
"""Contrast that both frames must share. The unequal pixels of a camera have less, and stay where they are."""

_LEAST_COHERENCE = 0.75
"""Least mean cosine of the phases about those of the displacement."""

_MOST_ERROR = 0.1
"""Largest standard error of a displacement, in thinned pixels."""

_MOST_TOTAL_ERROR = 0.7
"""Largest standard error of the drift, in pixels, unless the drift is three times the error."""

_DIRECTIONS = 32


class DriftMeter:
    """Measures the drift of the frames of a stack.

    It keeps one thinned frame, and two numbers for each frame that is compared.
    """

    def __init__(self) -> None:
        self._frames = 0
        self._correlation = PhaseCorrelation()
        self._path: list[NDArray[np.float64]] = [np.zeros(2)]
        self._variance = 0.0  # of the last point of the path

    def add(self, frame: Frame) -> None:
        """Take in a frame, (H, W), in the order of time, all of one shape."""
        if self._frames % (_EVERY if self._frames > _FIRST else _FIRST_EVERY) == 0:
            self._compare(frame)
        self._frames += 1

    @property
    def drift(self) -> float | None:
        """The largest distance between two frames, in pixels, over the frames that can be compared.

        None: no frames can be compared, because they show too little texture, or the standard error of the
        distance is too large.
        """
        if len(self._path) == 1:
            return None
        angles = np.pi / _DIRECTIONS * np.arange(_DIRECTIONS)
        along = np.array(self._path) @ np.array([np.cos(angles), np.sin(angles)])
        drift = float(np.ptp(along, axis=0).max())
        return drift if math.sqrt(self._variance) < max(_MOST_TOTAL_ERROR, drift / 3) else None

    def _compare(self, frame: Frame) -> None:
        step = self._correlation.compare(frame)
        if step is not None:
            self._path.append(self._path[-1] + step.moved)
            self._variance += step.variance


@dataclass(frozen=True, eq=False)
class Displacement:
    """How far one frame is from another."""

    moved: NDArray[np.float64]
    """(2,) along y and x, in pixels."""

    variance: float
    """Of its estimate, in squared pixels."""


class PhaseCorrelation:
    """Compares each frame with the one before it."""

    def __init__(self) -> None:
        self._band: _Band | None = None
        self._previous: NDArray[np.complex128] | None = None

    def compare(self, frame: Frame) -> Displacement | None:
        """How far a frame, (H, W), is from the one before it; None: there is none, or too little texture."""
        height, width = frame.shape
        side = max(_LEAST_BIN, math.ceil(max(height, width) / _MOST_SIDE))
        if min(height, width) < side * _LEAST_SIDE:
            return None
        copy = np.log(thinned(frame, side))
        band = self._band
        if band is None:
            band = self._band = _band(copy.shape)
        spectrum = np.fft.rfft2((copy - copy.mean()) * band.window)
        previous, self._previous = self._previous, spectrum
        found = None if previous is None else _displacement(spectrum * np.conj(previous), band)
        return found and Displacement(side * found.moved, side**2 * found.variance)


def thinned(frame: Frame, side: int) -> NDArray[np.float32]:
    """The sums over squares of pixels, at least 1 each, (H // side, W // side)."""
    copy = np.empty((frame.shape[0] // side, frame.shape[1] // side), np.float32)
    _thin(frame, side, copy)
    return copy


@dataclass(frozen=True, eq=False)
class _Band:
    """What the comparison needs for frames of one shape."""

    shape: tuple[int, int]
    """(H, W) of the thinned frames."""

    window: NDArray[np.float64]
    """(H, W), it makes the frames fade out at their edges; its mean square is 1."""

    weights: NDArray[np.float64]
    """(H, W // 2 + 1), of each frequency; those that stand for two have twice the weight."""

    rows: NDArray[np.float64]
    """(H,), wave numbers along y, radians per thinned pixel."""

    columns: NDArray[np.float64]
    """(W // 2 + 1,), wave numbers along x."""


def _band(shape: tuple[int, int]) -> _Band:
    height, width = shape
    window = np.outer(np.hanning(height), np.hanning(width))
    window /= math.sqrt(np.mean(window**2))
    rows = np.asarray(2 * np.pi * np.fft.fftfreq(height), np.float64)
    columns = np.asarray(2 * np.pi * np.fft.rfftfreq(width), np.float64)
    square = np.add.outer(rows**2, columns**2)
    weights = np.exp(-square * _SMOOTH**2 / 2) * (1 - np.exp(-square / (2 * (2 * np.pi * _LOW) ** 2)))
    weights[:, 1 : (width + 1) // 2] *= 2
    return _Band(shape, window, weights, rows, columns)


def _displacement(cross: NDArray[np.complex128], band: _Band) -> Displacement | None:
    """How far a frame is from another one.

    Args:
        cross: (H, W // 2 + 1), its spectrum times the conjugate of that of the other frame.
        band: of frames of this shape.

    Returns:
        The displacement in thinned pixels, without the part along directions in which there is too little
        texture; None: there is too little in any direction.
    """
    height, width = band.shape
    magnitude = np.abs(cross)
    contrast = math.sqrt(float(np.sum(magnitude * band.weights))) / (height * width)
    if contrast < _LEAST_CONTRAST:
        return None
    magnitude[magnitude == 0] = 1
    root = cross / np.sqrt(magnitude)
    half = band.weights.copy()
    half[:, 1 : (width + 1) // 2] /= 2
    surface = np.roll(np.fft.irfft2(root * half, s=band.shape), (_REACH, _REACH), (0, 1))
    surface = surface[: 2 * _REACH + 1, : 2 * _REACH + 1]
    row, column = divmod(int(np.argmax(surface)), surface.shape[1])
    if not (0 < row < surface.shape[0] - 1 and 0 < column < surface.shape[1] - 1):
        return None
    found = np.array([row - _REACH, column - _REACH]) + np.array(
        [_peak(surface[row - 1 : row + 2, column]), _peak(surface[row, column - 1 : column + 2])]
    )
    power = np.abs(root) * band.weights
    total = float(power.sum())
    turn = np.outer(np.exp(1j * found[0] * band.rows), np.exp(1j * found[1] * band.columns))
    coherence = float(np.vdot(turn.conj(), root * band.weights).real) / total
    if coherence < _LEAST_COHERENCE:
        return None
    # Least squares of the phases: their variance is 2 (1 - coherence), the wave numbers are the design matrix.
    along_rows, along_columns = power.sum(axis=1) @ band.rows**2, power.sum(axis=0) @ band.columns**2
    mixed = band.rows @ power @ band.columns
    information = np.array([[along_rows, mixed], [mixed, along_columns]]) / total
    independent = total**2 / float(np.sum(power**2))
    values, vectors = np.linalg.eigh(information)
    error = np.sqrt(2 * max(1 - coherence, 0.0) / independent / np.maximum(values, 1e-12))
    known = error <= _MOST_ERROR
    if not known.any():
        return None
    return Displacement(vectors[:, known] @ (vectors[:, known].T @ found), float(np.sum(error[known] ** 2)))


def _peak(values: NDArray[np.float64]) -> float:
    """Where a Gaussian through three values has its peak, about the middle one, which is the largest."""
    left, middle, right = np.log(np.maximum(values, 1e-9 * values[1]))
    curvature = left - 2 * middle + right
    return float((left - right) / (2 * curvature)) if curvature < 0 else 0.0


@kernel
def _thin(frame: Frame, side: int, thinned: NDArray[np.float32]) -> None:
    """Add up squares of pixels, at least 1 each.

    Args:
        frame: (H, W).
        side: of a square, pixels.
        thinned: (H // side, W // side), written.
    """
    height, width = thinned.shape
    columns = np.empty(width * side, np.uint32)
    for row in range(height):
        columns[:] = 0
        for y in range(row * side, (row + 1) * side):
            pixels = frame[y]
            for x in range(width * side):
                columns[x] += np.uint32(pixels[x])
        for x in range(width):
            total = np.uint64(0)
            for k in range(x * side, (x + 1) * side):
                total += columns[k]
            thinned[row, x] = np.float32(total) if total > 0 else np.float32(1)
