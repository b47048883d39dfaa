"""Which filters meet on which clouds: how much is tried, and each filter at its default and at its best."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from socialcircle_ros.cloud import Mask
from socialcircle_ros.metrics.scores import Scores, score

from .labelled_clouds import (
    PAPER_SIZE,
    PAPERS_SCENES,
    TITLES,
    LabelledCloud,
    other_seeds,
    scanned_cloud,
    synthetic_cloud,
)
from .methods import KINDS, FilterSettings, Method, method
from .search import best_settings


@dataclass(frozen=True)
class Plan:
    """How much is tried.

    Attributes:
        seeds: of the clouds that the scores come from.
        size: rows and columns of the painted clouds.
        small: rows and columns of the clouds that settings are searched on, and of focus stacks.
        smaller: rows and columns where many clouds are needed: over contaminations, and for elections.
        shares: of outliers.
        repeats: how often each time is taken.
        votes: how many elections for each line of figure 4.
        painted: the scenes with outliers painted on.
        scanned: the scenes that are also scanned by the virtual instrument.
        drawn: which settings of a filter are drawn in figure 8.
    """

    seeds: tuple[int, ...]
    size: tuple[int, int] = PAPER_SIZE
    small: tuple[int, int] = (480, 640)
    smaller: tuple[int, int] = (240, 320)
    shares: tuple[float, ...] = (0.02, 0.05, 0.1, 0.2, 0.3, 0.45)
    repeats: int = 7
    votes: int = 20
    painted: tuple[str, ...] = tuple(TITLES)
    scanned: tuple[str, ...] = PAPERS_SCENES
    drawn: tuple[str, ...] = ('default', 'best')

    @property
    def scenes(self) -> list[tuple[str, bool]]:
        """Every scene, and whether it comes from a rendered focus stack."""
        return [(scene, False) for scene in self.painted] + [(scene, True) for scene in self.scanned]

    @property
    def search_seeds(self) -> tuple[int, ...]:
        """Of the clouds on which settings are searched: none of `seeds`."""
        return other_seeds(self.seeds, 2)


def quick_plan(seeds: tuple[int, ...]) -> Plan:
    """A plan for trying the experiments out: its numbers say little."""
    return Plan(
        seeds[:1],
        size=(144, 192),
        small=(96, 128),
        smaller=(96, 128),
        shares=(0.02, 0.45),
        repeats=2,
        votes=1,
        painted=('metal_groove', 'steep_groove'),
        scanned=('metal_groove',),
        drawn=('best',),
    )


@dataclass(frozen=True)
class Study:
    """The filters for each kind of cloud; a search is done once, and remembered."""

    plan: Plan
    tell: Callable[[str], None]
    _best: dict[tuple[str, bool], list[FilterSettings]] = field(default_factory=dict)

    def cloud(self, scene: str, seed: int, *, from_stack: bool = False) -> LabelledCloud:
        """A cloud of a scene: painted, or from a rendered focus stack."""
        if from_stack:
            return scanned_cloud(scene, self.plan.small, seed)
        return synthetic_cloud(scene, self.plan.size, seed)

    def best(self, scene: str, *, from_stack: bool = False) -> list[FilterSettings]:
        """The best settings of each filter, in the order of `KINDS`."""
        key = scene, from_stack
        if key not in self._best:
            self.tell(f'{scene}: making clouds to search on')
            make = scanned_cloud if from_stack else synthetic_cloud
            clouds = [make(scene, self.plan.small, seed) for seed in self.plan.search_seeds]
            self._best[key] = [self._search(scene, kind, clouds) for kind in KINDS]
        return self._best[key]

    def methods(self, scene: str, *, from_stack: bool = False) -> list[Method]:
        """Every filter at its default and at its best, ours first."""
        pairs = zip(KINDS, self.best(scene, from_stack=from_stack), strict=True)
        return [each for kind, best in pairs for each in (method(kind(), 'default'), method(best, 'best'))]

    def _search(self, scene: str, kind: type[FilterSettings], clouds: Sequence[LabelledCloud]) -> FilterSettings:
        self.tell(f'{scene}: searching {kind.__name__.removesuffix("Settings").lower()} settings')
        return best_settings(kind, clouds)


def judged(found: Mask, cloud: LabelledCloud) -> Scores:
    """A mask against the truth of the cloud."""
    return score(found, cloud.outlier, cloud.counted)


def mean_scores(scores: Sequence[Scores]) -> Scores:
    """The mean over clouds, score by score."""
    fields = ('precision', 'recall', 'f1', 'false_positive_rate')
    return Scores(**{name: float(np.mean([getattr(each, name) for each in scores])) for name in fields})
