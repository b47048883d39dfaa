# SPDX-License-Identifier: Apache-2.0
"""What a study compares: its size (`Plan`), and each filter at its default and at its best settings (`Study`)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from socialcircle_ros.metrics.scores import Scores
from socialcircle_ros.studies.workload import SCAN, SEARCH, SYNTHETIC, million_points

from .labelled_clouds import (
    PAPER_SCENES,
    PAPER_SIZE,
    TITLES,
    LabelledCloud,
    other_seeds,
    scanned_cloud,
    synthetic_cloud,
)
from .methods import SETTINGS_TYPES, FilterSettings, Method, default_settings, method, name_of
from .search import best_settings


@dataclass(frozen=True)
class Plan:
    """Which clouds a study uses, and how often it repeats.

    Attributes:
        seeds: of the clouds that are scored.
        full_size: rows and columns of the synthetic clouds.
        medium_size: rows and columns of focus stacks, and of the clouds that settings are searched on.
        small_size: rows and columns where many clouds are needed: for elections and for each share of outliers.
        shares: of outliers.
        repeats: how often each time is measured.
        elections: number of elections for each row of figure 4.
        synthetic: scenes with added outliers.
        scanned: scenes that the virtual instrument scans as well.
        drawn_variants: settings that figure 8 shows, by variant.
    """

    seeds: tuple[int, ...]
    full_size: tuple[int, int] = PAPER_SIZE
    medium_size: tuple[int, int] = (480, 640)
    small_size: tuple[int, int] = (240, 320)
    shares: tuple[float, ...] = (0.02, 0.05, 0.1, 0.2, 0.3, 0.45)
    repeats: int = 7
    elections: int = 20
    synthetic: tuple[str, ...] = tuple(TITLES)
    scanned: tuple[str, ...] = PAPER_SCENES
    drawn_variants: tuple[str, ...] = ('default', 'best')

    @property
    def scenes(self) -> list[tuple[str, bool]]:
        """Each scene, and whether its clouds come from rendered focus stacks."""
        return [(scene, False) for scene in self.synthetic] + [(scene, True) for scene in self.scanned]

    @property
    def search_seeds(self) -> tuple[int, ...]:
        """Seeds of the clouds that settings are searched on; none of them is scored."""
        return other_seeds(self.seeds, 2)


def quick_plan(seeds: tuple[int, ...]) -> Plan:
    """A small plan that checks that the experiments run; its numbers are not meaningful."""
    return Plan(
        seeds[:1],
        full_size=(144, 192),
        medium_size=(96, 128),
        small_size=(96, 128),
        shares=(0.02, 0.45),
        repeats=2,
        elections=1,
        synthetic=('metal_groove', 'steep_groove'),
        scanned=('metal_groove',),
        drawn_variants=('best',),
    )


@dataclass(frozen=True)
class Study:
    """A plan, and the settings found so far: each search runs once.

    Attributes:
        plan: sizes, seeds and repeats.
        progress: called with the step that begins.
    """

    plan: Plan
    progress: Callable[[str], None]
    _best: dict[tuple[str, bool], list[FilterSettings]] = field(default_factory=dict)
    _planned: set[tuple[str, bool]] = field(default_factory=set)

    def cloud(self, scene: str, seed: int, *, from_stack: bool = False) -> LabelledCloud:
        """A cloud of a scene: synthetic, or from a rendered focus stack."""
        if from_stack:
            return scanned_cloud(scene, self.plan.medium_size, seed)
        return synthetic_cloud(scene, self.plan.full_size, seed)

    def clouds(self, scene: str, *, from_stack: bool = False) -> list[LabelledCloud]:
        """The clouds of a scene that are scored, one for each seed of the plan."""
        clouds = []
        for seed in self.plan.seeds:
            self.progress(f'{scene}: making the cloud of seed {seed}')
            clouds.append(self.cloud(scene, seed, from_stack=from_stack))
        return clouds

    def search_work(self, scene: str, *, from_stack: bool = False) -> float:
        """Work of the search for the best settings of a scene: 0 from the second call on, since it runs once."""
        if (scene, from_stack) in self._planned:
            return 0.0
        self._planned.add((scene, from_stack))
        making = SCAN if from_stack else SYNTHETIC
        return len(self.plan.search_seeds) * million_points(self.plan.medium_size) * (making + SEARCH)

    def clouds_work(self, *, from_stack: bool = False, per_cloud: float = 0.0) -> float:
        """Work of making the clouds of a scene that are scored, and of what is done with each.

        Args:
            from_stack: whether they come from rendered focus stacks.
            per_cloud: work for a million of its points.
        """
        size, making = (self.plan.medium_size, SCAN) if from_stack else (self.plan.full_size, SYNTHETIC)
        return len(self.plan.seeds) * million_points(size) * (making + per_cloud)

    def best(self, scene: str, *, from_stack: bool = False) -> list[FilterSettings]:
        """The best settings of each filter, in the order of `SETTINGS_TYPES`."""
        key = scene, from_stack
        if key not in self._best:
            self.progress(f'{scene}: making the clouds for the settings search')
            make = scanned_cloud if from_stack else synthetic_cloud
            clouds = [make(scene, self.plan.medium_size, seed) for seed in self.plan.search_seeds]
            self._best[key] = [self._search(scene, settings_type, clouds) for settings_type in SETTINGS_TYPES]
        return self._best[key]

    def methods(self, scene: str, *, from_stack: bool = False) -> list[Method]:
        """Each filter at its default and at its best settings; the social circle first."""
        pairs = zip(SETTINGS_TYPES, self.best(scene, from_stack=from_stack), strict=True)
        return [
            each
            for settings_type, best in pairs
            for each in (method(default_settings(settings_type), 'default'), method(best, 'best'))
        ]

    def _search(
        self, scene: str, settings_type: type[FilterSettings], clouds: Sequence[LabelledCloud]
    ) -> FilterSettings:
        self.progress(f'{scene}: searching settings, {name_of(settings_type).lower()}')
        return best_settings(settings_type, clouds)


def mean_scores(scores: Sequence[Scores]) -> Scores:
    """The mean of each score over several clouds."""
    fields = ('precision', 'recall', 'f1', 'false_positive_rate')
    return Scores(**{name: float(np.mean([getattr(each, name) for each in scores])) for name in fields})
