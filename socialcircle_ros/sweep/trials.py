# SPDX-License-Identifier: Apache-2.0
"""Trials of a sweep: one setting and its score over all clouds."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from hashlib import blake2b

import numpy as np

from socialcircle_ros.circle import remove_outliers
from socialcircle_ros.cloud import Cloud
from socialcircle_ros.errors import CloudError
from socialcircle_ros.metrics.areal import texture
from socialcircle_ros.metrics.scores import Scores, score
from socialcircle_ros.settings import CircleSettings, FocusSettings, RosValue
from socialcircle_ros.settings.lessons import read_lesson

from .clouds import CloudSource, SweepCloud
from .search_space import ParameterValues

_loaded: set[tuple[str, str, int, str]] = set()
"""Kinds of filters that this process has loaded or compiled the kernels of: that takes up to seconds, once."""


@dataclass(frozen=True)
class Trial:
    """One setting, and its results: means over the clouds, which weigh alike.

    Attributes:
        values: the varied parameters.
        score: mean of `cloud_scores`.
        precision: share of the removed points that should be removed; None where nothing was removed.
        recall: share of the points that should be removed that were removed; None where there are none.
        removed: share of the measured points that was removed.
        sq: root mean square height of the kept points, in the unit of the clouds.
        sz: maximum height of the kept points, in the unit of the clouds.
        milliseconds: duration of the filter, in ms, with several clouds filtered at once.
        refused: number of clouds that the filter refused; they count as clouds without a removed point.
        cloud_scores: F1 of the removed points against the points that should be removed, for each cloud.
    """

    values: ParameterValues
    score: float
    precision: float | None
    recall: float | None
    removed: float
    sq: float | None
    sz: float | None
    milliseconds: float | None
    refused: int
    cloud_scores: Sequence[float]

    @property
    def standard_error(self) -> float:
        """Standard error of the mean score between the clouds; 0 for a single one."""
        count = len(self.cloud_scores)
        return float(np.std(self.cloud_scores, ddof=1) / np.sqrt(count)) if count > 1 else 0.0


def run_trial(base: Mapping[str, RosValue], values: Mapping[str, RosValue], clouds: CloudSource) -> Trial:
    """Filter all clouds with one setting.

    Args:
        base: parameters that are not varied, by their full names.
        values: parameters that are varied; they override `base`.
        clouds: gives the clouds.

    Raises:
        SettingError: the values contradict each other.
    """
    parameters = {**base, **values}
    circle = CircleSettings.from_ros(parameters)
    scores: list[Scores] = []
    removed, sq, sz, times_ms = [], [], [], []
    refused = 0
    for cloud in clouds(FocusSettings.from_ros(parameters)):
        xyz = cloud.xyz
        try:
            of_cloud = circle.of_a_stack(cloud.depth_of_field)
            _load_kernels(xyz, of_cloud)
            result = remove_outliers(xyz, of_cloud)
        except CloudError:
            refused += 1
            scores.append(score(np.zeros_like(cloud.outlier), cloud.outlier, cloud.counted))
            removed.append(0.0)
            continue
        scores.append(score(result.outliers, cloud.outlier, cloud.counted))
        removed.append(float(np.mean(result.outliers[result.outliers | result.inliers])))
        kept = texture(xyz, result.inliers)
        sq.append(kept.sq)
        sz.append(kept.sz)
        times_ms.append(sum(result.times_ms.values()))
    # NaN: no point should be removed, and none was.
    cloud_scores = [1.0 if np.isnan(each.f1) else each.f1 for each in scores]
    return Trial(
        values=dict(values),
        score=float(np.mean(cloud_scores)),
        precision=_mean([each.precision for each in scores]),
        recall=_mean([each.recall for each in scores]),
        removed=float(np.mean(removed)),
        sq=_mean(sq),
        sz=_mean(sz),
        milliseconds=_mean(times_ms),
        refused=refused,
        cloud_scores=cloud_scores,
    )


def _load_kernels(xyz: Cloud, circle: CircleSettings) -> None:
    """Filter a cloud once, before the filter is timed, if its kernels may not have been loaded by this process."""
    kind = circle.mode, circle.finds_by, circle.window, xyz.dtype.str
    if kind not in _loaded:
        remove_outliers(xyz, circle)
        _loaded.add(kind)


def _mean(values: Sequence[float]) -> float | None:
    """The mean of the values that are known; None if there is none."""
    known = [value for value in values if not np.isnan(value)]
    return float(np.mean(known)) if known else None


def best_of(trials: Sequence[Trial]) -> Trial:
    """The trial with the highest score; of equal ones that with the fewest removed points, then the first."""
    return max(trials, key=lambda trial: (trial.score, -trial.removed))


def fingerprint_of(
    clouds: Sequence[SweepCloud], fixed: Mapping[str, RosValue], lessons: Sequence[str] = ()
) -> str:
    """Hash what two sweeps must have in common to share trials.

    Args:
        clouds: the clouds, with their outliers.
        fixed: parameters that are not varied.
        lessons: the lesson files that trials use; their content counts.

    Raises:
        SettingError: a lesson cannot be read.
    """
    digest = blake2b(json.dumps(sorted(fixed.items())).encode(), digest_size=16)
    for path in lessons:
        digest.update(read_lesson(path).digest.encode())
    for cloud in clouds:
        digest.update(cloud.points)
        digest.update(cloud.outlier.tobytes())
        digest.update(cloud.counted.tobytes())
    return digest.hexdigest()


def key_of(values: Mapping[str, RosValue]) -> str:
    """A hashable key of a setting, independent of the order of its parameters."""
    return json.dumps(sorted(values.items()))
