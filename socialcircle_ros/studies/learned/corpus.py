# SPDX-License-Identifier: Apache-2.0
"""The corpus: patches with their features and labels on disk, made once and used by many trainings."""

import io
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.circle.network.features import CHANNELS, CHANNELS_VERSION, channels_of
from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.storage import write_file

from .measured import TrainingSurface, noise_of, varied
from .outliers import SHARES, place_outliers
from .simulated import simulated_surface, with_holes

SIDE = 320
"""Side of a patch, in points."""
SHARD = 100
"""Patches in one file."""
REAL_SHARE = 0.5
"""Share of patches that are real surfaces."""
HEIGHT_CHANNELS = 5
"""Channels that change their sign with the heights; the last one says what is measured."""
PLANES = CHANNELS + 1
"""Planes of a patch: the features, and the label: 0 does not count, 1 good, 2 outlier."""
_WHOLE, _SMALLEST = 0.8, 0.1
"""Share of patches with the whole side, and the least part of it for others: a small cloud shows less texture."""
_HOLED_REAL, _HOLED_SIMULATED = 0.1, 0.3
"""Shares of real and of simulated surfaces in which points are left out."""
_LEAST_MEASURED = 0.1
"""Share of measured and plausible points that a patch needs; every third row and column has 0.11."""
RECIPE = '3'
"""Version of what patches are made of."""
_MOST_TRIES = 50

Patch = NDArray[np.float16]
"""(7, 320, 320) float16; a smaller surface lies in the upper left corner, and the rest does not count."""


@dataclass(frozen=True, eq=False)
class MadePatch:
    """A patch, the shape and the grain of its cloud, and whether its surface is real."""

    patch: Patch
    shape: tuple[int, int]
    grain: float
    real: bool


def make_patch(surfaces: Sequence[TrainingSurface], random: np.random.Generator) -> MadePatch:
    """One patch, real or simulated, with outliers or without."""
    for _ in range(_MOST_TRIES):
        side = SIDE if random.random() < _WHOLE else int(random.uniform(_SMALLEST, 1) * SIDE)
        real = bool(surfaces) and random.random() < REAL_SHARE
        if real:
            weights = np.array([surface.weight for surface in surfaces])
            chosen = surfaces[random.choice(len(surfaces), p=weights / weights.sum())]
            heights, plausible = varied(chosen, side, random)
        else:
            heights = simulated_surface(side, random)
            plausible = np.isfinite(heights)
        if not plausible.any():
            continue
        noise = noise_of(heights)  # before points are left out, without which neighbours may be missing
        if random.random() < (_HOLED_REAL if real else _HOLED_SIMULATED):
            heights = with_holes(heights, random)
            plausible = plausible & np.isfinite(heights)
        if plausible.mean() < _LEAST_MEASURED:
            continue
        if random.random() < 0.5:
            heights, plausible = heights.T, plausible.T
        placed = place_outliers(heights, noise, float(random.choice(SHARES)), random)
        counts = placed.certain & (plausible | placed.outlier)
        channels, grain = channels_of((placed.heights - np.nanmedian(placed.heights)).astype(np.float32))
        counts &= channels[HEIGHT_CHANNELS] > 0
        patch = np.zeros((PLANES, SIDE, SIDE), np.float16)
        height, width = heights.shape
        patch[:CHANNELS, :height, :width] = channels
        patch[CHANNELS, :height, :width] = np.where(counts, 1 + placed.outlier, 0)
        return MadePatch(patch, (height, width), grain, real)
    raise RuntimeError('no surface has enough measured points')


def make_shard(folder: Path, surfaces: Sequence[TrainingSurface], seed: int) -> Path:
    """Make one file of patches; the seed decides its content, and its name."""
    random = np.random.default_rng(seed)
    patches = np.empty((SHARD, PLANES, SIDE, SIDE), np.float16)
    made = []
    for place in range(SHARD):
        one = make_patch(surfaces, random)
        patches[place] = one.patch
        made.append(one)
    path = folder / f'{seed:06d}.npy'
    known = {
        'grain': [one.grain for one in made],
        'shape': [one.shape for one in made],
        'real': [one.real for one in made],
    }
    write_file(path.with_suffix('.json'), json.dumps({**known, **_origin(surfaces)}))
    content = io.BytesIO()
    np.save(content, patches)
    write_file(path, content.getvalue())
    return path


def _origin(surfaces: Sequence[TrainingSurface]) -> dict[str, object]:
    """What a file of the corpus was made from: versions of the channels and of the recipe, and the surfaces."""
    return {'channels': CHANNELS_VERSION, 'recipe': RECIPE, 'surfaces': [surface.name for surface in surfaces]}


def files_of(folder: Path) -> list[Path]:
    """The files of a corpus that are complete, in order."""
    return sorted(path for path in folder.glob('*.npy') if path.stem.isdigit())


def opinions_beside(path: Path) -> Path:
    """The file with the teacher's probabilities of a file of the corpus."""
    return path.with_suffix('.teacher.npy')


def make_corpus(
    folder: Path, surfaces: Sequence[TrainingSurface], seeds: Sequence[int], progress: Callable[[str], None]
) -> None:
    """Make the files of a corpus that are not there yet, one for each seed.

    Raises:
        SocialCircleError: a file that is there was made from other surfaces.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for path in sorted(folder.glob('*.json')):
        if not json.loads(path.read_text(encoding='utf-8')).items() >= _origin(surfaces).items():
            raise SocialCircleError(
                f'{path} was made from other surfaces, or by another version: give another folder, or remove this'
                ' one.'
            )
    for seed in seeds:
        if not (folder / f'{seed:06d}.npy').exists():
            make_shard(folder, surfaces, seed)
            progress(f'{folder / f"{seed:06d}.npy"}')
