# SPDX-License-Identifier: Apache-2.0
"""Choosing the next settings of a sweep with Optuna (extra `tuning`)."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from socialcircle_ros.errors import SocialCircleError, install_command
from socialcircle_ros.settings import RosValue

from .search_space import Choice, ParameterValues, Range, SearchDimension, check_search_space, contains
from .trials import Trial, key_of

if TYPE_CHECKING:
    from optuna.distributions import BaseDistribution
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

    Raises:
        SettingError: the search space is empty, or has a parameter twice.
        SocialCircleError: Optuna is not installed.

    Reference:
        J. Bergstra, R. Bardenet, Y. Bengio, B. Kégl: Algorithms for hyper-parameter optimization. Advances in
        Neural Information Processing Systems 24 (2011).
    """

    def __init__(self, search_space: Sequence[SearchDimension], count: int, done: Sequence[Trial]) -> None:
        check_search_space(search_space)
        try:
            import optuna  # noqa: PLC0415 - an extra
        except ImportError:
            raise SocialCircleError(
                f'A search needs Optuna: {install_command("tuning")}; a grid (without --search) does not.'
            ) from None
        optuna.logging.set_verbosity(optuna.logging.WARNING)
        self._optuna, self._search_space, self._count = optuna, search_space, count
        self._distributions = {dimension.name: self._distribution(dimension) for dimension in search_space}
        known = [trial for trial in done if contains(search_space, trial.values)]
        # A sweep that continues needs another seed; with the same one it would propose the same random settings.
        sampler = optuna.samplers.TPESampler(seed=len(known), n_startup_trials=max(8, count // _RANDOM_SHARE))
        self._study = optuna.create_study(direction='maximize', sampler=sampler)
        for trial in known:
            self._study.add_trial(
                optuna.trial.create_trial(
                    params=self._to_optuna(trial.values), distributions=self._distributions, value=trial.score
                )
            )
        self._scores: dict[str, float] = {key_of(trial.values): trial.score for trial in known}
        self._asked: set[str] = set(self._scores)
        self._waiting: dict[str, list[OptunaTrial]] = {}

    def __iter__(self) -> Iterator[ParameterValues]:
        """Propose settings that were not tried yet."""
        for _ in range(_MAX_ASKED * self._count):
            if len(self._asked) >= self._count:
                return
            asked = self._study.ask(self._distributions)
            values = self._from_optuna(asked.params)
            key = key_of(values)
            if key in self._scores:
                self._study.tell(asked, self._scores[key])
                continue
            self._waiting.setdefault(key, []).append(asked)
            if key not in self._asked:
                self._asked.add(key)
                yield values

    def tell(self, trial: Trial) -> None:
        """Pass the score of a proposed setting to the estimator."""
        self._scores[key_of(trial.values)] = trial.score
        for asked in self._waiting.pop(key_of(trial.values), []):
            self._study.tell(asked, trial.score)

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
