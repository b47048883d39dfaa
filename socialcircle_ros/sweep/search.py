# SPDX-License-Identifier: Apache-2.0
"""Choosing the next settings of a sweep with Optuna (extra `tuning`)."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from socialcircle_ros.settings import RosValue

from .journal import import_optuna
from .search_space import Choice, ParameterValues, Range, SearchDimension, check_search_space, contains
from .trials import Trial, key_of

if TYPE_CHECKING:
    from optuna.distributions import BaseDistribution
    from optuna.storages import BaseStorage
    from optuna.trial import Trial as OptunaTrial

_RANDOM_SHARE = 5  # one of five settings, and at least 8, are random before the estimator takes over
_MAX_ASKED = 20  # per setting that is wanted, because Optuna may propose the same setting again


class Search:
    """Proposes settings from the scores so far, by a tree-structured Parzen estimator.

    Iterate over it for new settings, and `tell` it the trial of each. It ends after `count` settings, or when
    the estimator proposes nothing new.

    Args:
        search_space: the parameters that are varied.
        count: number of different settings, including those of `done`.
        done: earlier trials; those outside the search space are ignored.
        storage: of Optuna, where other processes search as well; None: this search is alone.
        name: of the search in the storage; the search space is added.

    Raises:
        SettingError: the search space is empty, or has a parameter twice.
        SocialCircleError: Optuna is not installed.

    Reference:
        J. Bergstra, R. Bardenet, Y. Bengio, B. Kégl: Algorithms for hyper-parameter optimization. Advances in
        Neural Information Processing Systems 24 (2011).
    """

    def __init__(
        self,
        search_space: Sequence[SearchDimension],
        count: int,
        done: Sequence[Trial],
        storage: 'BaseStorage | None' = None,
        name: str = '',
    ) -> None:
        check_search_space(search_space)
        optuna = import_optuna()
        self._optuna, self._search_space, self._count = optuna, search_space, count
        self._distributions = {dimension.name: self._distribution(dimension) for dimension in search_space}
        known = [trial for trial in done if contains(search_space, trial.values)]
        # A sweep that continues needs another seed; with the same one it would propose the same random settings.
        sampler = optuna.samplers.TPESampler(seed=len(known), n_startup_trials=max(8, count // _RANDOM_SHARE))
        self._study = optuna.create_study(
            direction='maximize',
            sampler=sampler,
            storage=storage,
            study_name=f'{name} {search_space}',
            load_if_exists=True,
        )
        self._scores: dict[str, float] = {}
        self._look_around()
        for trial in known:
            if key_of(trial.values) not in self._scores:
                self._study.add_trial(
                    optuna.trial.create_trial(
                        params=self._to_optuna(trial.values), distributions=self._distributions, value=trial.score
                    )
                )
        self._look_around()
        self._asked: set[str] = set()  # and not told yet
        self._waiting: dict[str, list[OptunaTrial]] = {}

    def __iter__(self) -> Iterator[ParameterValues]:
        """Propose settings that were not tried yet."""
        for _ in range(_MAX_ASKED * self._count):
            self._look_around()
            if len(self._asked) + len(self._scores) >= self._count:
                return
            asked = self._study.ask(self._distributions)
            values = self._from_optuna(asked.params)
            key = key_of(values)
            if key in self._scores:
                self._study.tell(asked, self._scores[key])
                continue
            if key not in self._asked and self._is_tried_elsewhere(asked, key):
                self._study.tell(asked, state=self._optuna.trial.TrialState.FAIL)
                continue
            self._waiting.setdefault(key, []).append(asked)
            if key not in self._asked:
                self._asked.add(key)
                yield values

    def tell(self, trial: Trial) -> None:
        """Pass the score of a proposed setting to the estimator."""
        self._asked.discard(key_of(trial.values))
        self._scores[key_of(trial.values)] = trial.score
        for asked in self._waiting.pop(key_of(trial.values), []):
            self._study.tell(asked, trial.score)

    def _is_tried_elsewhere(self, asked: 'OptunaTrial', key: str) -> bool:
        """Whether another process, which may have been killed, has proposed the same setting and told no score."""
        return any(
            each.number != asked.number and key_of(self._from_optuna(each.params)) == key
            for each in self._study.get_trials(deepcopy=False, states=[self._optuna.trial.TrialState.RUNNING])
            if len(each.params) == len(self._search_space)
        )

    def _look_around(self) -> None:
        """Learn what other processes have found."""
        for each in self._study.get_trials(deepcopy=False):
            if each.value is not None:
                self._scores.setdefault(key_of(self._from_optuna(each.params)), each.value)

    def _distribution(self, dimension: SearchDimension) -> 'BaseDistribution':
        distributions = self._optuna.distributions
        if isinstance(dimension, Choice):
            # Values that are numbers are given by their index, so that the estimator knows which ones are close.
            if len(dimension.values) > 2 and all(isinstance(value, (int, float)) for value in dimension.values):
                return distributions.IntDistribution(0, len(dimension.values) - 1)
            return distributions.CategoricalDistribution(range(len(dimension.values)))
        if dimension.is_whole:
            return distributions.IntDistribution(int(dimension.low), int(dimension.high))
        return distributions.FloatDistribution(dimension.low, dimension.high)

    def _to_optuna(self, values: Mapping[str, RosValue]) -> dict[str, RosValue]:
        return {
            dimension.name: values[dimension.name]
            if isinstance(dimension, Range)
            else list(dimension.values).index(values[dimension.name])
            for dimension in self._search_space
        }

    def _from_optuna(self, params: Mapping[str, int | float]) -> ParameterValues:
        return {
            dimension.name: _rounded(dimension, params[dimension.name])
            if isinstance(dimension, Range)
            else dimension.values[int(params[dimension.name])]
            for dimension in self._search_space
        }


def _rounded(dimension: Range, value: float) -> RosValue:
    """A value of a range, with four significant digits: more have no effect on the score."""
    return int(value) if dimension.is_whole else min(max(float(f'{value:.4g}'), dimension.low), dimension.high)
