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
    find_outliers,
    find_probable_outliers,
)
from socialcircle_ros.circle.adaptive.communities import Communities, Traits
from socialcircle_ros.cloud import Cloud, Floats, Mask
from socialcircle_ros.simulation import Contamination, add_outliers

from .clouds import GoodField

TAUGHT = (
    Contamination(share=0.005, amplitude=(7.0, 60.0), radius=(1.0, 6.0), spread=0.1),
    Contamination(share=0.03, amplitude=(7.0, 40.0), radius=(1.0, 10.0), spread=0.05),
    Contamination(share=0.1, amplitude=(7.0, 60.0), radius=(2.0, 14.0), clustered=0.7, spread=0.2),
)
"""What is put into the fields to teach on. Few, because a part has few outliers, and more, to see more shapes."""

CHECKED = (
    Contamination(share=0.01, amplitude=(8.0, 30.0), radius=(1.5, 5.0), flank='sharp', spread=0.3),
    Contamination(share=0.05, amplitude=(8.0, 50.0), radius=(2.0, 8.0), spread=0.02),
    Contamination(share=0.1, amplitude=(10.0, 40.0), radius=(3.0, 12.0), flank='blurred', clustered=0.8),
)
"""What is put into the fields kept back: other shapes, heights and places than taught."""

OutlierLabels = npt.NDArray[np.float64]
"""(n,) float64: 1 for an outlier, 0 for a good community."""
PointWeights = npt.NDArray[np.float64]
"""(n,) float64: how many points a community counts for."""


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
    """The traits of communities, (n, 12), whether each is an outlier, and its weight in points."""

    traits: Traits
    labels: OutlierLabels
    weights: PointWeights


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


def with_outliers(place: GoodField, contamination: Contamination, seed: int) -> GoodExample:
    """The field with outliers put in, whose displacements are in units of its noise."""
    heights = place.heights.astype(np.float64)
    made = add_outliers(heights, replace(contamination, unit=place.noise), seed)
    counted: Mask = (np.isfinite(heights) & ~place.suspects & ~made.ambiguous) | made.outlier
    moved = place.heights.copy()
    moved[made.displacement != 0] = made.heights[made.displacement != 0]
    return GoodExample(place, moved, made.outlier, counted)


def communities_in(
    example: GoodExample, least: float, likelihood: Likelihood | None
) -> tuple[LabelledCommunities, float]:
    """The communities that are found in an example, and the spread of its surface.

    Args:
        example: the field.
        least: communities are steeper than this, or their points are more probable.
        likelihood: gives the probabilities of the points; None: the rules find the communities.
    """
    witness = _Witness(least)
    spread = example.filtered(witness, likelihood).spread
    communities = witness.seen[0]
    number = len(communities.traits)
    outliers, good = (
        np.bincount(communities.labels, mask.flat[communities.points], number)
        for mask in (example.outlier, example.counted & ~example.outlier)
    )
    labels = (outliers > good).astype(np.float64)
    return LabelledCommunities(communities.traits, labels, np.abs(outliers - good)), spread


def joined(parts: Sequence[LabelledCommunities]) -> LabelledCommunities:
    """All communities together."""
    return LabelledCommunities(
        np.concatenate([part.traits for part in parts]),
        np.concatenate([part.labels for part in parts]),
        np.concatenate([part.weights for part in parts]),
    )
