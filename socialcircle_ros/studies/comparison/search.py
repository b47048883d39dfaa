"""The best settings of each filter on clouds of known truth, so that none is crippled in the comparison."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from socialcircle_ros.baselines import FilterResult, median_filter, radius_filter, statistical_filter
from socialcircle_ros.baselines.settings import MedianSettings, RadiusSettings, StatisticalSettings
from socialcircle_ros.circle import remove_outliers
from socialcircle_ros.circle.seed import elect_seed
from socialcircle_ros.kernels.machine import usable_cores
from socialcircle_ros.metrics.scores import f1_at, score
from socialcircle_ros.settings import CircleSettings

from .labelled_clouds import LabelledCloud
from .methods import FilterSettings

_WINDOWS = (3, 5, 7, 9, 15)
_RADII = (1.5, 2.0, 2.5, 3.0, 4.0, 6.0, 10.0)  # pitches
_PARTS = (0.25, 0.5, 0.75, 1.0)  # of the window's places
_STD_FACTORS = np.round(np.arange(-2.0, 8.05, 0.1), 1)
_MEDIAN_WINDOWS = (5, 11, 15, 21, 31)
_THRESHOLDS = np.array([float(f'{value:.3g}') for value in np.geomspace(0.2, 40, 100)])  # pitches
_SCALES = (0.7, 0.8, 0.9, 1.0, 1.1, 1.25, 1.5, 2.0, 3.0)

SPACES: dict[type[FilterSettings], str] = {
    CircleSettings: f'window 3 or 5, radius_scale {", ".join(f"{scale:g}" for scale in _SCALES)}',
    RadiusSettings: (
        f'window {", ".join(map(str, _WINDOWS))}; radius {", ".join(f"{radius:g}" for radius in _RADII)} pitches;'
        ' min_neighbours every number that the window allows'
    ),
    StatisticalSettings: (
        f'window {", ".join(map(str, _WINDOWS))}; neighbours a quarter, a half, three quarters or all of the'
        f" window's; std_factor {_STD_FACTORS[0]:g} to {_STD_FACTORS[-1]:g} in steps of 0.1"
    ),
    MedianSettings: (
        f'window {", ".join(map(str, _MEDIAN_WINDOWS))}; threshold {len(_THRESHOLDS)} values from'
        f' {_THRESHOLDS[0]:g} to {_THRESHOLDS[-1]:g} pitches'
    ),
}
"""In words, what is tried for each filter."""


def best_settings(kind: type[FilterSettings], clouds: Sequence[LabelledCloud]) -> FilterSettings:
    """The settings with the highest F1, averaged over the clouds; the first of equals.

    Args:
        kind: of filter, by the type of its settings.
        clouds: clouds of one pitch, which must be others than those that the scores come from.
    """
    if kind is CircleSettings:
        return _best_circle(clouds)

    def tried(trial: _SearchTrial) -> tuple[float, FilterSettings]:
        f1 = np.mean([_f1(trial, cloud) for cloud in clouds], axis=0)
        best = int(np.argmax(f1))
        return float(f1[best]), trial.settings(best)

    # The filters release the GIL.
    with ThreadPoolExecutor(usable_cores()) as pool:
        found = list(pool.map(tried, _TRIALS[kind](clouds[0].pitch)))
    return max(found, key=lambda each: each[0])[1]


@dataclass(frozen=True)
class _SearchTrial:
    """Settings that differ only in the limit on the score: one run of the filter tries them all.

    Attributes:
        run: the filter, set.
        thresholds: from the filter's answer to the limits on its score, (T,).
        settings: those that give limit number i.
    """

    run: Callable[[npt.NDArray[Any]], FilterResult]
    thresholds: Callable[[npt.NDArray[Any]], npt.NDArray[Any]]
    settings: Callable[[int], FilterSettings]


def _f1(trial: _SearchTrial, cloud: LabelledCloud) -> npt.NDArray[Any]:
    values: Any = trial.run(cloud.points).score
    return f1_at(values, cloud.outlier, cloud.counted, trial.thresholds(values))


def _radius_trials(pitch: float) -> Iterator[_SearchTrial]:
    for window in _WINDOWS:
        places = window**2 - 1
        for radius in _RADII:
            base = RadiusSettings(window=window, radius=radius * pitch, min_neighbours=1)
            counts = np.arange(1, places + 1)
            yield _SearchTrial(
                run=partial(radius_filter, settings=base),
                thresholds=partial(_constant, places - counts),
                settings=partial(_with, base, 'min_neighbours', counts),
            )


def _statistical_trials(pitch: float) -> Iterator[_SearchTrial]:
    del pitch  # it counts in standard deviations of the cloud
    for window in _WINDOWS:
        for part in _PARTS:
            base = StatisticalSettings(window=window, neighbours=round(part * (window**2 - 1)))
            yield _SearchTrial(
                run=partial(statistical_filter, settings=base),
                thresholds=_deviations,
                settings=partial(_with, base, 'std_factor', _STD_FACTORS),
            )


def _median_trials(pitch: float) -> Iterator[_SearchTrial]:
    for window in _MEDIAN_WINDOWS:
        base = MedianSettings(window=window)
        yield _SearchTrial(
            run=partial(median_filter, settings=base),
            thresholds=partial(_constant, _THRESHOLDS * pitch),
            settings=partial(_with, base, 'threshold', _THRESHOLDS * pitch),
        )


_TRIALS: dict[type[FilterSettings], Callable[[float], Iterator[_SearchTrial]]] = {
    RadiusSettings: _radius_trials,
    StatisticalSettings: _statistical_trials,
    MedianSettings: _median_trials,
}


def _constant(thresholds: npt.NDArray[Any], values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    del values
    return thresholds


def _deviations(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    finite = values[np.isfinite(values)].astype(np.float64)
    thresholds: npt.NDArray[np.float64] = finite.mean() + _STD_FACTORS * finite.std(ddof=1)
    return thresholds


def _with(base: FilterSettings, name: str, values: npt.NDArray[Any], index: int) -> FilterSettings:
    return replace(base, **{name: values[index].item()})


def _best_circle(clouds: Sequence[LabelledCloud]) -> CircleSettings:
    """Our own filter is searched in the same way, although it has no score and each setting is a run."""
    # All settings have the same seed: it is elected once for each cloud, and then is its own vote region.
    seeds = [(*elect_seed(cloud.points, None), 1, 1) for cloud in clouds]

    def mean_f1(settings: CircleSettings) -> float:
        f1 = []
        for cloud, seed in zip(clouds, seeds, strict=True):
            found = remove_outliers(cloud.points, replace(settings, vote_region=seed)).outliers
            f1.append(score(found, cloud.outlier, cloud.counted).f1)
        return float(np.mean(f1))

    trials = [CircleSettings(window=window, radius_scale=scale) for window in (3, 5) for scale in _SCALES]
    with ThreadPoolExecutor(usable_cores()) as pool:
        found = list(zip(pool.map(mean_f1, trials), trials, strict=True))
    return max(found, key=lambda each: each[0])[1]
