# SPDX-License-Identifier: Apache-2.0
"""Depth from focus with the focus measures of other libraries, on the same simulated stacks.

No other Python package measures depth from a focus stack, so far as we know. What people use is a focus measure of
OpenCV or SciPy, the sharpest frame of each pixel, and a Gaussian through its neighbours. The measures are those
that S. Pertuz, D. Puig, M. A. Garcia found best (Pattern Recognition 46 (2013) 1415-1432,
DOI 10.1016/j.patcog.2012.11.011): Laplacian, gradient (Tenengrad) and local variance of the gray levels. Each peer
runs at each of its scales, and the one with the smallest error counts, which only a known truth can tell.
"""

import importlib
import importlib.util
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from socialcircle_ros.focus import TRUSTED_QUALITY, FocusStack, Frame
from socialcircle_ros.kernels import bands
from socialcircle_ros.kernels.order_statistics import MAD_TO_SIGMA
from socialcircle_ros.simulation import INSTRUMENTS, Simulation, Stage, simulate

SEEDS = (30, 31)
"""Held-out seeds, as those of `depth_error`."""

SHAPE = (176, 224)
OURS = 'socialcircle'
TRUSTED = f'{OURS}, quality ≥ {TRUSTED_QUALITY:g}'

_WINDOWS = (3, 5, 9, 13, 17)
_APERTURES = (1, 3, 5, 7)
_TIMED_SHAPE = (1000, 1000)
_TIMED_FRAMES = 12

Measure = Callable[[Frame], npt.NDArray[np.float32]]


@dataclass(frozen=True)
class PeerRow:
    """What one method gives on one stack.

    Attributes:
        stack: what is scanned.
        method: name of the method; for peers with the best of their scales.
        deviation: 1.48 times the median absolute error of all pixels with a depth, z-steps.
        good: share of the pixels that are good, within a quarter of the depth of field.
        bad: share of the pixels that are bad.
        frame_ms: least processor time for a frame of a million pixels; the fit after the last frame is left out.
    """

    stack: str
    method: str
    deviation: float
    good: float
    bad: float
    frame_ms: float


class _Scaled(NamedTuple):
    """A focus measure at one scale."""

    name: str
    measure: Measure


STACKS = {
    'rough plane, step DOF': ('flat', 1.0),
    'rough plane, step DOF/4': ('flat', 0.25),
    'groove, step DOF/4': ('metal_groove', 0.25),
}


def missing_peers() -> list[str]:
    """The peers that are not installed."""
    names = {'cv2': 'opencv-python-headless', 'scipy': 'scipy'}
    return [package for module, package in names.items() if not importlib.util.find_spec(module)]


def peer_rows(seeds: Sequence[int] = SEEDS) -> Iterator[PeerRow]:
    """Measure ours and each peer that is installed.

    Args:
        seeds: of surface and noise.
    """
    families = _families()
    our_time = _our_time()
    for stack, (specimen, share) in STACKS.items():
        depth_of_field = INSTRUMENTS['10x'].depth_of_field
        scans = [
            simulate(
                specimen, *SHAPE, seed=seed, z_step=share * depth_of_field, stage=Stage(jitter=0, encoder_noise=0)
            )
            for seed in seeds
        ]
        taken = [[(frame.image, frame.z) for frame in scan.frames()] for scan in scans]
        ours = [_ours(frames) for frames in taken]
        yield _row(stack, OURS, scans, [depth for depth, _ in ours], our_time)
        sure = [np.where(quality >= TRUSTED_QUALITY, depth, np.nan) for depth, quality in ours]
        yield _row(stack, TRUSTED, scans, sure, our_time)
        for name, methods in families.items():
            rows = [
                (
                    _row(stack, f'{name}, {each.name}', scans, [_peak(each.measure, one) for one in taken], 0.0),
                    each,
                )
                for each in methods
            ]
            best, method = min(rows, key=lambda pair: pair[0].deviation)
            yield replace(best, frame_ms=_time_of(method.measure))


def _families() -> dict[str, list[_Scaled]]:
    """The peers that are installed, with their scales."""
    families: dict[str, list[_Scaled]] = {}
    if importlib.util.find_spec('cv2'):
        families['OpenCV Laplacian'] = [
            _Scaled(f'aperture {aperture}, window {window}', _opencv_laplacian(aperture, window))
            for aperture in _APERTURES
            for window in _WINDOWS
        ]
        families['OpenCV gradient'] = [
            _Scaled(f'window {window}', _opencv_gradient(window)) for window in _WINDOWS
        ]
    if importlib.util.find_spec('scipy'):
        families['SciPy variance'] = [_Scaled(f'window {window}', _scipy_variance(window)) for window in _WINDOWS]
    return families


