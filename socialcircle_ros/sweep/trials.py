"""Trying settings on the same clouds: against their truth, or where there is none against a stated criterion."""

import json
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from hashlib import blake2b
from pathlib import Path
from typing import Any, TextIO, TypeVar

import numpy as np

from socialcircle_ros.baselines import median_filter
from socialcircle_ros.baselines.settings import MedianSettings
from socialcircle_ros.circle import remove_outliers
from socialcircle_ros.cloud import Mask, measured_points
from socialcircle_ros.errors import CloudError, SocialCircleError
from socialcircle_ros.messages.point_cloud import PointCloud
from socialcircle_ros.metrics.areal import texture
from socialcircle_ros.metrics.scores import Tally, tally
from socialcircle_ros.settings import CircleSettings, FocusSettings, RosValue

from .search_space import Choice, Range, SearchDimension, Values, contains

Item = TypeVar('Item')

CRITERION = (
    'A point stands out if its height is further than {sigmas:g} robust standard deviations (1.4826 times the'
    ' median of all such distances) from the median of the {window}×{window} points round it.'
).format(**asdict(MedianSettings()))
"""In words, what stands in for the truth where a recording knows none."""


@dataclass(frozen=True, eq=False)
class SweepCloud:
    """One cloud of a sweep.

    Attributes:
        name: such as `/points 3`.
        points: the serialized PointCloud2.
        outlier: (H, W) what is to be removed: the truth, or what stands out.
        counted: (H, W) the points whose truth is certain.
        known: whether it is the truth.
        depth_of_field: of a cloud that was a stack, in the unit of the cloud.
    """

    name: str
    points: bytes
    outlier: Mask
    counted: Mask
    known: bool
    depth_of_field: float | None = None

    @property
    def xyz(self) -> Any:
        """The coordinates, (H, W, 3)."""
        return PointCloud.decode(self.points).xyz()


def sweep_cloud(name: str, points: bytes, truth: tuple[Mask, Mask] | None) -> SweepCloud:
    """A cloud with its truth, or with what stands out in it.

    Raises:
        MessageError: it is not an organized cloud.
    """
    if truth is not None:
        return SweepCloud(name, points, *truth, known=True)
    xyz = PointCloud.decode(points).xyz()
    return SweepCloud(name, points, median_filter(xyz).outliers, measured_points(xyz), known=False)


