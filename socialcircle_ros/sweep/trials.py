# SPDX-License-Identifier: Apache-2.0
"""Trials of a sweep: one setting and its score over all clouds, and the file that keeps finished trials."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from hashlib import blake2b
from pathlib import Path
from types import TracebackType

import numpy as np

from socialcircle_ros.circle import remove_outliers
from socialcircle_ros.errors import CloudError, SocialCircleError
from socialcircle_ros.metrics.areal import texture
from socialcircle_ros.metrics.scores import Scores, score
from socialcircle_ros.settings import CircleSettings, FocusSettings, RosValue
from socialcircle_ros.storage import open_in_place, write_file

from .clouds import CloudSource, SweepCloud
from .search_space import ParameterValues


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
            result = remove_outliers(xyz, circle.of_a_stack(cloud.depth_of_field))
        except CloudError:
            refused += 1
            scores.append(score(np.zeros_like(cloud.outlier), cloud.outlier, cloud.counted))
            removed.append(0.0)
            continue
        scores.append(score(result.outliers, cloud.outlier, cloud.counted))
        removed.append(float(np.mean(result.outliers[result.outliers | result.inliers])))
        kept = texture(np.where(result.inliers, xyz[..., 2], np.nan))
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


def _mean(values: Sequence[float]) -> float | None:
    """The mean of the values that are known; None if there is none."""
    known = [value for value in values if not np.isnan(value)]
    return float(np.mean(known)) if known else None


def best_of(trials: Sequence[Trial]) -> Trial:
    """The trial with the highest score; of equal ones that with the fewest removed points, then the first."""
    return max(trials, key=lambda trial: (trial.score, -trial.removed))


class TrialFile:
    """Finished trials on disk, one per line, so that an interrupted sweep can continue; a context manager.

    Args:
        path: the file.
        fingerprint: fingerprint of the clouds and of the parameters that are not varied.
        restart: whether to delete the trials that the file holds.

    Attributes:
        trials: the finished trials.

    Raises:
        SocialCircleError: the file belongs to another sweep, or cannot be read or written.
    """

    def __init__(self, path: Path, fingerprint: str, *, restart: bool = False) -> None:
        self.path = path
        try:
            lines = [] if restart or not path.exists() else path.read_bytes().split(b'\n')[:-1]
            self.trials = self._parse(lines, fingerprint)
            # Writing the file anew drops a line that an interruption cut short.
            complete = [json.dumps({'sweep': fingerprint}), *(json.dumps(asdict(trial)) for trial in self.trials)]
            write_file(path, '\n'.join(complete) + '\n')
            self._file = open_in_place(path, append=True)
        except OSError as error:
            raise SocialCircleError(
                f'{path} cannot be used: {error.strerror}; choose another output folder.'
            ) from None

    def _parse(self, lines: Sequence[bytes], fingerprint: str) -> list[Trial]:
        try:
            records = [json.loads(line) for line in lines]
            found = records[0]['sweep'] if records else fingerprint
            trials = [Trial(**record) for record in records[1:]]
        except (ValueError, KeyError, TypeError, IndexError):
            raise SocialCircleError(
                f'{self.path} is not a file of trials; choose another output folder, or start over with --restart.'
            ) from None
        if found != fingerprint:
            raise SocialCircleError(
                f'{self.path} holds trials on other clouds or with other fixed parameters; choose another output'
                ' folder, or start over with --restart.'
            )
        return trials

    def add(self, trial: Trial) -> None:
        """Append one trial, and write it to the disk at once."""
        self.trials.append(trial)
        self._file.write(json.dumps(asdict(trial)).encode() + b'\n')
        self._file.flush()

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> 'TrialFile':  # noqa: PYI034 - Self is not in Python 3.10
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def fingerprint_of(clouds: Sequence[SweepCloud], fixed: Mapping[str, RosValue]) -> str:
    """Hash what two sweeps must have in common to share trials.

    Args:
        clouds: the clouds, with their outliers.
        fixed: parameters that are not varied.
    """
    digest = blake2b(json.dumps(sorted(fixed.items())).encode(), digest_size=16)
    for cloud in clouds:
        digest.update(cloud.points)
        digest.update(cloud.outlier.tobytes())
        digest.update(cloud.counted.tobytes())
    return digest.hexdigest()


def key_of(values: Mapping[str, RosValue]) -> str:
    """A hashable key of a setting, independent of the order of its parameters."""
    return json.dumps(sorted(values.items()))


def untried(wanted: Sequence[ParameterValues], done: Sequence[Trial]) -> list[ParameterValues]:
    """The settings that have no trial yet, in their order."""
    known = {key_of(trial.values) for trial in done}
    return [values for values in wanted if key_of(values) not in known]