def _opencv_laplacian(aperture: int, window: int) -> Measure:
    cv2 = importlib.import_module('cv2')

    def measure(frame: Frame) -> npt.NDArray[np.float32]:
        laplacian = np.abs(cv2.Laplacian(frame, cv2.CV_32F, ksize=aperture))
        found: npt.NDArray[np.float32] = cv2.boxFilter(laplacian, -1, (window, window))
        return found

    return measure


def _opencv_gradient(window: int) -> Measure:
    cv2 = importlib.import_module('cv2')

    def measure(frame: Frame) -> npt.NDArray[np.float32]:
        across, down = cv2.Sobel(frame, cv2.CV_32F, 1, 0), cv2.Sobel(frame, cv2.CV_32F, 0, 1)
        found: npt.NDArray[np.float32] = cv2.boxFilter(across * across + down * down, -1, (window, window))
        return found

    return measure


def _scipy_variance(window: int) -> Measure:
    ndimage = importlib.import_module('scipy.ndimage')

    def measure(frame: Frame) -> npt.NDArray[np.float32]:
        gray = frame.astype(np.float32)
        mean = ndimage.uniform_filter(gray, window)
        found: npt.NDArray[np.float32] = ndimage.uniform_filter(gray * gray, window) - mean * mean
        return found

    return measure


def _peak(measure: Measure, frames: Sequence[tuple[Frame, float]]) -> npt.NDArray[np.float64]:
    """Depth from a Gaussian through the sharpest frame and its neighbours; NaN at the ends of the scan."""
    curves = np.stack([np.maximum(measure(frame), 1e-6) for frame, _ in frames])
    z = np.array([position for _, position in frames])
    best = np.argmax(curves, axis=0)
    inner = np.clip(best, 1, len(z) - 2)[np.newaxis]
    before, here, after = (np.log(np.take_along_axis(curves, inner + k, 0)[0]) for k in (-1, 0, 1))
    bend = before - 2 * here + after
    offset = np.divide(before - after, 2 * bend, out=np.zeros_like(bend), where=bend < 0)
    depth: npt.NDArray[np.float64] = z[inner[0]] + np.clip(offset, -1, 1) * float(np.median(np.diff(z)))
    return np.where((best > 0) & (best < len(z) - 1), depth, np.nan)


def _ours(frames: Sequence[tuple[Frame, float]]) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float32]]:
    stack = FocusStack()
    for frame, z in frames:
        stack.add(frame, z)
    result = stack.finish()
    return result.depth, result.quality


def _row(
    stack: str,
    method: str,
    scans: Sequence[Simulation],
    depths: Sequence[npt.NDArray[np.float64]],
    frame_ms: float,
) -> PeerRow:
    verdicts = [scan.truth.classify(depth) for scan, depth in zip(scans, depths, strict=True)]
    errors = np.concatenate([np.abs(verdict.error[~verdict.missing]) for verdict in verdicts])
    step = float(np.median(np.diff(scans[0].travel.z)))
    return PeerRow(
        stack,
        method,
        float(MAD_TO_SIGMA * np.median(errors)) / step,
        float(np.mean([verdict.good.mean() for verdict in verdicts])),
        float(np.mean([verdict.bad.mean() for verdict in verdicts])),
        frame_ms,
    )


def _timed_frames() -> list[Frame]:
    rng = np.random.default_rng(0)
    return [rng.integers(0, 255, _TIMED_SHAPE, np.uint8) for _ in range(_TIMED_FRAMES)]


def _time_of(measure: Measure) -> float:
    """Least processor time of the focus measure of a frame on one core, ms."""
    if importlib.util.find_spec('cv2'):
        importlib.import_module('cv2').setNumThreads(1)
    times = []
    for frame in _timed_frames():
        start = time.thread_time()
        measure(frame)
        times.append(1e3 * (time.thread_time() - start))
    return min(times)


def _our_time() -> float:
    """Least processor time of `FocusStack.add` on one core, ms."""
    stack, times = FocusStack(), []
    limit, bands.limit = bands.limit, 1
    try:
        for number, frame in enumerate(_timed_frames()):
            start = time.thread_time()
            stack.add(frame, number)
            times.append(1e3 * (time.thread_time() - start))
    finally:
        bands.limit = limit
    return min(times)
