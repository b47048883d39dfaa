# SPDX-License-Identifier: Apache-2.0
"""Settings search: the highest mean F1 of each filter on labelled clouds, for a fair comparison."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from typing import cast

import numpy as np
import numpy.typing as npt

from socialcircle_ros.baselines import FilterResult, median_filter, radius_filter, statistical_filter
from socialcircle_ros.baselines.result import Score
from socialcircle_ros.baselines.settings import MedianSettings, RadiusSettings, StatisticalSettings
from socialcircle_ros.circle import remove_outliers
from socialcircle_ros.circle.seed import elect_seed
from socialcircle_ros.cloud import Cloud
from socialcircle_ros.kernels.machine import usable_cores
from socialcircle_ros.metrics.scores import f1_at
from socialcircle_ros.settings import CircleSettings

from .labelled_clouds import LabelledCloud
from .methods import FilterSettings

Thresholds = npt.NDArray[np.float64] | npt.NDArray[np.int64]

_WINDOWS = (3, 5, 7, 9, 15)
_RADII = (1.5, 2.0, 2.5, 3.0, 4.0, 6.0, 10.0)  # in pitches
_NEIGHBOUR_SHARES = (0.25, 0.5, 0.75, 1.0)  # of the window's neighbours
_STD_FACTORS = np.round(np.arange(-2.0, 8.05, 0.1), 1)
_MEDIAN_WINDOWS = (5, 11, 15, 21, 31)
_THRESHOLDS = np.array([float(f'{value:.3g}') for value in np.geomspace(0.2, 40, 100)])  # in pitches
_SCALES = (0.7, 0.8, 0.9, 1.0, 1.1, 1.25, 1.5, 2.0, 3.0)

SEARCH_SPACES: dict[type[FilterSettings], str] = {
    CircleSettings: f'window 3 or 5; radius_scale {", ".join(f"{scale:g}" for scale in _SCALES)}',
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
"""A description of the settings that are tried for each filter."""


def best_settings(settings_type: type[FilterSettings], clouds: Sequence[LabelledCloud]) -> FilterSettings:
    """The settings with the highest F1, averaged over the clouds; the first of equals.

    Args:
        settings_type: selects the filter.
        clouds: of equal pitch; not those that are scored.
    """
    if settings_type is CircleSettings:
        return _best_circle(clouds)

    def evaluate(trial: _SearchTrial) -> tuple[float, FilterSettings]:
        f1 = np.mean([_f1(trial, cloud) for cloud in clouds], axis=0)
        best = int(np.argmax(f1))
        return float(f1[best]), trial.settings(best)

    # The filters release the GIL.
    with ThreadPoolExecutor(usable_cores()) as pool:
        evaluated = list(pool.map(evaluate, _TRIALS[settings_type](clouds[0].pitch)))
    return max(evaluated, key=lambda each: each[0])[1]


@dataclass(frozen=True, eq=False)
class _SearchTrial:
    """Settings that differ only in the threshold on the score: one run of the filter evaluates all of them.

    Attributes:
        run: filters a cloud.
        thresholds: (T,), computed from the score of the run.
        settings: the settings that correspond to threshold number i.
    """

    run: Callable[[Cloud], FilterResult]
    thresholds: Callable[[Score], Thresholds]
    settings: Callable[[int], FilterSettings]


def _f1(trial: _SearchTrial, cloud: LabelledCloud) -> npt.NDArray[np.float64]:
    score = cast('Score', trial.run(cloud.points).score)  # only peers give no score
    return f1_at(score, cloud.outlier, cloud.counted, trial.thresholds(score))


def _radius_trials(pitch: float) -> Iterator[_SearchTrial]:
    for window in _WINDOWS:
        neighbours = window**2 - 1
        for radius in _RADII:
            base = RadiusSettings(window=window, radius=radius * pitch, min_neighbours=1)
            counts = np.arange(1, neighbours + 1)
            yield _SearchTrial(
                run=partial(radius_filter, settings=base),
                thresholds=partial(_constant, neighbours - counts),
                settings=partial(_with, base, 'min_neighbours', counts),
            )


def _statistical_trials(pitch: float) -> Iterator[_SearchTrial]:
    del pitch  # the filter measures in standard deviations of the cloud
    for window in _WINDOWS:
        for share in _NEIGHBOUR_SHARES:
            base = StatisticalSettings(window=window, neighbours=round(share * (window**2 - 1)))
            yield _SearchTrial(
                run=partial(statistical_filter, settings=base),
                thresholds=_statistical_thresholds,
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


def _constant(thresholds: Thresholds, score: Score) -> Thresholds:
    del score
    return thresholds


def _statistical_thresholds(score: Score) -> Thresholds:
    finite = score[np.isfinite(score)].astype(np.float64)
    thresholds: npt.NDArray[np.float64] = finite.mean() + _STD_FACTORS * finite.std(ddof=1)
    return thresholds


def _with(base: FilterSettings, name: str, values: Thresholds, index: int) -> FilterSettings:
    return replace(base, **{name: values[index].item()})


def _best_circle(clouds: Sequence[LabelledCloud]) -> CircleSettings:
    """Search the social circle's settings: it gives no score, so each combination is one run."""
    # The seed does not depend on these settings: it is elected once, and a vote region of one point keeps it.
    seeds = [(*elect_seed(cloud.points, None), 1, 1) for cloud in clouds]

    def mean_f1(settings: CircleSettings) -> float:
        f1 = []
        for cloud, seed in zip(clouds, seeds, strict=True):
            found = remove_outliers(cloud.points, replace(settings, vote_region=seed)).outliers
            f1.append(cloud.score(found).f1)
        return float(np.mean(f1))

    base = CircleSettings(mode='paper')
    trials = [replace(base, window=window, radius_scale=scale) for window in (3, 5) for scale in _SCALES]
    with ThreadPoolExecutor(usable_cores()) as pool:
        evaluated = list(zip(pool.map(mean_f1, trials), trials, strict=True))
    return max(evaluated, key=lambda each: each[0])[1]
