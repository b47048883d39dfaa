"""Real surfaces, whose truth nobody knows: what each filter removes, and what that changes."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from socialcircle_ros.metrics.areal import texture
from socialcircle_ros.report.content import Cell, Column, Picture, Section, Table

from . import drawings
from .labelled_clouds import with_z_scaled
from .methods import KINDS, method
from .study import Study


@dataclass(frozen=True, eq=False)
class MeasuredCloud:
    """A measured cloud (H, W, 3), NaN where not measured, and the unit of its lengths."""

    name: str
    points: npt.NDArray[Any]
    unit: str


def measured_surfaces(study: Study, clouds: Sequence[MeasuredCloud]) -> list[Section]:
    """Each filter at its default on each cloud, and the social circle with heights scaled to the pitch."""
    pictures, rows = [], []
    for cloud in clouds:
        study.tell(f'{cloud.name}: filtering and drawing')
        answers = [(method(kind(), '').name, method(kind(), '')(cloud.points).outliers) for kind in KINDS]
        circle = method(KINDS[0](), '')
        answers.insert(1, (f'{circle.name}, z scaled', circle(with_z_scaled(cloud.points)).outliers))
        rows += [_row(cloud, name, found) for name, found in answers]
        pictures.append(
            Picture(
                f'real_{cloud.name}',
                drawings.real_surface(cloud.points, cloud.unit, answers),
                f'{cloud.name}: what each filter leaves and removes at its default.',
            )
        )
    text = (
        'Nobody knows which of these points are wrong, so there are no scores: look at what was removed. The'
        ' social circle compares lengths in x, y and z alike, so that on instruments whose heights are far'
        ' smaller than their pitch it cannot see outliers; "z scaled" gives it the same cloud with heights in a'
        ' unit in which 4 σ of the differences of neighbours are 2 pitches.'
    )
    columns = [
        Column('surface'), Column('filter'), Column('measured points', ',d'), Column('removed', ',d'),
        Column('removed', '.2%'), *(Column(f'{name} change', '+.1%') for name in ('Sa', 'Sq', 'Sz')),
    ]  # fmt: skip
    note = 'Sa, Sq, Sz (ISO 25178-2, levelled, form not removed): after filtering, relative to before.'
    table = Table('real', 'Real surfaces, each filter at its default', columns, rows, note)
    return [Section('Real surfaces', [text], items=[table, *pictures])]


def _row(cloud: MeasuredCloud, name: str, found: npt.NDArray[np.bool_]) -> list[Cell]:
    z = cloud.points[..., 2]
    before, after = texture(z), texture(np.where(found, np.nan, z))
    measured, removed = int(np.isfinite(z).sum()), int(np.count_nonzero(found))
    changes = [after.sa / before.sa - 1, after.sq / before.sq - 1, after.sz / before.sz - 1]
    return [cloud.name, name, measured, removed, removed / measured, *changes]
