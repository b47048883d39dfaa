"""The filters that are compared, each with its settings, under one call and one kind of answer."""

import dataclasses
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from socialcircle_ros.baselines import median_filter, peers, radius_filter, statistical_filter
from socialcircle_ros.baselines.settings import MedianSettings, RadiusSettings, StatisticalSettings
from socialcircle_ros.circle import remove_outliers
from socialcircle_ros.cloud import Mask
from socialcircle_ros.settings import CircleSettings

FilterSettings = CircleSettings | RadiusSettings | StatisticalSettings | MedianSettings

_FILTERS: dict[type[FilterSettings], tuple[str, Callable[..., Any]]] = {
    CircleSettings: ('Social circle', remove_outliers),
    RadiusSettings: ('Radius', radius_filter),
    StatisticalSettings: ('Statistical', statistical_filter),
    MedianSettings: ('Median residual', median_filter),
}
_PEERS = {'PCL': peers.pcl_is_installed, 'Open3D': peers.open3d_is_installed}
KINDS = tuple(_FILTERS)
"""The filters by the type of their settings, ours first."""


@dataclass(frozen=True)
class FilterRun:
    """What a filter found.

    Attributes:
        outliers: (H, W) bool.
        kept: number of points that it kept.
        score: (H, W) higher for a worse point; None where the filter gives none.
        milliseconds: what it took; somebody else's filter as itself or its caller measured it.
    """

    outliers: Mask
    kept: int
    score: npt.NDArray[Any] | None
    milliseconds: float


@dataclass(frozen=True)
class Method:
    """A filter that can be called, and what the tables call it."""

    name: str
    variant: str
    settings: FilterSettings
    filter: Callable[..., Any]
    is_peer: bool = False

    def __call__(self, xyz: npt.NDArray[Any]) -> FilterRun:
        """Filter a cloud (H, W, 3)."""
        began = time.perf_counter()
        result = self.filter(xyz, self.settings)
        took = 1e3 * (time.perf_counter() - began)
        return FilterRun(
            outliers=result.outliers,
            kept=int(np.count_nonzero(result.inliers)),
            score=getattr(result, 'score', None),
            milliseconds=result.milliseconds if self.is_peer else took,
        )

    @property
    def label(self) -> str:
        """Name and variant."""
        return f'{self.name}, {self.variant}'


def name_of(kind: type[FilterSettings]) -> str:
    """What the filter with these settings is called."""
    return _FILTERS[kind][0]


def method(settings: FilterSettings, variant: str) -> Method:
    """Our implementation of the filter that these settings are for."""
    name, function = _FILTERS[type(settings)]
    return Method(name, variant, settings, function)


def peers_of(methods: Sequence[Method]) -> list[Method]:
    """PCL's and Open3D's counterparts of the methods, where those are installed and have them."""
    found = []
    for own in methods:
        if isinstance(own.settings, RadiusSettings):
            functions: dict[str, Callable[..., Any]] = {
                'PCL': peers.pcl_radius_filter,
                'Open3D': peers.open3d_radius_filter,
            }
        elif isinstance(own.settings, StatisticalSettings):
            functions = {'PCL': peers.pcl_statistical_filter, 'Open3D': peers.open3d_statistical_filter}
        else:
            continue
        for owner, function in functions.items():
            if _PEERS[owner]():
                found.append(Method(f'{owner} {own.name.lower()}', own.variant, own.settings, function, True))
    return found


def peers_in_words() -> str:
    """Which of PCL and Open3D stand in the tables, and which could not."""
    words = {True: 'runs beside ours', False: 'is not installed here, and so left out'}
    return '; '.join(f'{owner} {words[is_installed()]}' for owner, is_installed in _PEERS.items()) + '.'


def in_words(settings: FilterSettings) -> str:
    """The values of the settings that decide, as `name value`; what the filter finds itself is left out."""
    words = []
    for field in dataclasses.fields(settings):
        value = getattr(settings, field.name)
        replaced = field.name == 'sigmas' and getattr(settings, 'threshold', None) is not None
        if value is None or isinstance(value, str) or replaced:
            continue
        words.append(f'{field.name} {value:.3g}')
    return ', '.join(words)


LONG = 2000.0
"""A filter that has run for so many ms in all is not timed again."""


def median_times(methods: Sequence[Method], xyz: npt.NDArray[Any], repeats: int) -> dict[Method, float]:
    """Median time of each in ms, after one call that is not counted.

    They take turns, so that all meet the same moods of the machine.
    """
    for each in methods:
        each(xyz)
    times: dict[Method, list[float]] = {each: [] for each in methods}
    for _ in range(repeats):
        for each in methods:
            if sum(times[each]) < LONG:
                times[each].append(each(xyz).milliseconds)
    return {each: statistics.median(taken) for each, taken in times.items()}
