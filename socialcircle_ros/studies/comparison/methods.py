# SPDX-License-Identifier: Apache-2.0
"""The compared filters, each with fixed settings behind one call.

The methods are this package's filters. Peers are the counterparts of other libraries (PCL, Open3D), where they are
installed.
"""

import dataclasses
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from socialcircle_ros.baselines import FilterResult, median_filter, peers, radius_filter, statistical_filter
from socialcircle_ros.baselines.result import Score
from socialcircle_ros.baselines.settings import MedianSettings, RadiusSettings, StatisticalSettings
from socialcircle_ros.circle import CircleResult, remove_outliers
from socialcircle_ros.cloud import Cloud, Mask
from socialcircle_ros.settings import CircleSettings

FilterSettings = CircleSettings | RadiusSettings | StatisticalSettings | MedianSettings

_NAMES: dict[type[FilterSettings], str] = {
    CircleSettings: 'Social circle',
    RadiusSettings: 'Radius',
    StatisticalSettings: 'Statistical',
    MedianSettings: 'Median residual',
}
SETTINGS_TYPES = tuple(_NAMES)
"""The compared filters, by the type of their settings; the social circle first."""

_PEERS = {'PCL': peers.pcl_is_installed, 'Open3D': peers.open3d_is_installed}

_TIME_BUDGET_MS = 2000.0
"""A method is not timed again when its runs have taken this long in total."""


@dataclass(frozen=True, eq=False)
class FilterRun:
    """The result of one run of a method.

    Attributes:
        outliers: (H, W) bool.
        kept: number of kept points.
        score: (H, W), higher for a more likely outlier; None where the filter gives no score.
        time_ms: wall time; for a peer, the time that the peer itself reports.
    """

    outliers: Mask
    kept: int
    score: Score | None
    time_ms: float


@dataclass(frozen=True)
class Method:
    """A filter with settings.

    Attributes:
        name: of the filter.
        variant: of the settings, such as 'default' or 'best'.
        settings: the settings in force.
        run: filters a cloud (H, W, 3) with these settings.
        is_peer: whether it is another library's filter.
    """

    name: str
    variant: str
    settings: FilterSettings
    run: Callable[[Cloud], FilterResult | CircleResult]
    is_peer: bool = False

    def __call__(self, xyz: Cloud) -> FilterRun:
        """Filter a cloud (H, W, 3), and time it."""
        began = time.perf_counter()
        result = self.run(xyz)
        elapsed_ms = 1e3 * (time.perf_counter() - began)
        return FilterRun(
            outliers=result.outliers,
            kept=int(np.count_nonzero(result.inliers)),
            score=result.score,
            time_ms=result.milliseconds if isinstance(result, peers.PeerResult) else elapsed_ms,
        )

    @property
    def label(self) -> str:
        """Name and variant."""
        return f'{self.name}, {self.variant}'


def name_of(settings_type: type[FilterSettings]) -> str:
    """The name of the filter that has settings of this type."""
    return _NAMES[settings_type]


def default_settings(settings_type: type[FilterSettings]) -> FilterSettings:
    """A filter's settings by default; those of the social circle are of the paper's method."""
    return CircleSettings(mode='paper') if settings_type is CircleSettings else settings_type()


def method(settings: FilterSettings, variant: str) -> Method:
    """This package's filter with the given settings."""
    return Method(_NAMES[type(settings)], variant, settings, _filter_with(settings))


def _filter_with(settings: FilterSettings) -> Callable[[Cloud], FilterResult | CircleResult]:
    if isinstance(settings, CircleSettings):
        return partial(remove_outliers, settings=settings)
    if isinstance(settings, RadiusSettings):
        return partial(radius_filter, settings=settings)
    if isinstance(settings, StatisticalSettings):
        return partial(statistical_filter, settings=settings)
    return partial(median_filter, settings=settings)


def peers_of(methods: Sequence[Method]) -> list[Method]:
    """The counterparts of the methods in PCL and Open3D, with the same settings, where installed."""
    found = []
    for own in methods:
        for library, run in _peer_filters(own.settings).items():
            if _PEERS[library]():
                found.append(Method(f'{library} {own.name.lower()}', own.variant, own.settings, run, is_peer=True))
    return found


def _peer_filters(settings: FilterSettings) -> dict[str, Callable[[Cloud], FilterResult]]:
    if isinstance(settings, RadiusSettings):
        return {
            'PCL': partial(peers.pcl_radius_filter, settings=settings),
            'Open3D': partial(peers.open3d_radius_filter, settings=settings),
        }
    if isinstance(settings, StatisticalSettings):
        return {
            'PCL': partial(peers.pcl_statistical_filter, settings=settings),
            'Open3D': partial(peers.open3d_statistical_filter, settings=settings),
        }
    return {}


def peer_availability() -> str:
    """Which peers take part, in one sentence."""
    words = {True: 'is included', False: 'is not installed and is left out'}
    return '; '.join(f'{library} {words[is_installed()]}' for library, is_installed in _PEERS.items()) + '.'


def describe(settings: FilterSettings) -> str:
    """The settings in force as `name value`, without those that the filter determines itself."""
    words = []
    for field in dataclasses.fields(settings):
        value = getattr(settings, field.name)
        is_replaced = field.name == 'sigmas' and getattr(settings, 'threshold', None) is not None
        if value is None or isinstance(value, str) or is_replaced:
            continue
        words.append(f'{field.name} {value:.3g}')
    return ', '.join(words)


def median_times_ms(methods: Sequence[Method], xyz: Cloud, repeats: int) -> dict[Method, float]:
    """Median run time of each method, after one warm-up run.

    The methods are timed in turns, so that other load on the machine affects all of them alike.
    """
    for each in methods:
        each(xyz)
    times_ms: dict[Method, list[float]] = {each: [] for each in methods}
    for _ in range(repeats):
        for each in methods:
            if sum(times_ms[each]) < _TIME_BUDGET_MS:
                times_ms[each].append(each(xyz).time_ms)
    return {each: statistics.median(taken) for each, taken in times_ms.items()}
