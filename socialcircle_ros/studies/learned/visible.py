# SPDX-License-Identifier: Apache-2.0
"""How far the inserted outliers stand out: what the network finds of them, and what could be found at most."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.cloud import Mask
from socialcircle_ros.report.content import Cell, Column, Section, Table
from socialcircle_ros.simulation.outliers import Contaminated
from socialcircle_ros.studies.adaptive.inserted_outliers import StudiedSurface, insert_outliers
from socialcircle_ros.studies.comparison.study import Study

SHARES = (0.05, 0.01, 0.3)
"""Of the points that become outliers; the first is that of the table of patches."""
CONTRASTS = (1.0, 2.0, 3.0)
"""Least contrasts of the patches that a judge would find."""
_CLASSES = ((0.0, 1.0), (1.0, 2.0), (2.0, 3.0), (3.0, 10.0), (10.0, np.inf))
"""Contrasts from and below which patches are counted together."""
_SIZES = ((1, 40), (41, 150), (151, 2**31))
"""Numbers of outliers of patches that are counted together."""
_OUTLINE = 3.5  # points of the outline of a round patch, in square roots of its points
_AROUND = 10  # points around a patch that belong to its surroundings
_SURROUNDINGS = 0.9  # quantile of the differences there

FindMask = Callable[[NDArray[np.floating]], Mask]
"""The outliers that the network finds in heights."""


@dataclass(frozen=True, eq=False)
class InsertedPatch:
    """Outliers that were put in together.

    Attributes:
        rows, columns: (n,) of its outliers.
        contrast: the step at its border over the differences of neighbours around it.
    """

    rows: NDArray[np.intp]
    columns: NDArray[np.intp]
    contrast: float


class _Bounds(NamedTuple):
    """One surface and one seed.

    Attributes:
        f1: of the network.
        bounds: for each least contrast, the share of the outliers in patches with it, and F1 of a judge that finds
            these and nothing else.
    """

    f1: float
    bounds: list[tuple[float, float]]


def visible(study: Study, groups: Mapping[str, Sequence[StudiedSurface]], find: FindMask) -> list[Section]:
    """Compare the network with judges that find all that stands out, and nothing else.

    Args:
        study: its seeds give the outliers; medians are over them.
        groups: surfaces, by the name of their group.
        find: what the network finds.
    """
    rows: list[list[Cell]] = []
    for group, surfaces in groups.items():
        for share in SHARES:
            study.progress(f'{group}: what stands out of {share:.0%} irregular outliers')
            found = [[_bounds(each, share, seed, find) for seed in study.plan.seeds] for each in surfaces]
            cells: list[Cell] = [f'{group}, {len(surfaces)}', share]
            # (surfaces, seeds, 1 + 2 contrasts)
            values = np.array([[[each.f1, *np.ravel(each.bounds)] for each in seeds] for seeds in found])
            cells += np.median(np.median(values, axis=1), axis=0).tolist()
            rows.append(cells)
    columns = [Column('surfaces'), Column('irregular', '.0%'), Column('network: F1', '.3f')]
    for contrast in CONTRASTS:
        columns += [
            Column(f'contrast ≥ {contrast:g}: share of the outliers', '.0%'),
            Column('F1 if only these were found', '.3f'),
        ]
    text = (
        'The contrast of a patch is the median of the largest steps of its displacement between neighbours, as'
        ' many as its outline has points, over the 0.9 quantile of the differences between neighbours of the'
        ' untouched surface, in the window of the patch and 10 points around it. Isolated outliers count as found.'
        ' Medians over seeds and surfaces.'
    )
    tables = [
        Table('learned_visible', 'What could be found', columns, rows),
        Table('learned_patches', 'What is found of the patches', _PATCH_COLUMNS, _by_patches(study, groups, find)),
    ]
    return [Section('What stands out', [text], items=tables)]


_PATCH_COLUMNS = [
    Column('contrast'), Column('outliers of a patch'), Column('patches', 'd'),
    Column('share of all outliers', '.1%'), Column('found', '.0%'),
]  # fmt: skip


def _by_patches(study: Study, groups: Mapping[str, Sequence[StudiedSurface]], find: FindMask) -> list[list[Cell]]:
    """Rows by the contrast and by the size of patches, of all surfaces together."""
    sizes, contrasts, found, alone, alone_found = [], [], [], 0, 0
    for surface in (each for surfaces in groups.values() for each in surfaces):
        for seed in study.plan.seeds:
            made = insert_outliers(surface, SHARES[0], seed, 'irregular')
            outliers = find(made.points[..., 2])
            single = made.outlier & (made.inserted.cluster < 0)
            alone += int(np.count_nonzero(single))
            alone_found += int(np.count_nonzero(outliers[single]))
            for patch in patches(surface, made.inserted):
                sizes.append(len(patch.rows))
                contrasts.append(patch.contrast)
                found.append(int(np.count_nonzero(outliers[patch.rows, patch.columns])))
    size, contrast, hits = np.array(sizes, int), np.array(contrasts, float), np.array(found, int)
    total = max(alone + int(size.sum()), 1)
    rows: list[list[Cell]] = [['', 'isolated', None, alone / total, alone_found / max(alone, 1)]]
    for low, high in _CLASSES:
        for least, most in _SIZES:
            chosen = (contrast >= low) & (contrast < high) & (size >= least) & (size <= most)
            points = int(size[chosen].sum())
            if points:
                name = f'≥ {low:g}' if high == np.inf else f'{low:g} to {high:g}'
                range_ = f'{least} to {most}' if most < _SIZES[-1][1] else f'{least} and more'
                share = int(hits[chosen].sum()) / points
                rows.append([name, range_, int(np.count_nonzero(chosen)), points / total, share])
    return rows


def _bounds(surface: StudiedSurface, share: float, seed: int, find: FindMask) -> _Bounds:
    made = insert_outliers(surface, share, seed, 'irregular')
    found = [patch for patch in patches(surface, made.inserted) if patch.contrast >= min(CONTRASTS)]
    bounds = []
    for contrast in CONTRASTS:
        mask = made.outlier & (made.inserted.cluster < 0)
        for patch in found:
            if patch.contrast >= contrast:
                mask[patch.rows, patch.columns] = True
        part = int(np.count_nonzero(mask)) / max(int(np.count_nonzero(made.outlier)), 1)
        bounds.append((part, made.score(mask).f1))
    return _Bounds(made.score(find(made.points[..., 2])).f1, bounds)


def patches(surface: StudiedSurface, inserted: Contaminated) -> Iterator[InsertedPatch]:
    """The patches that were put into a surface, but for those without an outlier.

    Args:
        surface: before the insertion.
        inserted: what `insert_outliers` has put in.
    """
    heights = surface.cloud.points[..., 2]
    places = np.flatnonzero(inserted.cluster > 0)
    numbers = inserted.cluster.ravel()[places]
    order = np.argsort(numbers, kind='stable')
    edges = np.flatnonzero(np.diff(numbers[order])) + 1
    for members in np.split(places[order], edges):
        rows, columns = np.unravel_index(members, heights.shape)
        outlier = inserted.outlier[rows, columns]
        if not outlier.any():
            continue
        contrast = _contrast(heights, inserted.displacement, rows, columns)
        yield InsertedPatch(rows[outlier], columns[outlier], contrast)


def _contrast(
    heights: NDArray[np.floating],
    displacement: NDArray[np.float64],
    rows: NDArray[np.intp],
    columns: NDArray[np.intp],
) -> float:
    """The step at the border of a patch over the differences of neighbours around it; Inf where these are 0."""
    near = np.zeros((np.ptp(rows) + 3, np.ptp(columns) + 3))
    near[rows - rows.min() + 1, columns - columns.min() + 1] = displacement[rows, columns]
    steps = np.sort(_differences(near))[::-1]
    step = float(np.median(steps[: max(4, round(_OUTLINE * len(rows) ** 0.5))]))
    top, left = (max(0, int(each.min()) - _AROUND) for each in (rows, columns))
    window = heights[top : int(rows.max()) + _AROUND + 1, left : int(columns.max()) + _AROUND + 1]
    differences = _differences(window.astype(np.float64))
    known = differences[np.isfinite(differences)]
    around = float(np.quantile(known, _SURROUNDINGS)) if known.size else 0.0
    return step / around if around else float('inf')


def _differences(heights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sizes of the differences between neighbours along x and along y."""
    sizes: NDArray[np.float64] = np.abs(np.concatenate([np.diff(heights, axis=axis).ravel() for axis in (0, 1)]))
    return sizes
