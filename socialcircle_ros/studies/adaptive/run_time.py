# SPDX-License-Identifier: Apache-2.0
"""Run time of the adaptive mode: growth with the number of points, and the ratio to PCL's statistical filter."""

from functools import partial

import numpy as np

from socialcircle_ros.baselines import peers
from socialcircle_ros.report.content import Cell, Column, Section, Table
from socialcircle_ros.simulation import make_scene
from socialcircle_ros.studies.comparison.study import Study
from socialcircle_ros.studies.timing import repeated_ms
from socialcircle_ros.studies.workload import DETECTION, SYNTHETIC, million_points

from .detection import detect
from .goals import GOALS, Goal, goals_section

_SIZES = ((240, 320), (480, 640), (960, 1280), (1920, 2560))
_PEER_SIZE = (960, 1280)


def run_time_work(study: Study) -> float:
    """Work of `run_time`."""
    points = sum(million_points(size) for size in _sizes(study))
    return points * (DETECTION * study.plan.repeats + SYNTHETIC)


def _sizes(study: Study) -> tuple[tuple[int, int], ...]:
    return _SIZES if len(study.plan.seeds) > 1 else _SIZES[:2]


def run_time(study: Study) -> list[Section]:
    """Time the adaptive mode on clouds of several sizes; a single seed in the plan means the two smallest only."""
    sizes = _sizes(study)
    seed = study.plan.seeds[0]
    times_ms = {}
    rows: list[list[Cell]] = []
    for size in sizes:
        study.progress(f'timing {size[1]}×{size[0]}')
        points = make_scene('metal_groove', *size, seed=seed).points
        times_ms[size] = min(repeated_ms(partial(detect, points), study.plan.repeats))
        count = size[0] * size[1]
        rows.append([f'{size[1]}×{size[0]}', count, times_ms[size], 1e6 * times_ms[size] / count])
    goals = []
    smaller, larger = sizes[1], sizes[-1]
    if larger != smaller:
        ratio = larger[0] * larger[1] / (smaller[0] * smaller[1])
        exponent = float(np.log(times_ms[larger] / times_ms[smaller]) / np.log(ratio))
        goals.append(
            Goal('Exponent of the growth of time with the points', exponent, 1.15, at_least=False, form='.2f')
        )
    if _PEER_SIZE in times_ms and peers.pcl_is_installed():
        study.progress('PCL’s statistical filter')
        cloud = make_scene('metal_groove', *_PEER_SIZE, seed=seed).points
        pcl_ms = peers.pcl_statistical_filter(cloud).milliseconds
        rows.append(
            [f'{_PEER_SIZE[1]}×{_PEER_SIZE[0]}, PCL statistical', _PEER_SIZE[0] * _PEER_SIZE[1], pcl_ms, None]
        )
        goals.append(
            Goal(
                'Speed relative to PCL’s statistical filter, 1280×960',
                pcl_ms / times_ms[_PEER_SIZE],
                10,
                form='.1f',
            )
        )
    columns = [Column('cloud'), Column('points', ',d'), Column('ms', '.0f'), Column('ns per point', '.0f')]
    text = 'The shortest of several times, because other load on the machine can only add time.'
    table = Table('adaptive_times', 'Run time of the adaptive mode', columns, rows)
    return [Section('Run time', [text], items=[table]), goals_section(GOALS, goals)]
