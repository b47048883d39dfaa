"""How exact the depth from a focus stack is, and what its quality is worth: on simulated stacks."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from socialcircle_ros.focus import FocusStack
from socialcircle_ros.settings import FocusSettings
from socialcircle_ros.simulation import INSTRUMENTS, NOISELESS, Camera, Material, Stage, make_specimen, simulate

SEEDS = tuple(range(30, 38))
"""Held out: the quality was fitted on other seeds."""

SHAPE = (176, 224)
QUALITIES = (0.5, 0.7, 0.9, 0.98)


@dataclass(frozen=True)
class DepthScenario:
    """How a stack is taken."""

    name: str
    share_of_depth_of_field: float
    """z-step in depths of field."""
    noisy: bool


SCENARIOS = (
    DepthScenario('noise-free, step DOF', 1.0, noisy=False),
    DepthScenario('6000 e-, 8 bits, step DOF', 1.0, noisy=True),
    DepthScenario('6000 e-, 8 bits, step DOF/4', 0.25, noisy=True),
)


@dataclass(frozen=True)
class DepthError:
    """Errors over the good pixels (within a quarter of the depth of field) of all seeds, in z-steps."""

    scenario: DepthScenario
    specimen: str
    fit: str
    rms: float
    bias: float
    good: float
    """Share of the pixels that are good."""


def depth_errors(seeds: Sequence[int] = SEEDS) -> Iterator[DepthError]:
    """Measure simulated stacks of plain material (no glints or dark spots), scenario by scenario.

    Args:
        seeds: of surface and noise.
    """
    for scenario in SCENARIOS:
        for specimen in ('flat', 'ball'):
            errors: dict[str, list[npt.NDArray[Any]]] = {'gauss': [], 'gauss3': []}
            counts = dict.fromkeys(errors, 0)
            for seed in seeds:
                step, stacks, truth = _measured(scenario, specimen, seed)
                for fit, stack in stacks.items():
                    verdict = truth.classify(stack.finish().depth)
                    errors[fit].append(verdict.error[verdict.good] / step)
                    counts[fit] += int(np.count_nonzero(verdict.good))
            pixels = len(seeds) * SHAPE[0] * SHAPE[1]
            for fit, parts in errors.items():
                off = np.concatenate(parts)
                rms, bias = float(np.sqrt(np.mean(off**2))), float(np.mean(off))
                yield DepthError(scenario, specimen, fit, rms, bias, counts[fit] / pixels)


def quality_shares(seeds: Sequence[int] = SEEDS) -> dict[float, tuple[float, float]]:
    """What quality is worth, on grooves and pits with glints and dark walls.

    Returns:
        For each of `QUALITIES`: the share of pixels with at least this quality, and the share of good ones
        among those of them that are good or bad beyond doubt.
    """
    qualities: list[npt.NDArray[Any]] = []
    good: list[npt.NDArray[Any]] = []
    certain: list[npt.NDArray[Any]] = []
    for specimen in ('metal_groove', 'pits', 'flat', 'composite'):
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
    quality, is_good, is_certain = (np.concatenate(parts) for parts in (qualities, good, certain))
    shares = {}
    for bound in QUALITIES:
        above = quality >= bound
        shares[bound] = (float(above.mean()), float(is_good[above & is_certain].mean()))
    return shares


def _measured(scenario: DepthScenario, specimen: str, seed: int) -> tuple[float, dict[str, FocusStack], Any]:
    """z-step in µm, the stack under both fits, and the truth."""
    optics = INSTRUMENTS['10x']
    step = optics.depth_of_field * scenario.share_of_depth_of_field
    plain = Material(glints=0, stained=0, polished=0, burnished=0)
    scan = simulate(
        make_specimen(specimen, *SHAPE, material=plain, seed=seed),
        camera=Camera(full_well=6000) if scenario.noisy else NOISELESS,
        stage=Stage(jitter=0, encoder_noise=0),  # the stage's own error is not the fit's
        flicker=0.0,
        z_step=step,
        seed=seed,
    )
    stacks = {fit: FocusStack(FocusSettings(fit=fit)) for fit in ('gauss', 'gauss3')}
    for frame in scan.frames():
        for stack in stacks.values():
            stack.add(frame.image, frame.z)
    return step, stacks, scan.truth
