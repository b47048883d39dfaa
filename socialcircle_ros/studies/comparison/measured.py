# SPDX-License-Identifier: Apache-2.0
"""Measured clouds: surfaces of real instruments with unknown outliers.

The experiment shows what each filter removes and how the texture parameters change; it computes no score.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from socialcircle_ros.cloud import Cloud, Mask
from socialcircle_ros.kernels.order_statistics import MAD_TO_SIGMA
from socialcircle_ros.metrics.areal import texture
from socialcircle_ros.report.content import Cell, Column, Picture, Section, Table
from socialcircle_ros.settings import CircleSettings
from socialcircle_ros.studies.steps import Step
from socialcircle_ros.studies.workload import DRAWING, METHODS, million_points

from . import drawings
from .methods import SETTINGS_TYPES, default_settings, method
from .study import Study


@dataclass(frozen=True, eq=False)
class MeasuredCloud:
    """A measured cloud.

    Attributes:
        name: of the measurement.
        points: (H, W, 3), NaN where not measured.
        unit: of its lengths.
    """

    name: str
    points: Cloud
    unit: str


def measured_surfaces(study: Study, clouds: Sequence[MeasuredCloud]) -> list[Step]:
    """Filter each cloud with each filter at its default settings, and with the social circle on scaled heights."""
    return [
        Step(
            f'measured_{cloud.name}',
            million_points(cloud.points.shape) * METHODS + DRAWING,
            partial(_filtered, study, cloud),
        )
        for cloud in clouds
    ]


def _filtered(study: Study, cloud: MeasuredCloud, _: Sequence[Section]) -> list[Section]:
    study.progress(f'{cloud.name}: filtering and drawing')
    found = _found_by_filter(cloud)
    rows = [_row(cloud, name, outliers) for name, outliers in found]
    picture = Picture(
        f'real_{cloud.name}',
        drawings.measured_surface(cloud.points, cloud.unit, found),
        f'{cloud.name}: what each filter keeps and removes at its default settings.',
    )
    text = (
        'The outliers of these surfaces are unknown, so there are no scores; the pictures show what was removed.'
        ' The social circle compares lengths in x, y and z. Where heights are far smaller than the pitch, it'
        ' cannot detect outliers. "z scaled" filters the same cloud after its heights are multiplied by a factor'
        ' that makes 4 σ of the differences between neighbours equal to 2 pitches.'
    )
    columns = [
        Column('surface'), Column('filter'), Column('measured points', ',d'), Column('removed', ',d'),
        Column('removed', '.2%'), *(Column(f'{name} change', '+.1%') for name in ('Sa', 'Sq', 'Sz')),
    ]  # fmt: skip
    note = 'Sa, Sq, Sz: ISO 25178-2, levelled, form not removed; change from before to after filtering.'
    table = Table('real', 'Measured surfaces, each filter at its default settings', columns, rows, note)
    return [Section('Measured surfaces', [text], items=[table, picture])]


def with_z_scaled(points: Cloud) -> Cloud:
    """Scale the heights so that 4 σ of the differences between neighbours are 2 pitches.

    This is for instruments with heights much smaller or larger than the pitch.

    Args:
        points: (H, W, 3), NaN where not measured.

    Returns:
        A scaled copy; the cloud itself where σ is 0. σ is robust: 1.4826 times the median absolute difference.
    """
    along = np.abs(np.diff(points[..., 2].astype(np.float64), axis=1))
    across = np.abs(np.diff(points[..., 0].astype(np.float64), axis=1))
    sigma = MAD_TO_SIGMA * float(np.nanmedian(along))
    if not sigma > 0:
        return points
    scaled = points.copy()
    scaled[..., 2] *= 2 * float(np.nanmedian(across)) / (4 * sigma)
    return scaled


def _found_by_filter(cloud: MeasuredCloud) -> list[tuple[str, Mask]]:
    """The outliers that each filter finds, by name; the social circle on scaled heights comes second."""
    methods = [method(default_settings(settings_type), '') for settings_type in SETTINGS_TYPES]
    found = [(each.name, each(cloud.points).outliers) for each in methods]
    circle = method(default_settings(CircleSettings), '')
    found.insert(1, (f'{circle.name}, z scaled', circle(with_z_scaled(cloud.points)).outliers))
    return found


def _row(cloud: MeasuredCloud, name: str, outliers: Mask) -> list[Cell]:
    z = cloud.points[..., 2]
    before, after = texture(cloud.points), texture(cloud.points, ~outliers)
    measured, removed = int(np.isfinite(z).sum()), int(np.count_nonzero(outliers))
    changes = [after.sa / before.sa - 1, after.sq / before.sq - 1, after.sz / before.sz - 1]
    return [cloud.name, name, measured, removed, removed / measured, *changes]
