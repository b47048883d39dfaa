"""How long the filter takes: medians after warm-up, on clouds of several sizes."""

import statistics
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from socialcircle_ros.circle import remove_outliers
from socialcircle_ros.messages.header import Header
from socialcircle_ros.messages.point_cloud import encode_point_cloud
from socialcircle_ros.pipeline.clouds import filter_cloud
from socialcircle_ros.simulation import make_scene

SIZES = ((240, 320), (480, 640), (960, 1280), (1920, 2560))
"""Rows and columns of the clouds."""


@dataclass(frozen=True)
class Timing:
    """Median times in ms for one size of cloud."""

    rows: int
    columns: int
    vote: float
    radius_and_expansion: float
    pipeline: float
    """From a serialized message to serialized answers."""
    copy: float
    """Copying the cloud once: what any answer costs at least."""

    @property
    def points(self) -> int:
        """Points of the cloud."""
        return self.rows * self.columns

    @property
    def allowed(self) -> float:
        """What radius and expansion may take: 5 ms and 25 ns per point."""
        return 5 + 25e-6 * self.points


def time_filter(repeats: int) -> Iterator[Timing]:
    """Time the filter on a simulated metal groove of each size, one after the other.

    Args:
        repeats: how often each figure is taken after a first, uncounted time.
    """
    for rows, columns in SIZES:
        xyz = make_scene('metal_groove', rows, columns).points
        message = encode_point_cloud(Header(), xyz, {'intensity': xyz[..., 2]})
        steps = [remove_outliers(xyz).times for _ in range(repeats + 1)][1:]
        yield Timing(
            rows,
            columns,
            vote=1e3 * statistics.median(step['vote'] for step in steps),
            radius_and_expansion=1e3 * statistics.median(step['radius'] + step['expansion'] for step in steps),
            pipeline=_median(partial(filter_cloud, message), repeats),
            copy=_median(np.frombuffer(message, np.uint8).copy, repeats),
        )


def _median(call: Callable[[], object], repeats: int) -> float:
    """Median time of a call in ms, after one that is not counted."""
    call()
    times = []
    for _ in range(repeats):
        began = time.perf_counter()
        call()
        times.append(time.perf_counter() - began)
    return 1e3 * statistics.median(times)
