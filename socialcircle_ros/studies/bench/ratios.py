# SPDX-License-Identifier: Apache-2.0
"""Speed as ratios of median times in one run, in which all candidates take turns; the ratios have goals.

A ratio is more reproducible than a time, because other load on the machine affects all candidates alike.
"""

import itertools
import math
import statistics
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from .candidates import (
    ADAPTIVE,
    COPY,
    EXACT,
    EXPANSION,
    FILTER,
    LARGE_VOTE,
    NUMPY,
    OPEN3D_RADIUS,
    OPEN3D_STATISTICAL,
    OPENCV,
    PCL_RADIUS,
    PCL_STATISTICAL,
    RADIUS,
    RULES,
    STATISTICAL,
    VOTE,
    Candidate,
)

SLOW_MS = 300.0
"""A peer that takes longer is repeated `SLOW_REPEATS` times only."""
SLOW_REPEATS = 5


@dataclass(frozen=True)
class Figure:
    """The measured time of a candidate.

    Attributes:
        name: of the candidate.
        threads: that it may use; None: the peer decides.
        is_peer: whether it is another library's.
        milliseconds: the median.
        repeats: number of timed runs, after one warm-up run.
    """

    name: str
    threads: int | None
    is_peer: bool
    milliseconds: float
    repeats: int


@dataclass(frozen=True)
class RatioGoal:
    """A ratio of two candidates, and its bound.

    Attributes:
        numerator: name of a candidate.
        denominator: name of another; '' for one millisecond.
        sense: whether the bound is an upper or a lower one.
        bound: of the ratio.
    """

    numerator: str
    denominator: str
    sense: Literal['at most', 'at least']
    bound: float

    @property
    def label(self) -> str:
        """What is divided by what; of a time, its unit."""
        return f'{self.numerator} : {self.denominator}' if self.denominator else f'{self.numerator}, ms'

    def is_met(self, ratio: float) -> bool:
        """Whether the ratio is on the right side of the bound."""
        return ratio <= self.bound if self.sense == 'at most' else ratio >= self.bound


GOALS = (
    RatioGoal(EXPANSION, OPENCV, 'at most', 1.5),
    RatioGoal(PCL_STATISTICAL, EXPANSION, 'at least', 200),
    RatioGoal(NUMPY, VOTE, 'at least', 100),
    RatioGoal(LARGE_VOTE, '', 'at most', 60),
    RatioGoal(PCL_STATISTICAL, EXACT, 'at least', 100),
    RatioGoal(PCL_RADIUS, EXACT, 'at least', 100),
    RatioGoal(OPEN3D_STATISTICAL, EXACT, 'at least', 100),
    RatioGoal(OPEN3D_RADIUS, EXACT, 'at least', 100),
    RatioGoal(f'{EXACT}, window 5', EXACT, 'at most', 3),
    RatioGoal(f'{EXACT}, window 7', EXACT, 'at most', 3),
    RatioGoal(PCL_STATISTICAL, ADAPTIVE, 'at least', 10),
    RatioGoal(PCL_STATISTICAL, RULES, 'at least', 10),
    RatioGoal(PCL_RADIUS, RADIUS, 'at least', 20),
    RatioGoal(PCL_STATISTICAL, STATISTICAL, 'at least', 20),
    RatioGoal(FILTER, COPY, 'at most', 1.5),
)


@dataclass(frozen=True)
class Ratio:
    """A goal, and the ratio that was measured with a number of threads on this package's side."""

    goal: RatioGoal
    threads: int
    ratio: float

    @property
    def is_met(self) -> bool:
        """Whether the goal is met."""
        return self.goal.is_met(self.ratio)


def benchmark(candidates: list[Candidate], repeats: int, progress: Callable[[str], None]) -> list[Figure]:
    """Time all candidates, which take turns.

    Args:
        candidates: what is timed.
        repeats: timed runs of each, after one warm-up run; slow peers have `SLOW_REPEATS`, spread over the turns.
        progress: called with the step that begins.
    """
    for each in candidates:
        progress(f'{each.label}: warm-up')
        each.run()
    times_ms: dict[Candidate, list[float]] = {each: [] for each in candidates}
    for turn, each in itertools.product(range(repeats), candidates):
        taken_ms = times_ms[each]
        is_slow = each.is_peer and turn > 0 and taken_ms[0] > SLOW_MS
        if not is_slow or turn * SLOW_REPEATS // repeats >= len(taken_ms):
            progress(f'turn {turn + 1} of {repeats}: {each.label}')
            taken_ms.append(each.run())
    return [
        Figure(each.name, each.threads, each.is_peer, statistics.median(taken_ms), len(taken_ms))
        for each, taken_ms in times_ms.items()
    ]


def ratios(figures: list[Figure]) -> list[Ratio]:
    """The ratio of each goal with two timed candidates, for each number of this package's threads.

    A peer counts with its shortest median time.
    """
    peers_ms = {'': 1.0}
    ours_ms: dict[tuple[str, int], float] = {}
    for figure in figures:
        if figure.is_peer:
            peers_ms[figure.name] = min(peers_ms.get(figure.name, math.inf), figure.milliseconds)
        elif figure.threads is not None:
            ours_ms[figure.name, figure.threads] = figure.milliseconds
    found = []
    for goal, count in itertools.product(GOALS, sorted({count for _, count in ours_ms})):
        above, below = (
            ours_ms.get((name, count), peers_ms.get(name)) for name in (goal.numerator, goal.denominator)
        )
        if above is not None and below is not None:
            found.append(Ratio(goal, count, above / below))
    return found