def evenly(items: Iterable[Item], most: int) -> list[Item]:
    """At most so many of the items, evenly spread over them; at most twice as many are in memory at a time."""
    kept: list[Item] = []
    stride = 1
    for number, item in enumerate(items):
        if number % stride == 0:
            kept.append(item)
        if len(kept) > 2 * most:
            kept, stride = kept[::2], 2 * stride
    return [kept[place * len(kept) // most] for place in range(most)] if len(kept) > most else kept


CloudSource = Callable[[FocusSettings], Sequence[SweepCloud]]
"""The clouds of a recording, as these settings measure its stacks."""


def remembered(load: CloudSource) -> CloudSource:
    """The same clouds for the same settings; those of the last two settings stay in memory."""
    lock = threading.Lock()
    kept: dict[FocusSettings, Sequence[SweepCloud]] = {}

    def cases(focus: FocusSettings) -> Sequence[SweepCloud]:
        with lock:
            if focus not in kept:
                while len(kept) > 1:
                    del kept[next(iter(kept))]
                kept[focus] = load(focus)
            return kept[focus]

    return cases


@dataclass(frozen=True)
class Trial:
    """One setting and what it gave on all clouds together.

    Attributes:
        values: of the parameters that are varied.
        score: F1 of what was removed against what was to be removed; what is best has the highest.
        precision: of the points removed, how many were to be; None: nothing was removed.
        recall: of the points to be removed, how many were; None: there were none.
        removed: share of the measured points that was removed.
        sq: mean root mean square height of what was kept, in the unit of the clouds.
        sz: mean maximum height of what was kept.
        milliseconds: mean time of the filter for a cloud, several at once.
        refused: clouds for which the filter has no answer; they count as clouds of which nothing was removed.
    """

    values: Values
    score: float
    precision: float | None
    recall: float | None
    removed: float
    sq: float | None
    sz: float | None
    milliseconds: float | None
    refused: int


def attempt(base: Values, values: Values, cases: CloudSource) -> Trial:
    """Filter all clouds with one setting.

    Args:
        base: parameters that are not varied.
        values: those that are.
        cases: the clouds.

    Raises:
        SettingError: the values do not go together.
    """
    both = base | values
    circle, counts = CircleSettings.from_ros(both), Tally()
    removed = measured = refused = 0
    sq, sz, seconds = [], [], []
    for case in cases(FocusSettings.from_ros(both)):
        xyz = case.xyz
        try:
            result = remove_outliers(xyz, circle.of_a_stack(case.depth_of_field))
        except CloudError:
            refused += 1
            counts += tally(np.zeros_like(case.outlier), case.outlier, case.counted)
            measured += int(np.count_nonzero(measured_points(xyz)))
            continue
        counts += tally(result.outliers, case.outlier, case.counted)
        removed += int(np.count_nonzero(result.outliers))
        measured += int(np.count_nonzero(result.outliers | result.inliers))
        rest = texture(np.where(result.inliers, xyz[..., 2], np.nan))
        sq.append(rest.sq)
        sz.append(rest.sz)
        seconds.append(sum(result.times.values()))
    scores = counts.scores
    return Trial(
        values=values,
        score=1.0 if np.isnan(scores.f1) else scores.f1,  # nothing was to be removed, and nothing was
        precision=_number(scores.precision),
        recall=_number(scores.recall),
        removed=removed / measured if measured else 0.0,
        sq=_number(np.mean(sq)) if sq else None,
        sz=_number(np.mean(sz)) if sz else None,
        milliseconds=1e3 * float(np.mean(seconds)) if seconds else None,
        refused=refused,
    )


def _number(value: Any) -> float | None:
    return None if np.isnan(value) else float(value)


def best_of(trials: Sequence[Trial]) -> Trial:
    """The trial with the highest score; of equals the one that removes least, of these the first."""
    return max(trials, key=lambda trial: (trial.score, -trial.removed))


class TrialFile:
    """Finished trials on disk, one a line, so that a run that was interrupted goes on where it stopped.

    Args:
        path: of the file.
        fingerprint: of the clouds and of all settings that are not varied.
        restart: whether to forget what is there.

    Raises:
        SocialCircleError: the file is of other clouds or settings, or cannot be used.
    """

    def __init__(self, path: Path, fingerprint: str, *, restart: bool = False) -> None:
        self.path = path
        try:
            lines = [] if restart or not path.exists() else path.read_bytes().split(b'\n')[:-1]
            self.trials = self._read(lines, fingerprint)
            # What an interruption cut short is written anew.
            whole = [json.dumps({'sweep': fingerprint}), *(json.dumps(asdict(trial)) for trial in self.trials)]
            path.write_text('\n'.join(whole) + '\n', encoding='utf-8')
            self._file: TextIO = path.open('a', encoding='utf-8')
        except OSError as error:
            raise SocialCircleError(
                f'{path} cannot be used: {error.strerror}; choose another folder with -o.'
            ) from None

    def _read(self, lines: Sequence[bytes], fingerprint: str) -> list[Trial]:
        try:
            records = [json.loads(line) for line in lines]
            of = records[0]['sweep'] if records else fingerprint
            trials = [Trial(**record) for record in records[1:]]
        except (ValueError, KeyError, TypeError, IndexError):
            raise SocialCircleError(
                f'{self.path} is not a file of trials; choose another folder with -o, or begin anew with'
                ' --restart.'
            ) from None
        if of != fingerprint:
            raise SocialCircleError(
                f'{self.path} holds trials on other clouds or with other fixed parameters; choose another'
                ' folder with -o, or begin anew with --restart.'
            )
        return trials

    def add(self, trial: Trial) -> None:
        """Write one more, at once."""
        self.trials.append(trial)
        self._file.write(json.dumps(asdict(trial)) + '\n')
        self._file.flush()

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def fingerprint_of(cases: Sequence[SweepCloud], fixed: Mapping[str, RosValue]) -> str:
    """What two runs have in common that may share their trials."""
    digest = blake2b(json.dumps(sorted(fixed.items())).encode(), digest_size=16)
    for case in cases:
        digest.update(case.points)
        digest.update(case.outlier.tobytes())
        digest.update(case.counted.tobytes())
    return digest.hexdigest()


class Search:
    """Settings to try next, by Optuna's tree-structured Parzen estimator, from what was tried so far.

    Args:
        search_space: what is varied.
        count: how many different settings are wanted, those already tried included.
        done: what was tried.

    Raises:
        SocialCircleError: Optuna is not installed.
    """

    def __init__(self, search_space: Sequence[SearchDimension], count: int, done: Sequence[Trial]) -> None:
        try:
            import optuna  # noqa: PLC0415 - an extra
        except ImportError:
            raise SocialCircleError(
                'A search needs Optuna: pip install "socialcircle_ros[tuning]"; a grid (without --search)'
                ' does not.'
            ) from None
        optuna.logging.set_verbosity(optuna.logging.WARNING)
        self._optuna, self._search_space, self._count = optuna, search_space, count
        self._spaces = {each.name: self._space(each) for each in search_space}
        known = [trial for trial in done if contains(search_space, trial.values)]
        # Another seed for a run that goes on, which would begin with the same random settings otherwise.
        sampler = optuna.samplers.TPESampler(seed=len(known), n_startup_trials=max(8, count // 5))
        self._study = optuna.create_study(direction='maximize', sampler=sampler)
        for trial in known:
            self._study.add_trial(
                optuna.trial.create_trial(
                    params=self._to_optuna(trial.values), distributions=self._spaces, value=trial.score
                )
            )
        self._scores: dict[str, float] = {_key(trial.values): trial.score for trial in known}
        self._asked: set[str] = set(self._scores)
        self._waiting: dict[str, list[Any]] = {}

    def __iter__(self) -> Iterator[Values]:
        """New settings, until enough are found, or until the search knows nothing new."""
        for _ in range(20 * self._count):
            if len(self._asked) >= self._count:
                return
            asked = self._study.ask(self._spaces)
            values = self._from_optuna(asked.params)
            key = _key(values)
            if key in self._scores:
                self._study.tell(asked, self._scores[key])
                continue
            self._waiting.setdefault(key, []).append(asked)
            if key not in self._asked:
                self._asked.add(key)
                yield values

    def tell(self, trial: Trial) -> None:
        """Learn what came of a setting."""
        self._scores[_key(trial.values)] = trial.score
        for asked in self._waiting.pop(_key(trial.values), []):
            self._study.tell(asked, trial.score)

    def _space(self, each: SearchDimension) -> Any:
        kinds = self._optuna.distributions
        if isinstance(each, Choice):
            # By their numbers where they are numbers in order, so that near values are known to be alike.
            if len(each.values) > 2 and all(isinstance(value, (int, float)) for value in each.values):
                return kinds.IntDistribution(0, len(each.values) - 1)
            return kinds.CategoricalDistribution(range(len(each.values)))
        if each.whole:
            return kinds.IntDistribution(int(each.low), int(each.high))
        return kinds.FloatDistribution(each.low, each.high)

    def _to_optuna(self, values: Values) -> dict[str, Any]:
        return {
            each.name: values[each.name] if isinstance(each, Range) else each.values.index(values[each.name])
            for each in self._search_space
        }

    def _from_optuna(self, params: Mapping[str, Any]) -> Values:
        return {
            each.name: _within(each, params[each.name])
            if isinstance(each, Range)
            else each.values[params[each.name]]
            for each in self._search_space
        }


def _within(each: Range, value: float) -> RosValue:
    """A value of a range with four digits: nobody sets more."""
    return int(value) if each.whole else min(max(float(f'{value:.4g}'), each.low), each.high)


def _key(values: Mapping[str, RosValue]) -> str:
    return json.dumps(sorted(values.items()))


def untried(wanted: Sequence[Values], done: Sequence[Trial]) -> list[Values]:
    """The settings that were not tried yet, in their order."""
    known = {_key(trial.values) for trial in done}
    return [values for values in wanted if _key(values) not in known]
