# SPDX-License-Identifier: Apache-2.0
"""The scales at which a focus stack is measured, and the choice between them.

A camera may resolve more than its optics. The texture is then as coarse as several pixels, and F of a small step
holds more noise than texture. The frames are therefore also measured when they are binned, which takes a
sixteenth of the memory and little time. Once the stack ends, the scale is chosen from the quality of both. Both
scales are measured in every frame, so that the choice does not depend on the order of the frames.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel
from socialcircle_ros.settings import FocusSettings

from .centroid import correct_for_centroid
from .curve import Curves
from .evenness import lower_where_few_pixels_have_texture
from .fit import TRUSTED_QUALITY, fit_peaks
from .measure import Frame, MeasureParameters, checked_frame, measure_frame
from .noise import NoiseSampler
from .order import RECENT, Arrival, FrameOrder
from .steps import curve_width, lower_where_steps_are_wide

BIN = 4
"""Side of a binned pixel."""

COARSE_STEP = BIN
"""Step of the coarse scale in pixels of the frame: one binned pixel."""

_LEAST_SIDE = 8
"""Rows and columns that a binned frame must have."""

_LEAST_GAIN = 0.125
"""The coarse scale is chosen if it makes this share of the pixels more good, by their quality.

It resolves less: on walls it is trusted where it is wrong, which alone gave a gain of 0.1 on simulated grooves.
"""

_LEAST_SHARE = 0.2
"""Share of the pixels of the finest scale with a curve, from which these curves tell how wide the steps are."""

_WIDER = 1.2
"""How much wider the curves of binned pixels are at least than the optics make them; up to twice as wide."""

_EDGE = 1.0
"""Largest difference of two neighbours, in steps, between which depths are interpolated; above it is an edge."""

_BENT = 0.2
"""Distance of the depth of a coarse pixel from the mean of its window, in widths of the focus curve, at which the
odds that the depth is good are half of those by its curve: as measured on simulated grooves, steps and pits."""

_COUNTED_QUALITY = 0.3
"""Depths of lower quality do not count for that mean."""

_TOP = int(np.iinfo(np.uint16).max)


class DepthMaps(NamedTuple):
    """Depth, quality and reasons of each pixel, (H, W) each."""

    depth: NDArray[np.float64]
    """In the unit of z, NaN where there is no peak."""

    quality: NDArray[np.float32]
    """0 to 1."""

    reasons: NDArray[np.uint8]
    """Bits of `Reason`, without SATURATED."""


@dataclass(frozen=True, eq=False)
class ScaleResult:
    """What one scale gives.

    Attributes:
        maps: of the pixels of this scale; of all pixels of the frame from `choose`.
        width: standard deviation of the focus curve, in the unit of z; None: no curve is trusted.
        step: of the modified Laplacian, in pixels of the frame.
        half_window: of the focus measure, in pixels of the frame.
        fitted_width: median width of the fitted curves, whether they are trusted or not, in the unit of z; None:
            there are none.
        fitted_share: share of the pixels with such a curve.
        wide_steps: whether the frames are too few, or too far apart, for the focus curves.
    """

    maps: DepthMaps
    width: float | None
    step: int
    half_window: int
    fitted_width: float | None = None
    fitted_share: float = 0.0
    wide_steps: bool = False


class Scale:
    """The focus curves and the noise of the frames at one scale, in constant memory.

    Args:
        frame: (H, W), the first frame.
        parameters: of the focus measure, at this scale.
        side: of a binned pixel; 1: the frames are not binned.
        saturation: the largest gray level that a frame can have.
    """

    def __init__(self, frame: Frame, parameters: MeasureParameters, side: int, saturation: int) -> None:
        self._side = side
        self._shift = max(int(saturation).bit_length() + 4 - 16, 0)  # the sum of 16 pixels must fit into 16 bits
        self._gain = side * side / 2**self._shift if side > 1 else 1.0
        step, half, threshold = parameters
        self.parameters = MeasureParameters(step, half, round(threshold * self._gain))
        height, width = frame.shape
        self._binned = np.empty((height // side, width // side), np.uint16) if side > 1 else None
        self.curves = Curves.like(frame if self._binned is None else self._binned)
        self._noise = NoiseSampler(self.curves.image, self.parameters, side)

    @property
    def image(self) -> Frame:
        """Every pixel from its sharpest frame, at this scale."""
        return self.curves.image

    def begin(self, frame: Frame) -> None:
        """Forget all frames; this is the first of the next ones."""
        image = self._at_this_scale(frame)
        self.curves.begin(image)
        self._noise = NoiseSampler(image, self.parameters, self._side)

    def add(self, frame: Frame, arrival: Arrival, scale: float) -> None:
        """Add a frame.

        Args:
            frame: (H, W), like the others.
            arrival: what it means for the curves.
            scale: factor that makes the frame as bright as the others.
        """
        image = self._at_this_scale(frame)
        if not arrival.is_known:  # the same frame again would show no noise
            self._noise.add(image, scale / self._gain)
        self.curves.add(image, arrival, scale / self._gain, self.parameters)

    @property
    def step(self) -> int:
        """Step of the modified Laplacian in pixels of the frame."""
        return self.parameters.step * self._side

    def measure_at(self, frame: Frame, row: int, column: int) -> float:
        """F of one pixel of a frame, at this scale."""
        side, (height, width) = self._side, self.image.shape
        reach = self.parameters.step + self.parameters.half_window
        row, column = min(row // side, height - 1), min(column // side, width - 1)
        top, left = max(row - reach, 0), max(column - reach, 0)
        below, right = min(row + reach + 1, height), min(column + reach + 1, width)
        near = checked_frame(frame[top * side : below * side, left * side : right * side])
        if side > 1:
            binned = np.empty((below - top, right - left), np.uint16)
            _bin(near, self._shift, binned)
            near = binned
        return float(measure_frame(near, self.parameters)[row - top, column - left]) / self._gain

    def _at_this_scale(self, frame: Frame) -> Frame:
        binned = self._binned
        if binned is None:
            return frame

        def add_up(rows: slice) -> None:
            _bin(frame[rows.start * BIN : rows.stop * BIN], self._shift, binned[rows])

        in_bands(add_up, *binned.shape)
        return binned

    def measure(
        self, order: FrameOrder, z: NDArray[np.float64], scale: float, *, three_point: bool
    ) -> ScaleResult:
        """Measure the depth.

        Args:
            order: of the frames in z.
            z: (n,) of the frames, ascending.
            scale: factor that makes the mean frame as bright as the codes say.
            three_point: see `fit_peaks`.
        """
        for part in range(len(order.z), RECENT):
            self.curves.clear_slots(part)
        floor = self._noise.floor(self.image, scale / self._gain)
        depth, quality, reasons, best, spread = fit_peaks(self.curves, order, z, floor, three_point=three_point)
        lower_where_few_pixels_have_texture(self.image, self.parameters, quality, reasons)
        if not three_point:
            depth = correct_for_centroid(depth, quality, self.image, z, self.parameters)
        side, half = self._side, self.parameters.half_window
        width = best.median(best.at(quality) >= TRUSTED_QUALITY)
        if side > 1 and width is not None:
            _lower_where_bent(depth, quality, half, width)
        fitted_width, share = curve_width(spread, depth, quality, z)
        return ScaleResult(DepthMaps(depth, quality, reasons), width, self.step, half * side, fitted_width, share)


def scales_for(frame: Frame, settings: FocusSettings) -> tuple[Scale, ...]:
    """The scales at which frames like this one are measured, the finest first."""
    fine = MeasureParameters.of(settings)
    saturation = settings.saturation or np.iinfo(frame.dtype).max
    scales = [Scale(frame, fine, 1, saturation)]
    if settings.step == 0 and min(frame.shape) >= BIN * _LEAST_SIDE:
        # As wide as twice the window of the fine scale.
        coarse = MeasureParameters(COARSE_STEP // BIN, (2 * fine.half_window + BIN - 1) // BIN, fine.threshold)
        scales.append(Scale(frame, coarse, BIN, saturation))
    return tuple(scales)


def choose(
    scales: tuple[Scale, ...], z: NDArray[np.float64], measure: Callable[[Scale], ScaleResult]
) -> ScaleResult:
    """Measure each scale, and choose the coarse one where many more pixels are good by their quality.

    Args:
        scales: the finest first.
        z: (n,) of the frames, ascending.
        measure: measures a scale.

    Returns:
        The result of the chosen one, at every pixel of the frames.
    """
    shape = scales[0].image.shape
    found = finest = measure(scales[0])
    for scale in scales[1:]:
        if 1 - _mean(found.maps.quality) <= _LEAST_GAIN:
            break  # even a quality of 1 everywhere would not gain enough
        other = measure(scale)
        if _mean(other.maps.quality) - _mean(found.maps.quality) > _LEAST_GAIN:
            found = other
    if lower_where_steps_are_wide(found.maps.depth, found.maps.quality, z, _curve_width(found, finest)):
        found = replace(found, width=None, wide_steps=True)
    if found.maps.depth.shape != shape:  # not before: both scales at every pixel would take 13 bytes a pixel more
        found = replace(found, maps=_at_every_pixel(found.maps, z, shape))
    return found


def _curve_width(found: ScaleResult, finest: ScaleResult) -> float | None:
    """How wide the focus curves are by the chosen scale and, as far as that has curves, by the finest one."""
    if found is finest or found.fitted_width is None:
        return found.fitted_width
    width = found.fitted_width / _WIDER
    finer = (finest.fitted_width, finest.width) if finest.fitted_share >= _LEAST_SHARE else ()
    return min([width, *(each for each in finer if each is not None)])


def _mean(quality: NDArray[np.float32]) -> float:
    return float(np.mean(quality, dtype=np.float64))


def _lower_where_bent(
    depth: NDArray[np.float64], quality: NDArray[np.float32], half_window: int, width: float
) -> None:
    """Lower the quality of coarse pixels whose window is wider than what it shows: a wall, an edge, a pit.

    The curve of such a pixel is that of another depth in its window, and its fit does not show it. A tilted plane
    has its mean in the middle, and keeps its quality.

    Args:
        depth: (h, w), of the binned pixels.
        quality: (h, w), updated.
        half_window: N, in binned pixels.
        width: of the focus curves, in the unit of `depth`.
    """
    before = quality.copy()

    def lower(rows: slice) -> None:
        _lower_bent_rows(depth, before, rows.start, half_window, _BENT * width, quality[rows])

    in_bands(lower, *quality.shape)


@kernel
def _lower_bent_rows(
    depth: NDArray[np.float64],
    before: NDArray[np.float32],
    first: int,
    half: int,
    bent: float,
    quality: NDArray[np.float32],
) -> None:
    """`_lower_where_bent` for the rows from `first`."""
    height, width = depth.shape
    for row in range(first, first + len(quality)):
        for column in range(width):
            if before[row, column] == 0:
                continue
            total, count = 0.0, 0
            for y in range(max(row - half, 0), min(row + half + 1, height)):
                for x in range(max(column - half, 0), min(column + half + 1, width)):
                    if before[y, x] >= _COUNTED_QUALITY:
                        total += depth[y, x] - depth[row, column]
                        count += 1
            if count > 0:
                distance = total / count / bent
                likely = np.float64(before[row, column])
                quality[row - first, column] = np.float32(likely / (1 + (1 - likely) * distance * distance))


def _at_every_pixel(binned: DepthMaps, z: NDArray[np.float64], shape: tuple[int, int]) -> DepthMaps:
    """Interpolate the depth of binned pixels, with the quality and the reasons of the nearest one."""
    maps = DepthMaps(np.empty(shape), np.empty(shape, np.float32), np.empty(shape, np.uint8))
    edge = _EDGE * float(np.median(np.diff(z)))
    lowest, highest = float(z[0]), float(z[-1])

    def spread(rows: slice) -> None:
        _spread(binned, rows.start, rows.stop, edge, lowest, highest, maps)

    in_bands(spread, *shape)
    return maps


@kernel
def _bin(frame: Frame, shift: int, binned: NDArray[np.uint16]) -> None:
    """Write the sums over squares of BIN pixels, divided by 2^shift, rounded."""
    width = binned.shape[1] * BIN
    columns = np.empty(width, np.uint32)
    half = np.uint32((1 << shift) >> 1)
    for row in range(binned.shape[0]):
        one, two, three, four = frame[4 * row], frame[4 * row + 1], frame[4 * row + 2], frame[4 * row + 3]
        for x in range(width):
            columns[x] = np.uint32(one[x]) + np.uint32(two[x]) + np.uint32(three[x]) + np.uint32(four[x])
        sums = binned[row]
        for x in range(sums.size):
            total = columns[4 * x] + columns[4 * x + 1] + columns[4 * x + 2] + columns[4 * x + 3]
            sums[x] = min((np.uint32(total) + half) >> np.uint32(shift), np.uint32(_TOP))


@kernel
def _neighbours(at: int, size: int) -> tuple[int, int, float]:
    """The nearest binned pixel, the next one, and how far towards that one a pixel is, along one axis.

    At the edge of the frame the next one is on the other side, and the distance is negative.
    """
    centre = (at + 0.5) / BIN - 0.5
    near = min(at // BIN, size - 1)
    other = near + 1 if centre > near else near - 1
    if not 0 <= other < size:
        other = 2 * near - other
    return near, other, (centre - near) * (other - near)


@kernel
def _spread(
    binned: DepthMaps, first: int, end: int, edge: float, lowest: float, highest: float, maps: DepthMaps
) -> None:
    """`_at_every_pixel` for the rows from `first` to `end`."""
    depth = binned.depth
    height, width = depth.shape
    for row in range(first, end):
        near, other, down = _neighbours(row, height)
        for column in range(maps.depth.shape[1]):
            beside, next_one, along = _neighbours(column, width)
            here = depth[near, beside]
            right, below = depth[near, next_one] - here, depth[other, beside] - here
            across = depth[other, next_one] - here
            found = here
            if abs(right) <= edge and abs(below) <= edge and abs(across) <= 2 * edge:
                found += along * right + down * below + along * down * (across - right - below)
            elif abs(right) <= edge:
                found += along * right
            elif abs(below) <= edge:
                found += down * below
            maps.depth[row, column] = min(max(found, lowest), highest) if here == here else here  # noqa: PLR0124
            maps.quality[row, column] = binned.quality[near, beside]
            maps.reasons[row, column] = binned.reasons[near, beside]
