# SPDX-License-Identifier: Apache-2.0
"""The floor of the focus measure: what noise and rounding of the camera alone give.

A curve whose peak is not above this floor has no peak, however deep its valleys are. In an area without texture,
rounding to whole gray levels leaves no noise at all in some frames and that of the contours between two levels in
others.

Noise is what changes between two frames that follow each other, once they are equally bright. Where the part is
far out of focus, which it is somewhere in some frame, nothing else changes. The lower quartile of the modified
Laplacian of these differences is therefore that of noise. It is taken in the same filter as that of the frames, so
that noise may be correlated. It depends on the gray level, as shot noise does.
"""

import itertools
import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.kernels.compiled import kernel

from .curve_rows import CODES_PER_OCTAVE
from .measure import Frame, MeasureParameters

_STRIPS = 16
"""Rows in which noise is measured."""

_PERIODS = np.arange(2, 17)
"""Periods of a texture, in rows, all phases of which these rows see."""

_SEGMENT = 64
"""Pixels over which it is averaged."""

_GRAYS, _LEVELS = 34, 512
"""Bins of the gray level, two per octave, and of M_l, 16 per octave."""

_PER_GRAY, _PER_LEVEL = 2, 16
_LOWEST_LEVEL = -8
"""Octave of the lowest bin of M_l."""

_QUARTILE = 0.25
_LEAST_SAMPLES = 8

_ROUNDING = 2.0
"""Mean M_l, in gray levels, of pixels that are at random at one of two neighbouring gray levels."""

TABLE = 256
"""Entries of the table of floors."""


class Floor(NamedTuple):
    """The code of the floor of each pixel: `table` at its gray level, plus `rows`, plus `columns`."""

    table: NDArray[np.int32]
    """(TABLE,): code of the floor in a whole window, by gray level divided by 2^shift."""

    shift: int

    rows: NDArray[np.int32]
    """(H,): codes by which the window of a pixel is smaller at the edge of the frame, negative."""

    columns: NDArray[np.int32]
    """(W,): likewise."""

    def band(self, rows: slice) -> 'Floor':
        """The floor of some rows."""
        return self._replace(rows=self.rows[rows])


class NoiseSampler:
    """Measures the noise of the frames of a stack, in constant memory.

    Args:
        frame: (H, W), the first frame.
        parameters: of the focus measure.
        side: of a binned pixel; 1: the frames are not binned.
    """

    def __init__(self, frame: Frame, parameters: MeasureParameters, side: int = 1) -> None:
        self._parameters = parameters
        self._side = side
        height, width = frame.shape
        step = parameters.step
        self._rows = step + spread_rows(height - 2 * step)
        self._previous = np.zeros((len(self._rows), 3, width), np.float32)
        self._counts = np.zeros((_GRAYS, _LEVELS), np.int64)
        self._quantum = 0
        self._has_previous = False

    def add(self, frame: Frame, scale: float) -> None:
        """Take in a frame.

        Args:
            frame: (H, W).
            scale: factor that makes the frame as bright as the others.
        """
        if self._quantum != 1 and self._rows.size:
            self._quantum = math.gcd(self._quantum, int(np.gcd.reduce(frame[self._rows], axis=None)))
        _sample(
            frame,
            self._rows,
            self._parameters.step,
            np.float32(scale),
            self._has_previous,
            self._previous,
            self._counts,
        )
        self._has_previous = True

    def floor(self, image: Frame, scale: float) -> Floor:
        """The floor of the focus measure.

        Args:
            image: (H, W), the all-in-focus image.
            scale: factor that makes the mean frame as bright as the codes say.
        """
        height, width = image.shape
        step, half, threshold = self._parameters
        shift = max(int(image.max()).bit_length() - 8, 0)
        table = np.zeros(TABLE, np.int32)
        if threshold == 0:
            noise = self._noise((np.arange(TABLE) << shift) * scale)
            # Rounding of the pixels in a bin is at random, so that that of their sum grows with its root.
            rounding = _ROUNDING * max(self._quantum, 1) * self._side * scale
            level = np.maximum(noise, rounding) * (2 * half + 1) ** 2  # noise above rounding has it in it
            table = np.rint(1 + CODES_PER_OCTAVE * np.log2(level)).astype(np.int32)
        return Floor(table, shift, _smaller(height, step, half), _smaller(width, step, half))

    def _noise(self, gray: NDArray[np.floating]) -> NDArray[np.float64]:
        """Mean M_l of noise at scaled gray levels; 0 where no frame follows another."""
        counts = self._counts.sum(axis=1)
        known = np.flatnonzero(counts >= _LEAST_SAMPLES)
        if known.size == 0:
            return np.zeros(len(gray))
        share = np.cumsum(self._counts[known], axis=1) / counts[known, np.newaxis]
        level = np.argmax(share >= _QUARTILE, axis=1)
        noise = np.where(level > 0, 2.0 ** (level / _PER_LEVEL + _LOWEST_LEVEL), 0.0)
        found: NDArray[np.float64] = np.interp(np.log2(gray + 1.0) * _PER_GRAY, known + 0.5, noise)
        return found


