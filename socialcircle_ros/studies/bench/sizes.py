# SPDX-License-Identifier: Apache-2.0
"""Times of the filter's steps on clouds of several sizes."""

import statistics
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from socialcircle_ros.circle import remove_outliers
from socialcircle_ros.cloud import Cloud
from socialcircle_ros.messages.header import Header
from socialcircle_ros.messages.point_cloud import encode_point_cloud
from socialcircle_ros.pipeline.clouds import filter_cloud
from socialcircle_ros.settings import CircleSettings, PipelineSettings
from socialcircle_ros.simulation import make_scene
from socialcircle_ros.studies.timing import repeated_ms

SIZES = ((240, 320), (480, 640), (960, 1280), (1920, 2560))
"""Rows and columns of the clouds."""


@dataclass(frozen=True)
class SizeTimes:
    """Median times for one size of cloud.

    Attributes:
        rows: of the cloud.
        columns: of the cloud.
        vote_ms: choice of the region and vote.
        circle_ms: radius and expansion.
        pipeline_ms: from a serialized message to serialized outputs.
        copy_ms: copying the cloud once, a lower bound of any output.
    """

    rows: int
    columns: int
    vote_ms: float
    circle_ms: float
    pipeline_ms: float
    copy_ms: float

    @property
    def points(self) -> int:
        """Points of the cloud."""
        return self.rows * self.columns

    @property
    def bound_ms(self) -> float:
        """Upper bound for radius and expansion: 5 ms and 25 ns per point."""
        return 5 + 25e-6 * self.points


def time_sizes(repeats: int) -> Iterator[SizeTimes]:
    """Time the exact mode on a simulated metal groove of each size.

    Args:
        repeats: timed runs of each step, after one warm-up run.
    """
    settings = PipelineSettings(circle=CircleSettings(mode='paper'))
    for rows, columns in SIZES:
        xyz = make_scene('metal_groove', rows, columns).points
        message = encode_point_cloud(Header(), xyz, {'intensity': xyz[..., 2]})
        vote_ms, circle_ms = vote_and_circle_ms(xyz, repeats)
        yield SizeTimes(
            rows,
            columns,
            vote_ms,
            circle_ms,
            pipeline_ms=statistics.median(repeated_ms(partial(filter_cloud, message, settings), repeats)),
            copy_ms=statistics.median(repeated_ms(np.frombuffer(message, np.uint8).copy, repeats)),
        )


def vote_and_circle_ms(xyz: Cloud, repeats: int) -> tuple[float, float]:
    """Median times of the exact mode: of the choice of the region and the vote; of the radius and the expansion.

    Args:
        xyz: (H, W, 3).
        repeats: timed runs, after one warm-up run.
    """
    circle = CircleSettings(mode='paper')
    steps = [remove_outliers(xyz, circle).times_ms for _ in range(repeats + 1)][1:]
    vote_ms = statistics.median(step['vote'] for step in steps)
    return vote_ms, statistics.median(step['radius'] + step['expansion'] for step in steps)
