# SPDX-License-Identifier: Apache-2.0
"""A lesson learnt from fields: which communities to judge, and how."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from statistics import mean

import numpy as np

from socialcircle_ros.circle.adaptive import UNDECIDED, LessonJudge, Likelihood, Rules
from socialcircle_ros.settings.lessons import Lesson

from .clouds import GoodField
from .examples import TAUGHT, GoodExample, LabelledCommunities, communities_in, joined, untouched, with_outliers
from .fit import fit

_LEVELS = (UNDECIDED, 0.35, 0.5, 0.7)
"""Probabilities above which points form the communities that a lesson judges. At the lowest, most outliers are
found, but beside a step they melt into a community with points of the step, kept or removed as a whole."""
_THRESHOLDS = (0.5, 0.7, 0.85, 0.95)
"""Of what the rules find, the first is not used: it removes up to four times as much of other fields."""
_REMOVED = 0.0003
"""Share of the untouched points that a lesson may remove where it was taught: the least threshold that does."""
_FIRST_SEED = 1

_PerLevel = list[LabelledCommunities]


def learn(
    fields: Sequence[GoodField], names: tuple[str, ...], likelihood: Likelihood | None, done: Callable[[], None]
) -> Lesson:
    """Learn a lesson at each level, and keep the one that finds the outliers put in best.

    Args:
        fields: to teach on.
        names: of the good clouds.
        likelihood: gives the probabilities of the points; None: the rules find the communities.
        done: called after each field and kind of outliers.
    """
    levels = (Rules().steep,) if likelihood is None else _LEVELS
    good: list[_PerLevel] = []
    spreads = []
    for place in fields:
        found, spread = communities_in(untouched(place), levels, likelihood)
        good.append(found)
        spreads.append(spread)
        done()
    taught: list[list[_PerLevel]] = []
    put_in: list[int] = []
    for kind in range(len(TAUGHT)):
        examples = [_example(place, number, kind) for number, place in enumerate(fields)]
        put_in.append(sum(int(np.count_nonzero(example.outlier)) for example in examples))
        taught.append([])
        for example in examples:
            taught[-1].append(communities_in(example, levels, likelihood)[0])
            done()
    points = sum(int(np.isfinite(place.heights).sum()) for place in fields)
    learnt = []
    for level, least in enumerate(levels):
        untaught = joined([each[level] for each in good])
        kinds = [joined([each[level] for each in kind]) for kind in taught]
        mean_, scale, weights = fit(joined([untaught, *kinds]))
        lesson = Lesson(
            taught_on=names,
            spread=(min(spreads), max(spreads)),
            judge='rules' if likelihood is None else 'network',
            least=least,
            mean=tuple(mean_.tolist()),
            scale=tuple(scale.tolist()),
            weights=tuple(weights.tolist()),
            threshold=_THRESHOLDS[0],
            check={},
        )
        lesson = replace(lesson, threshold=_threshold(lesson, untaught, points))
        learnt.append((_f1(lesson, kinds, put_in), lesson))
    return max(learnt, key=lambda each: each[0])[1]


def _example(place: GoodField, number: int, kind: int) -> GoodExample:
    return with_outliers(place, TAUGHT[kind], _FIRST_SEED + number * len(TAUGHT) + kind)


def _threshold(lesson: Lesson, good: LabelledCommunities, points: int) -> float:
    """The least threshold that removes hardly any of the untouched points of the taught fields."""
    chances = LessonJudge(lesson).chances_of(good.traits)
    for threshold in _THRESHOLDS[lesson.judge == 'rules' :]:
        if good.good[chances >= threshold].sum() <= _REMOVED * points:
            return threshold
    return _THRESHOLDS[-1]


def _f1(lesson: Lesson, kinds: Sequence[LabelledCommunities], put_in: Sequence[int]) -> float:
    """Mean F1 over the kinds of outliers that the lesson was taught."""
    judge = LessonJudge(lesson)
    scores = []
    for communities, number in zip(kinds, put_in, strict=True):
        removed = judge.chances_of(communities.traits) >= lesson.threshold
        found, wrong = communities.outliers[removed].sum(), communities.good[removed].sum()
        scores.append(2 * float(found) / max(float(found + wrong) + number, 1.0))
    return mean(scores)
