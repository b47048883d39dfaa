# SPDX-License-Identifier: Apache-2.0
"""Why a point was called an outlier, in the figures that a person can check on the map. No viser."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from socialcircle_ros.circle import remove_outliers
from socialcircle_ros.cloud import Cloud, Mask
from socialcircle_ros.kernels.order_statistics import MAD_TO_SIGMA
from socialcircle_ros.lengths import length_text
from socialcircle_ros.settings import CircleSettings, RosValue

from .display import Drawing

_LEAST_NEIGHBOURS = 24  # kept points that tell what surrounds a point
_FIRST_REACH, _LONGEST_REACH = 4, 64
_MOST_OF_AN_ISLAND = 1_000_000


@dataclass(frozen=True)
class Explanation:
    """What speaks for and against a point.

    Attributes:
        row: of the point.
        column: of the point.
        height: of the point, as displayed.
        is_outlier: whether it was removed.
        is_measured: whether it is a point at all.
        above: height over the plane through the kept points round it; NaN where too few are near.
        spread: standard deviation of the kept points round it about that plane, from their median deviation.
        island: number of removed points that touch each other here; 0 for a kept point.
        nearest: distance to the nearest kept point within the window that was looked at; NaN where none is near.
        radius: of the social circle; NaN where it is not known.
        score: of the adaptive mode, above 0.5 for outliers; None in the other mode.
    """

    row: int
    column: int
    height: float
    is_outlier: bool
    is_measured: bool
    above: float
    spread: float
    island: int
    nearest: float
    radius: float
    score: float | None

    @property
    def in_spreads(self) -> float:
        """The height over its surroundings in spreads of them."""
        return self.above / self.spread if self.spread > 0 else math.nan

    def sentences(self, unit: str | None) -> list[str]:
        """The reason in words.

        Args:
            unit: of the lengths; None: it is not known.
        """
        where = f'row {self.row}, column {self.column}'
        if not self.is_measured:
            return [f'Not measured: {where}.']
        kind = 'Outlier' if self.is_outlier else 'Kept'
        found = [f'{kind}: {where}, height {length_text(self.height, unit)}.']
        if math.isnan(self.above):
            found.append('Too few kept points are near to say how high it is over them.')
        else:
            side = 'above' if self.above >= 0 else 'below'
            sentence = f'It lies {length_text(abs(self.above), unit)} {side} the kept points round it'
            if not math.isnan(self.in_spreads):
                times = f'{abs(self.in_spreads):.3g}'
                sentence += f', {times} times their spread of {length_text(self.spread, unit)}'
            found.append(f'{sentence}.')
        if self.island:
            found.append(f'Its island has {self.island:,} point{"s" if self.island > 1 else ""}.')
        if self.score is not None:
            found.append(f'Its score is {self.score:.2f}; above 0.5 is an outlier.')
        elif not (math.isnan(self.nearest) or math.isnan(self.radius)):
            relation = 'beyond' if self.nearest > self.radius else 'within'
            found.append(
                f'The nearest kept point is {length_text(self.nearest, unit)} away, {relation} the radius of'
                f' {length_text(self.radius, unit)}.'
            )
        return found


def explanation_of(
    drawing: Drawing,
    place: tuple[int, int],
    radius: float = math.nan,
    score: npt.NDArray[np.float32] | None = None,
) -> Explanation:
    """Find out why a point was called an outlier, or was kept.

    Args:
        drawing: the cloud with its outliers.
        place: row and column of the point.
        radius: of the social circle; NaN: not known.
        score: (H, W) of the adaptive mode; None in the other mode.
    """
    row, column = place
    kept = drawing.kept
    above, spread, nearest = _surroundings(drawing, kept, place)
    outliers = drawing.outliers
    is_outlier = bool(outliers[place])
    return Explanation(
        row=row,
        column=column,
        height=float(drawing.heights[place]),
        is_outlier=is_outlier,
        is_measured=bool(np.isfinite(drawing.heights[place])),
        above=above,
        spread=spread,
        island=_island(outliers, place) if is_outlier else 0,
        nearest=nearest,
        radius=radius,
        score=float(score[place]) if score is not None and np.isfinite(score[place]) else None,
    )


def scores_of(
    xyz: Cloud, values: Mapping[str, RosValue], depth_of_field: float | None
) -> npt.NDArray[np.float32] | None:
    """The scores of a cloud with the settings of the node, computed here as the node does; None in mode paper.

    Args:
        xyz: (H, W, 3) as measured.
        values: of the node's parameters.
        depth_of_field: of the stack that gave the cloud; None: it is not known.

    Raises:
        SocialCircleError: the settings are invalid, or the cloud cannot be filtered.
    """
    settings = CircleSettings.from_ros(values).of_a_stack(depth_of_field)
    return remove_outliers(xyz, settings).score if settings.mode == 'adaptive' else None


def _surroundings(drawing: Drawing, kept: Mask, place: tuple[int, int]) -> tuple[float, float, float]:
    """Height of a point over the kept points round it, their spread, and the distance to the nearest one."""
    row, column = place
    reach = _FIRST_REACH
    while True:
        rows = slice(max(0, row - reach), row + reach + 1)
        columns = slice(max(0, column - reach), column + reach + 1)
        near = kept[rows, columns].copy()
        near[row - rows.start, column - columns.start] = False
        if np.count_nonzero(near) >= _LEAST_NEIGHBOURS or reach >= _LONGEST_REACH:
            break
        reach *= 2
    if not near.any():
        return math.nan, math.nan, math.nan
    xyz = drawing.xyz[rows, columns][near].astype(np.float64)
    here = drawing.xyz[place].astype(np.float64)
    nearest = float(np.sqrt(((xyz - here) ** 2).sum(axis=1).min()))
    if np.count_nonzero(near) < _LEAST_NEIGHBOURS:
        return math.nan, math.nan, nearest
    down, across = np.nonzero(near)
    basis = np.column_stack([np.ones(len(down)), down + rows.start - row, across + columns.start - column])
    heights = drawing.heights[rows, columns][near]
    fit, *_ = np.linalg.lstsq(basis, heights)
    residuals = heights - basis @ fit
    spread = MAD_TO_SIGMA * float(np.median(np.abs(residuals - np.median(residuals))))
    return float(drawing.heights[place] - fit[0]), spread, nearest


def _island(outliers: Mask, place: tuple[int, int]) -> int:
    """Number of outliers that touch each other, also at corners, round one of them."""
    left = outliers.copy()
    left[place] = False
    waiting, count = [place], 0
    while waiting and count < _MOST_OF_AN_ISLAND:
        row, column = waiting.pop()
        count += 1
        first_row, first_column = max(0, row - 1), max(0, column - 1)
        near = left[first_row : row + 2, first_column : column + 2]
        for down, across in np.argwhere(near):
            waiting.append((first_row + int(down), first_column + int(across)))
        near[:] = False
    return count
