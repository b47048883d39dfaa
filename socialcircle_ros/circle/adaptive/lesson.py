# SPDX-License-Identifier: Apache-2.0
"""How a lesson judges: the communities that the rules or the network find, by their traits.

The probability that a community is an outlier is a logistic function of its traits and their products. Where the
texture of a part has islands that look like outliers, size, height and surroundings still tell them apart.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np
import numpy.typing as npt

from socialcircle_ros.settings.lessons import Lesson

from .communities import Communities, Traits

Chances = npt.NDArray[np.float64]
"""(n,) float64, 0 to 1: that each of n communities is an outlier."""

_FURTHEST = 4.0
"""Standardised traits are clipped here: a lesson does not extrapolate."""
_UNLIKE = 2.0
"""Spreads beyond those of the lesson by this factor are of another surface."""


class CommunityJudge(Protocol):
    """Decides about the communities that the rules or the network find.

    Attributes:
        least: communities are found that are steeper than this, or have points that are more probable.
        threshold: a community is an outlier if its chance is at least this; above 0, below 1.
    """

    @property
    def least(self) -> float: ...  # noqa: D102 - above

    @property
    def threshold(self) -> float: ...  # noqa: D102 - above

    def chances(self, communities: Communities) -> Chances:
        """The chance of each community to be an outlier."""
        ...


@dataclass(frozen=True)
class LessonJudge:
    """Judges by a lesson."""

    lesson: Lesson

    @property
    def least(self) -> float:
        """As in `CommunityJudge`."""
        return self.lesson.least

    @property
    def threshold(self) -> float:
        """As in `CommunityJudge`."""
        return self.lesson.threshold

    def chances(self, communities: Communities) -> Chances:
        """The chance of each community to be an outlier."""
        return self.chances_of(communities.traits)

    def chances_of(self, traits: Traits) -> Chances:
        """The chance of communities with these traits."""
        lesson = self.lesson
        mean, scale, weights = _arrays(lesson.mean, lesson.scale, lesson.weights)
        return logistic(terms(traits, mean, scale) @ weights)


def terms(
    traits: Traits, mean: npt.NDArray[np.float64], scale: npt.NDArray[np.float64]
) -> npt.NDArray[np.float64]:
    """(n, 91) float64: a constant, the standardised traits, and the products of two."""
    standard = np.clip((traits - mean) / scale, -_FURTHEST, _FURTHEST)
    first, second = np.triu_indices(traits.shape[1])
    products = standard[:, first] * standard[:, second]
    return np.concatenate([np.ones((len(traits), 1)), standard, products], axis=1)


def logistic(values: npt.NDArray[np.float64]) -> Chances:
    """1 / (1 + exp(-v))."""
    result: Chances = 1 / (1 + np.exp(-np.clip(values, -50, 50)))
    return result


def unlike(lesson: Lesson, spread: float) -> list[str]:
    """A warning where the spread of a cloud is far from that of the clouds of the lesson."""
    low, high = lesson.spread
    if high and spread > _UNLIKE * high:
        scale = f'{spread / high:.3g} times as large as'
    elif spread < low / _UNLIKE:
        scale = f'{spread / low:.2g} times'
    else:
        return []
    differs = f'the surface is unlike that of circle.lesson: its spread is {scale} that of the good clouds'
    return [f'{differs}; teach on such a surface, or leave the lesson out.']


@lru_cache(maxsize=8)
def _arrays(*numbers: tuple[float, ...]) -> tuple[npt.NDArray[np.float64], ...]:
    return tuple(map(np.array, numbers))
