# SPDX-License-Identifier: Apache-2.0
"""What a sweep may conclude: a better setting, or candidates between which a person decides.

All clouds weigh alike, however many outliers each has.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .trials import Trial, best_of

LEAST_CLOUDS = 3
"""Fewest clouds that show a spread."""

STANDARD_ERRORS = 3.0
"""How many standard errors of the mean the margin must exceed.

Among 40 settings that differ by chance only, over 3 to 10 clouds, 4 to 7 % of the sweeps have such a margin; with
2 standard errors it would be 10 to 12 %.
"""

MOST_CANDIDATES = 4

STATISTIC = (
    'For each cloud, the setting with the highest mean score on the other clouds is compared with the parameters'
    ' as given, on this cloud. The margin is the mean of these differences. It counts if it exceeds'
    f' {STANDARD_ERRORS:g} standard errors, which are the standard deviation of the differences over the root of'
    f' the number of clouds, and if there are at least {LEAST_CLOUDS} clouds.'
)
"""How a margin is held to the spread between clouds, in words."""


@dataclass(frozen=True)
class Decision:
    """What a sweep concludes.

    Attributes:
        winner: the trial whose setting is better than the one as given, beyond the spread between clouds; None if
            that cannot be said.
        reason: why there is a winner, or why there is none, as a sentence.
        candidates: trials to look at side by side; the winner, or the one with the highest score, is among them.
    """

    winner: Trial | None
    reason: str
    candidates: Sequence[Trial]


def decide(trials: Sequence[Trial], given: Trial, *, has_truth: bool) -> Decision:
    """Say whether a setting is better than the one as given.

    Args:
        trials: all trials.
        given: the one with the parameters as given.
        has_truth: whether the scores are against the truth.
    """
    candidates = candidates_of(trials, given, by_score=has_truth)
    if not has_truth:
        return Decision(
            None,
            'The recording holds no truth, so no setting can be called better. Look at the candidates: a person'
            ' decides.',
            candidates,
        )
    best, clouds = best_of(trials), len(given.cloud_scores)
    if best is given or best.score <= given.score:
        return Decision(None, 'No setting scores higher than the parameters as given.', candidates)
    comparable = [trial for trial in trials if len(trial.cloud_scores) == clouds]
    if clouds < LEAST_CLOUDS or best not in comparable:
        return Decision(
            None,
            f'{clouds} {"cloud shows" if clouds == 1 else "clouds show"} no spread between clouds, so the margin'
            f' of {best.score - given.score:.4f} over the parameters as given may be chance: a person decides.',
            candidates,
        )
    differences = _paired_differences(comparable, given)
    margin = float(differences.mean())
    error = float(differences.std(ddof=1)) / math.sqrt(clouds)
    measured = (
        f'the margin over the parameters as given is {margin:.4f}, with a standard error of {error:.4f} between'
        f' {clouds} clouds'
    )
    if margin <= STANDARD_ERRORS * error or margin <= 0:
        return Decision(None, f'No setting is clearly better: {measured}. A person decides.', candidates)
    return Decision(best, f'The best setting is better beyond the spread: {measured}.', candidates)


def _paired_differences(trials: Sequence[Trial], given: Trial) -> npt.NDArray[np.float64]:
    """For each cloud, the score of the setting that is best on the others, minus that of the given one."""
    scores = np.array([trial.cloud_scores for trial in trials])
    others = scores.sum(axis=1, keepdims=True) - scores
    clouds = np.arange(scores.shape[1])
    chosen: npt.NDArray[np.float64] = scores[others.argmax(axis=0), clouds]
    return chosen - np.array(given.cloud_scores, np.float64)


def candidates_of(trials: Sequence[Trial], given: Trial, *, by_score: bool) -> list[Trial]:
    """Choose trials with different results to look at side by side; the one as given is the first.

    Args:
        trials: all trials.
        given: the one with the parameters as given.
        by_score: whether to take those with the highest scores; else the shares of removed points are spread
            evenly over what the trials removed.
    """
    different = {_result(trial): trial for trial in reversed(trials) if _result(trial) != _result(given)}
    others = list(different.values())
    room = MOST_CANDIDATES - 1
    if by_score:
        return [given, *sorted(others, key=lambda trial: -trial.score)[:room]]
    ordered = sorted(others, key=lambda trial: trial.removed)
    places = sorted({round(place) for place in np.linspace(0, len(ordered) - 1, room)}) if ordered else []
    return [given, *(ordered[place] for place in places)]


def _result(trial: Trial) -> tuple[float, ...]:
    """Equal for trials that removed the same, as far as their numbers tell."""
    return trial.removed, trial.score, *trial.cloud_scores
