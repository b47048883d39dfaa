# SPDX-License-Identifier: Apache-2.0
"""Error of the depth from focus stacks, and what its quality value predicts, on simulated stacks."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from socialcircle_ros.focus import FocusStack
from socialcircle_ros.settings import FocusSettings
from socialcircle_ros.simulation import (
    INSTRUMENTS,
    NOISELESS,
    Camera,
    Material,
    Simulation,
    Stage,
    make_specimen,
    simulate,
)

SEEDS = tuple(range(30, 38))
"""Held-out seeds: the quality value was fitted on others."""

SHAPE = (176, 224)
QUALITIES = (0.5, 0.7, 0.9, 0.98)
_QUALITY_SPECIMENS = ('metal_groove', 'pits', 'flat', 'composite')


@dataclass(frozen=True)
class DepthScenario:
    """How a stack is scanned.

    Attributes:
        name: for tables.
        share_of_depth_of_field: z-step in depths of field.
        noisy: whether the camera has noise.
    """

    name: str
    share_of_depth_of_field: float
    noisy: bool


SCENARIOS = (
    DepthScenario('noise-free, step DOF', 1.0, noisy=False),
    DepthScenario('6000 e-, 8 bits, step DOF', 1.0, noisy=True),
    DepthScenario('6000 e-, 8 bits, step DOF/4', 0.25, noisy=True),
)


@dataclass(frozen=True)
class DepthError:
    """Errors over the good pixels of all seeds, in z-steps; good: within a quarter of the depth of field.

    Attributes:
        scenario: how the stacks are scanned.
        specimen: what is scanned.
        fit: the peak fit.
        rms: root mean square error.
        bias: mean error.
        good: share of the pixels that are good.
    """

    scenario: DepthScenario
    specimen: str
    fit: str
    rms: float
    bias: float
    good: float


def depth_errors(
    seeds: Sequence[int] = SEEDS, specimens: Sequence[str] = ('flat', 'ball')
) -> Iterator[DepthError]:
    """Measure simulated stacks of plain material (no glints, no dark spots) in each scenario.

    Args:
        seeds: of surface and noise.
        specimens: what is scanned.
    """
    for scenario in SCENARIOS:
        for specimen in specimens:
            errors: dict[str, list[npt.NDArray[np.float64]]] = {'gauss': [], 'gauss3': []}
            for seed in seeds:
                scan, z_step, stacks = _measured(scenario, specimen, seed)
                for fit, stack in stacks.items():
                    verdict = scan.truth.classify(stack.finish().depth)
                    errors[fit].append(verdict.error[verdict.good] / z_step)
            pixels = len(seeds) * SHAPE[0] * SHAPE[1]
            for fit, parts in errors.items():
                error = np.concatenate(parts)
                rms, bias = float(np.sqrt(np.mean(error**2))), float(np.mean(error))
                yield DepthError(scenario, specimen, fit, rms, bias, len(error) / pixels)


def quality_shares(seeds: Sequence[int] = SEEDS) -> dict[float, tuple[float, float]]:
    """Measure what the quality value predicts, on specimens with glints and dark walls.

    Returns:
        For each of `QUALITIES`: the share of pixels with at least this quality, and the share of good pixels
        among those of them that are certainly good or bad.
    """
    qualities: list[npt.NDArray[np.float32]] = []
    good: list[npt.NDArray[np.bool_]] = []
    certain: list[npt.NDArray[np.bool_]] = []
    for specimen in _QUALITY_SPECIMENS:
        for seed in seeds:
            scan = simulate(specimen, *SHAPE, seed=seed)
            stack = FocusStack()
            for frame in scan.frames():
                stack.add(frame.image, frame.z)
            result = stack.finish()
            verdict = scan.truth.classify(result.depth)
            qualities.append(result.quality.ravel())
            good.append(verdict.good.ravel())
            certain.append((verdict.good | verdict.bad).ravel())
    quality, is_good, is_certain = np.concatenate(qualities), np.concatenate(good), np.concatenate(certain)
    shares = {}
    for bound in QUALITIES:
        above = quality >= bound
        shares[bound] = (float(above.mean()), float(is_good[above & is_certain].mean()))
    return shares


def _measured(
    scenario: DepthScenario, specimen: str, seed: int
) -> tuple[Simulation, float, dict[str, FocusStack]]:
    """The scan, its z-step in µm, and its stack with each peak fit."""
    optics = INSTRUMENTS['10x']
    z_step = optics.depth_of_field * scenario.share_of_depth_of_field
    plain = Material(glints=0, stained=0, polished=0, burnished=0)
    scan = simulate(
        make_specimen(specimen, *SHAPE, material=plain, seed=seed),
        camera=Camera(full_well=6000) if scenario.noisy else NOISELESS,
        stage=Stage(jitter=0, encoder_noise=0),  # the stage's error is not an error of the fit
        flicker=0.0,
        z_step=z_step,
        seed=seed,
    )
    stacks = {fit: FocusStack(FocusSettings(fit=fit)) for fit in ('gauss', 'gauss3')}
    for frame in scan.frames():
        for stack in stacks.values():
            stack.add(frame.image, frame.z)
    return scan, z_step, stacks
