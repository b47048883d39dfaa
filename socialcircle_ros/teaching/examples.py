# SPDX-License-Identifier: Apache-2.0
"""Examples: outliers put into fields of good clouds, and the communities that are found in them."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from socialcircle_ros.circle.adaptive import (
    AdaptiveResult,
    CommunityJudge,
    Likelihood,
    Probabilities,
    find_outliers,
    find_probable_outliers,
)
from socialcircle_ros.circle.adaptive.communities import Communities, Traits
from socialcircle_ros.circle.adaptive.heights import RelativeHeights
from socialcircle_ros.cloud import Cloud, Floats, Mask
from socialcircle_ros.simulation import Contamination, add_outliers

from .clouds import GoodField

_FAR_FROM_EDGES = 0.01
"""Weight of a point that is not beside an edge, relative to one that is: a field may have hardly an edge."""


@dataclass(frozen=True)
class PutIn:
    """A kind of outliers that are put in.

    Attributes:
        contamination: their number, shapes and heights.
        at_edges: they lie at the highest steps and beside holes, where a part itself looks most like outliers.
    """

    contamination: Contamination
    at_edges: bool = False

    @property
    def name(self) -> str:
        """For a person, without the share."""
        kind = self.contamination
        low, high, least, most = *kind.amplitude, *kind.radius
        shape = f'{low:g} to {high:g} σ, clusters of {least:g} to {most:g} points radius, {kind.flank} flanks'
        return shape + ', at steps and beside holes' * self.at_edges


TAUGHT = (
    PutIn(Contamination(share=0.005, amplitude=(7.0, 60.0), radius=(1.0, 6.0), spread=0.1)),
    PutIn(Contamination(share=0.03, amplitude=(7.0, 40.0), radius=(1.0, 10.0), spread=0.05)),
    PutIn(Contamination(share=0.1, amplitude=(7.0, 60.0), radius=(2.0, 14.0), clustered=0.7, spread=0.2)),
    PutIn(
        Contamination(share=0.03, amplitude=(7.0, 80.0), radius=(1.0, 4.0), clustered=0.2, spread=0.1),
        at_edges=True,
    ),
)
"""What is put into the fields to teach on. Few, because a part has few outliers, and more, to see more shapes."""

CHECKED = (
    PutIn(Contamination(share=0.01, amplitude=(8.0, 30.0), radius=(1.5, 5.0), flank='sharp', spread=0.3)),
    PutIn(Contamination(share=0.05, amplitude=(8.0, 50.0), radius=(2.0, 8.0), spread=0.02)),
    PutIn(Contamination(share=0.1, amplitude=(10.0, 40.0), radius=(3.0, 12.0), flank='blurred', clustered=0.8)),
    PutIn(
        Contamination(share=0.02, amplitude=(10.0, 60.0), radius=(1.5, 3.0), flank='sharp', clustered=0.3),
        at_edges=True,
    ),
)
"""What is put into the fields kept back: other shapes, heights and places than taught."""

OutlierLabels = npt.NDArray[np.float64]
"""(n,) float64: 1 for an outlier, 0 for a good community."""
PointCounts = npt.NDArray[np.float64]
"""(n,) float64: numbers of points of communities."""


@dataclass(frozen=True, eq=False)
class GoodExample:
    """A field, with or without outliers put in.

    Attributes:
        field: the field.
        heights: (H, W), NaN where not measured.
        outlier: (H, W) bool, the points that were put off.
        counted: (H, W) bool, points of certain truth.
    """

    field: GoodField
    heights: Floats
    outlier: Mask
    counted: Mask

    @property
    def points(self) -> Cloud:
        """(H, W, 3) the cloud with these heights."""
        points = self.field.cloud.points.copy()
        points[..., 2] = self.heights
        return points

    def filtered(self, judge: CommunityJudge | None, likelihood: Likelihood | None) -> AdaptiveResult:
        """Filter it, with a judge or without.

        Args:
            judge: decides about the communities found.
            likelihood: gives the probabilities of the points; None: the rules find the communities.
        """
        if likelihood is not None:
            return find_probable_outliers(self.heights, likelihood, judge)
        return find_outliers(self.heights, self.field.cloud.depth_of_field, judge=judge)


@dataclass(frozen=True, eq=False)
class LabelledCommunities:
    """Communities, and what they consist of.

    Attributes:
        traits: (n, 12).
        outliers: points of each that were put off.
        good: points of each that were not; those of uncertain truth are neither.
    """

    traits: Traits
    outliers: PointCounts
    good: PointCounts

    @property
    def labels(self) -> OutlierLabels:
        """Whether most points of a community are outliers."""
        return (self.outliers > self.good).astype(np.float64)

    @property
    def weights(self) -> PointCounts:
        """How many more points are right than wrong, if a community is judged by its label."""
        return np.abs(self.outliers - self.good)


@dataclass
class _Witness:
    """A judge that lets everything be an outlier, and keeps what it was shown."""

    least: float
    threshold: float = 0.5
    seen: list[Communities] = field(default_factory=list)

    def chances(self, communities: Communities) -> npt.NDArray[np.float64]:
        self.seen.append(communities)
        return np.ones(len(communities.traits))


def untouched(place: GoodField) -> GoodExample:
    """The field as it is. Suspects do not count."""
    measured: Mask = np.isfinite(place.heights)
    nothing: Mask = np.zeros_like(measured)
    return GoodExample(place, place.heights, nothing, measured & ~place.suspects)


def with_outliers(place: GoodField, kind: PutIn, seed: int) -> GoodExample:
    """The field with outliers put in, whose displacements are in units of its noise."""
    heights = place.heights.astype(np.float64)
    weight = np.where(place.edges, 1.0, _FAR_FROM_EDGES) if kind.at_edges else None
    made = add_outliers(heights, replace(kind.contamination, unit=place.noise), seed, weight)
    counted: Mask = (np.isfinite(heights) & ~place.suspects & ~made.ambiguous) | made.outlier
    moved = place.heights.copy()
    moved[made.displacement != 0] = made.heights[made.displacement != 0]
    return GoodExample(place, moved, made.outlier, counted)


def communities_in(
    example: GoodExample, levels: Sequence[float], likelihood: Likelihood | None
) -> tuple[list[LabelledCommunities], float]:
    """The communities that are found in an example at each level, and the spread of its surface.

    Args:
        example: the field.
        levels: communities are steeper than this, or their points are more probable; at least one.
        likelihood: gives the probabilities of the points; None: the rules find the communities.
    """
    once = None if likelihood is None else _computed_once(likelihood)
    found, spread = [], 0.0
    for least in levels:
        witness = _Witness(least)
        spread = example.filtered(witness, once).spread
        communities = witness.seen[0]
        number = len(communities.traits)
        outliers, good = (
            np.bincount(communities.labels, mask.flat[communities.points], number).astype(np.float64)
            for mask in (example.outlier, example.counted & ~example.outlier)
        )
        found.append(LabelledCommunities(communities.traits, outliers, good))
    return found, spread


def _computed_once(likelihood: Likelihood) -> Likelihood:
    """The probabilities of one example at every level, for one run of the network."""
    known: list[Probabilities] = []

    def probabilities(heights: RelativeHeights) -> Probabilities:
        if not known:
            known.append(likelihood(heights))
        return known[0].copy()

    return probabilities


def joined(parts: Sequence[LabelledCommunities]) -> LabelledCommunities:
    """All communities together."""
    return LabelledCommunities(
        np.concatenate([part.traits for part in parts]),
        np.concatenate([part.outliers for part in parts]),
        np.concatenate([part.good for part in parts]),
    )
