# SPDX-License-Identifier: Apache-2.0
"""Quality and scale of depth from focus on simulated instruments that differ in optics, camera and light."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from socialcircle_ros.focus import TRUSTED_QUALITY, FocusResult, FocusStack
from socialcircle_ros.settings import FocusSettings
from socialcircle_ros.simulation import INSTRUMENTS, Camera, Optics, PixelVerdict, Stage, simulate

SEEDS = (40, 41)
"""Held-out seeds: the quality value was fitted on others."""

SHAPE = (150, 186)
BOUNDS = (0.5, 0.7, 0.9, 0.98)
STEPS = (0, 1, 2, 4, 8)
_HALF_WINDOWS = {8: 10}
"""Half-window for a step, where it is not the default."""


def oversampled(times: float) -> Optics:
    """The objective 10x on a camera with this many pixels, along each axis, for one of the usual camera."""
    usual = INSTRUMENTS['10x']
    return replace(usual, pixel=usual.pixel / times)


@dataclass(frozen=True)
class Case:
    """A specimen, and the instrument that scans it; 8 bits and 10 000 electrons if not said."""

    specimen: str
    optics: Optics
    camera: Camera
    name: str


CASES = (
    Case('metal_groove', INSTRUMENTS['10x'], Camera(), 'groove, 10x'),
    Case('metal_groove', INSTRUMENTS['10x'], Camera(exposure=0.06), 'groove, 10x, a tenth of the light'),
    Case('metal_groove', oversampled(2), Camera(exposure=0.06), 'groove, oversampled 2×, a tenth of the light'),
    Case('steep_groove', INSTRUMENTS['20x'], Camera(exposure=0.12), 'steep groove, 20x, a fifth of the light'),
    Case('steps', INSTRUMENTS['50x'], Camera(exposure=0.12), 'steps, 50x, a fifth of the light'),
    Case('ball', INSTRUMENTS['10x'], Camera(full_well=2000), 'ball, 10x, 2000 e-'),
    Case('pits', INSTRUMENTS['5x'], Camera(bits=12, full_well=100_000), 'pits, 5x, 12 bits, 100 000 e-'),
    Case('composite', INSTRUMENTS['20x'], Camera(), 'composite, 20x'),
    Case('flat', INSTRUMENTS['10x'], Camera(exposure=0.03), 'rough plane, 10x, a twentieth of the light'),
    Case('flat', oversampled(4), Camera(), 'rough plane, oversampled 4×'),
    Case('metal_groove', oversampled(4), Camera(exposure=0.12), 'groove, oversampled 4×, a fifth of the light'),
)


@dataclass(frozen=True)
class Calibration:
    """What the quality value of one instrument predicts.

    Attributes:
        name: of specimen and instrument.
        step: of the focus measure, as it was chosen for most seeds.
        shares: for each of `BOUNDS`, the share of the pixels with at least this quality, and the share of good
            pixels among those of them that are certainly good or bad.
    """

    name: str
    step: int
    shares: dict[float, tuple[float, float]]


@dataclass(frozen=True)
class ScaleFigure:
    """What a step of the focus measure gives on stacks of a rough plane.

    Attributes:
        name: of the instrument.
        asked: `focus.step`; 0: chosen.
        used: the step that was used for most seeds.
        trusted: share of the pixels with `TRUSTED_QUALITY` or more.
        rms: error of the pixels with any depth up to a depth of field off, in depths of field.
    """

    name: str
    asked: int
    used: int
    trusted: float
    rms: float


def calibrations(seeds: Sequence[int] = SEEDS, shape: tuple[int, int] = SHAPE) -> Iterator[Calibration]:
    """Measure what the quality predicts, on each of `CASES`.

    Args:
        seeds: of surface and noise.
        shape: of the frames.
    """
    for case in CASES:
        found = [_measured(case, seed, shape, FocusSettings()) for seed in seeds]
        quality = np.concatenate([result.quality.ravel() for result, _ in found])
        good = np.concatenate([verdict.good.ravel() for _, verdict in found])
        certain = np.concatenate([(verdict.good | verdict.bad).ravel() for _, verdict in found])
        shares = {
            bound: (float(np.mean(quality >= bound)), float(good[certain & (quality >= bound)].mean()))
            for bound in BOUNDS
        }
        yield Calibration(case.name, _usual([result.step for result, _ in found]), shares)


def scale_figures(seeds: Sequence[int] = SEEDS, shape: tuple[int, int] = SHAPE) -> Iterator[ScaleFigure]:
    """Compare the chosen step with fixed ones, on a camera that fits the optics, and on finer ones.

    Args:
        seeds: of surface and noise.
        shape: of the frames.
    """
    for times in (1, 2, 4):
        optics = oversampled(times)
        name = f'oversampled {times}×' if times > 1 else '10x'
        case = Case('flat', optics, Camera(), name)
        for step in STEPS:
            settings = FocusSettings(step=step, half_window=_HALF_WINDOWS.get(step, FocusSettings().half_window))
            found = [_measured(case, seed, shape, settings, optics.depth_of_field / 2) for seed in seeds]
            errors: npt.NDArray[np.float64] = np.concatenate(
                [verdict.error[np.abs(verdict.error) < optics.depth_of_field] for _, verdict in found]
            )
            yield ScaleFigure(
                name,
                step,
                _usual([result.step for result, _ in found]),
                float(np.mean([np.mean(result.quality >= TRUSTED_QUALITY) for result, _ in found])),
                float(np.sqrt(np.mean(errors**2))) / optics.depth_of_field,
            )


def _measured(
    case: Case, seed: int, shape: tuple[int, int], settings: FocusSettings, z_step: float | None = None
) -> tuple[FocusResult, PixelVerdict]:
    """The result of one stack, and the verdict on it."""
    scan = simulate(
        case.specimen, *shape, instrument=case.optics, camera=case.camera, z_step=z_step,
        stage=Stage(jitter=case.optics.depth_of_field / 60), seed=seed,
    )  # fmt: skip
    stack = FocusStack(settings)
    for frame in scan.frames():
        stack.add(frame.image, frame.z)
    result = stack.finish()
    return result, scan.truth.classify(result.depth)


def _usual(steps: Sequence[int]) -> int:
    return max(sorted(set(steps)), key=list(steps).count)