@lru_cache
def spread_rows(height: int) -> NDArray[np.int64]:
    """Choose rows that are spread over a frame and over the phases of each period.

    Evenly spaced rows can all be on the lines of a ruled part. There the contrast changes most from frame to
    frame, and would count as noise. Each row is therefore the one near the middle of its part of the frame that
    shares its phase with the fewest rows before it, summed over the periods; of several, the nearest.

    Args:
        height: rows to choose from; 0 or less: there are none.

    Returns:
        (n,) ascending, n of at most _STRIPS.
    """
    chosen: list[int] = []
    edges = [max(height, 0) * part // _STRIPS for part in range(_STRIPS + 1)]
    for first, end in itertools.pairwise(edges):
        middle = (first + end - 1) / 2
        near = sorted(range(first, end), key=lambda row: abs(row - middle))[: _PERIODS[-1]]
        apart = np.array(near, np.int64)[:, np.newaxis, np.newaxis] - np.array(chosen, np.int64)[:, np.newaxis]
        shared = np.count_nonzero(apart % _PERIODS == 0, axis=(1, 2))
        chosen += [near[int(np.argmin(shared))]] if near else []
    return np.array(chosen, np.int64)


def _smaller(size: int, step: int, half: int) -> NDArray[np.int32]:
    """Codes by which the sum over a window is smaller near the ends of an axis, where the window is cut off."""
    inside = np.zeros(size + 2 * half)
    inside[half : half + size] = 0.5  # M_l along the other axis
    inside[half + step : half + size - step] += 0.5
    window = np.convolve(inside, np.ones(2 * half + 1), 'valid')
    codes: NDArray[np.int32] = np.rint(CODES_PER_OCTAVE * np.log2(window / (2 * half + 1))).astype(np.int32)
    return codes


@kernel
def _sample(
    frame: Frame,
    rows: NDArray[np.int64],
    step: int,
    scale: np.float32,
    has_previous: bool,
    previous: NDArray[np.float32],
    counts: NDArray[np.int64],
) -> None:
    """Count the mean M_l of the difference from the previous frame, and keep this frame in its place.

    Args:
        frame: (H, W).
        rows: (R,), where to measure.
        step: s of eq. 1.
        scale: factor of the frame.
        has_previous: whether there is a previous frame.
        previous: (R, 3, W), scaled rows of the previous frame: above, here, below; overwritten.
        counts: (_GRAYS, _LEVELS), by gray level and M_l, updated.
    """
    width = frame.shape[1]
    difference = np.empty((3, width), np.float32)
    grays = np.empty(width, np.float32)
    for k in range(rows.size):
        for part in range(3):
            pixels, old, change = frame[rows[k] + (part - 1) * step], previous[k, part], difference[part]
            for x in range(width):
                pixel = np.float32(pixels[x]) * scale
                change[x] = pixel - old[x]
                if part == 1:
                    grays[x] = pixel + old[x]
                old[x] = pixel
        if not has_previous:
            continue
        above, here, below = difference[0], difference[1], difference[2]
        for start in range(step, width - step, _SEGMENT):
            end = min(start + _SEGMENT, width - step)
            total, gray = np.float32(0), np.float32(0)
            for x in range(start, end):
                total += abs(np.float32(2) * here[x] - here[x - step] - here[x + step])
                total += abs(np.float32(2) * here[x] - above[x] - below[x])
                gray += grays[x]
            mean = total / np.float32(end - start) * np.float32(np.sqrt(0.5))  # the noise of one frame of two
            level = 0
            if mean > 0:
                octaves = np.log2(np.float64(mean)) - _LOWEST_LEVEL
                level = min(max(math.floor(octaves * _PER_LEVEL + 0.5), 1), _LEVELS - 1)
            gray /= np.float32(2 * (end - start))
            octave = np.log2(np.float64(gray) + 1)
            counts[min(math.floor(octave * _PER_GRAY), _GRAYS - 1), level] += 1
