# SPDX-License-Identifier: Apache-2.0
"""The adaptive mode composed: isolated points, then islands, then islands at reduced resolution."""

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Mask
from socialcircle_ros.kernels.compiled import kernel
from socialcircle_ros.kernels.stopwatch import Stopwatch

from .communities import Certainty, communities_of, label_communities
from .differences import Differences, Spread, normalised_differences
from .far import far_points
from .heights import RelativeHeights, relative_heights, with_holes_filled
from .islands import find_islands
from .isolated import isolated_points
from .lesson import CommunityJudge
from .likelihood import (
    MANY_UNDECIDED,
    ONE,
    UNDECIDED,
    Likelihood,
    Sureness,
    probable_outliers,
    sureness_about_sets,
)
from .optics import beside_walls, beyond_tolerance
from .parts import taken_for_parts
from .pyramid import halved, mark_expanded, raise_expanded
from .quantisation import quantisation_step
from .relief import relief_of
from .spread import estimate_spread
from .texture import NO_ISLANDS, Islands, OneHeight, islands_of_one_height

STEEPER = {1: 0.0, 2: 0.01, 4: 0.03}
"""Additional steepness by reduction: the fewer points a border has, the more chance does to its mean."""
EASIER, LEAST_STEEP = 0.05, 0.80
"""Each doubling of the share of isolated points beyond `Rules.few` lowers the required steepness by `EASIER`, down
to `LEAST_STEEP`: the more outliers there are, the likelier an island is one."""
CLIP_PREDICTED, EASIER_PREDICTED = 3.0, 0.02
"""Clip, and lower steepness, where differences are predicted: such surfaces have hardly an island of their own."""
STEEP_WITH_OPTICS = 0.85
"""Required steepness where the depth of field is known, which then decides about the islands."""
NEARLY = 0.7
"""A kept point of at least this steepness belongs to a shape that is nearly an island."""

_TILE_SIDE, _TILE_SIDE_REDUCED = 16, 10
_SMALLEST_REDUCED = 16  # points along the shorter side
_ROUNDS = 2

_OutlierScores = npt.NDArray[np.float32]


@dataclass(frozen=True)
class Rules:
    """What a community needs to count as an island; chosen by leave-one-out over the measured surfaces.

    Attributes:
        steep: the steepness of an island is above this, where 1 means that every difference is clipped.
        clip: larger differences across the border count as this one, in spreads.
        few: share of isolated points above which the required steepness is lower.
    """

    steep: float = 0.955
    clip: float = 4.0
    few: float = 0.0125


@dataclass(frozen=True, eq=False)
class AdaptiveResult:
    """What the adaptive mode found.

    Attributes:
        outliers: (H, W) bool.
        score: (H, W) float32, 0 to 1: above 0.5 for outliers, NaN where not measured.
        spread: standard deviation of the differences between neighbours, the mean over the four directions, in the
            unit of the cloud.
        islands_kept: number of islands of one height that were kept as the texture of the surface.
        kept_narrowly: whether few points more or less would have made these outliers.
        alike: removed islands of one height, which may be parts of the surface.
        taken_for_parts: removed islands that the network takes for parts of the surface.
        nearly: share of the measured points that are nearly outliers: those that were kept but are nearly as
            certain as an outlier. By probability without a lesson 0.
        sureness: how sure the probabilities are about all points; and about those in sets if many of all are
            undecided, but more are certain. Empty by the rules and with a lesson.
        times_ms: time of each step in ms.
    """

    outliers: Mask
    score: npt.NDArray[np.float32]
    spread: float
    times_ms: dict[str, float]
    islands_kept: int = 0
    kept_narrowly: bool = False
    alike: Islands = NO_ISLANDS
    taken_for_parts: Islands = NO_ISLANDS
    nearly: float = 0.0
    sureness: tuple[Sureness, ...] = ()


def find_outliers(
    heights: npt.NDArray[np.float32] | npt.NDArray[np.float64],
    depth_of_field: float | None = None,
    rules: Rules | None = None,
    judge: CommunityJudge | None = None,
) -> AdaptiveResult:
    """Find the outliers of a height map with scales that come from the map itself.

    Heights are compared with heights alone, so that neither their unit nor the pitch matters.

    Args:
        heights: (H, W) float32 or float64, NaN where not measured; at least one height is measured.
        depth_of_field: of the optics, in the unit of the heights; None where the heights do not come from a focus
            stack, or where it is unknown.
        rules: None: the default rules.
        judge: decides about what the rules find. It knows the texture of its kind of part, so that the texture
            rule is left out. None: all that is found are outliers.
    """
    rules = rules or Rules()
    if judge is not None:
        rules = replace(rules, steep=judge.least)
    stopwatch = Stopwatch()
    relative, exponent = relative_heights(heights)
    if depth_of_field is not None:
        with np.errstate(over='ignore'):  # infinite: then no island is too high
            depth_of_field = float(np.ldexp(depth_of_field, -exponent))
    search = _IslandSearch(relative)
    stopwatch.lap('heights')

    spread = search.remove_isolated_points()
    steep = _required_steepness(search.share_found(), depth_of_field, rules)
    stopwatch.lap('isolated')

    # A known depth of field decides what is too low to be an outlier, so that the finest measure is not needed.
    predicted = search.remove_islands(steep[1], rules.clip, may_predict=depth_of_field is None)
    stopwatch.lap('islands')

    texture = search.texture(by_rule=judge is None)
    stopwatch.lap('texture')

    # A surface with predicted differences has been smoothed: at reduced resolution its own hills would be steep.
    # So would be the gaps between the islands of a texture.
    if not predicted and not texture.number:
        search.remove_reduced_islands(steep, rules.clip)
        stopwatch.lap('reduced')
        texture = search.texture(by_rule=judge is None)
        stopwatch.lap('texture')
    outliers = search.found & ~texture.kept
    if judge is not None:
        outliers = _judged(relative, search.found, search.steepness, spread, judge)
        stopwatch.lap('lesson')

    if depth_of_field is not None:
        outliers = beyond_tolerance(relative, outliers, depth_of_field)
        outliers |= beside_walls(relative, outliers, depth_of_field)
        stopwatch.lap('optics')

    score = search.steepness
    nearly = _scale_scores(score, outliers, search.measured) / int(np.count_nonzero(search.measured))
    stopwatch.lap('score')
    return AdaptiveResult(
        outliers,
        score,
        math.ldexp(spread, exponent),
        stopwatch.times_ms,
        islands_kept=texture.number,
        kept_narrowly=texture.narrowly,
        alike=texture.removed if outliers.flat[texture.alike].any() else NO_ISLANDS,  # the optics may keep them
        nearly=nearly,
    )


def find_probable_outliers(
    heights: npt.NDArray[np.float32] | npt.NDArray[np.float64],
    likelihood: Likelihood,
    judge: CommunityJudge | None = None,
) -> AdaptiveResult:
    """Find the outliers of a height map by the probability of each point.

    Points far off, as `far_points` defines them, are outliers whatever their probability, and islands that belong
    to the surface are not.

    Args:
        heights: as for `find_outliers`.
        likelihood: gives the probabilities.
        judge: decides about the communities of points that are more probable than its `least`. None: the
            probabilities decide.
    """
    stopwatch = Stopwatch()
    relative, exponent = relative_heights(heights)
    stopwatch.lap('heights')
    spread = estimate_spread(relative, _TILE_SIDE, may_predict=False, step=quantisation_step(relative))
    stopwatch.lap('spread')
    probabilities = likelihood(relative)
    stopwatch.lap('network')
    measured, mean_spread = np.isfinite(relative), float(spread.by_direction.mean())
    if judge is not None:
        found = probabilities > round(judge.least * ONE)
        far = far_points(relative, spread, found, found)
        stopwatch.lap('far_points')
        probabilities[far] = ONE
        score = np.divide(probabilities, ONE, dtype=np.float32)
        outliers = _judged(relative, found | far, score, mean_spread, judge)
        nearly = _scale_scores(score, outliers, measured) / int(np.count_nonzero(measured))
        stopwatch.lap('communities')
        in_cloud = math.ldexp(mean_spread, exponent)
        return AdaptiveResult(outliers, score, in_cloud, stopwatch.times_ms, nearly=nearly)

    decided = probable_outliers(probabilities, measured)
    sureness: tuple[Sureness, ...] = (decided.sureness,)
    if MANY_UNDECIDED < decided.sureness.undecided <= decided.sureness.certain:
        sureness += (sureness_about_sets(probabilities, measured),)
    stopwatch.lap('communities')
    known = decided.outliers
    far = far_points(relative, spread, known, probabilities > round(UNDECIDED * ONE))
    stopwatch.lap('far_points')
    if far.any():
        probabilities[far] = ONE
        decided = probable_outliers(probabilities, measured)
    texture = islands_of_one_height(relative, decided.outliers, decided.communities)
    stopwatch.lap('texture')
    if texture.number:
        probabilities[texture.kept] = 0
        decided = probable_outliers(probabilities, measured)
    stopwatch.lap('communities')
    return AdaptiveResult(
        decided.outliers,
        decided.score,
        math.ldexp(mean_spread, exponent),
        stopwatch.times_ms,
        islands_kept=texture.number,
        kept_narrowly=texture.narrowly,
        alike=texture.removed,
        taken_for_parts=taken_for_parts(decided.communities, known),
        sureness=sureness,
    )


class _IslandSearch:
    """The outliers that have been found so far.

    Attributes:
        heights: (H, W) float32, with the outliers filled from their surroundings.
        measured: (H, W) bool, the points that are measured.
        found: (H, W) bool, the outliers.
        steepness: (H, W) float32: 1 for isolated points, else the steepness of the steepest community that a point
            belongs to, at least 0.
    """

    def __init__(self, heights: RelativeHeights) -> None:
        self.heights = heights
        self._given = heights
        self._step = quantisation_step(heights)
        self.measured: Mask = np.isfinite(heights)
        self.found: Mask = np.zeros(heights.shape, np.bool_)
        self.steepness = np.zeros(heights.shape, np.float32)

    def share_found(self) -> float:
        """Share of the measured points that have been found."""
        return float(self.found.sum() / self.measured.sum())

    def remove_isolated_points(self) -> float:
        """Remove isolated points twice, since they widen the spread around them; return the mean spread."""
        for _ in range(_ROUNDS):
            spread, differences = self._normalised_differences(may_predict=False)
            self._remove(isolated_points(differences))
        return float(spread.by_direction.mean())

    def remove_islands(self, steep: float, clip: float, *, may_predict: bool) -> bool:
        """Remove the islands at full resolution; return whether differences were predicted from those around."""
        spread, differences = self._normalised_differences(may_predict=may_predict)
        if spread.predicted:
            # The finer measure finds isolated points that the slope hid.
            self._remove(isolated_points(differences))
            spread, differences = self._normalised_differences(may_predict=may_predict)
        if spread.predicted:
            steep, clip = steep - EASIER_PREDICTED, CLIP_PREDICTED
        self.steepness[self.found] = 1.0
        islands, steepness = find_islands(
            relief_of(differences), differences, np.isfinite(self.heights), clip, steep, 1
        )
        np.maximum(self.steepness, steepness, out=self.steepness)
        self._remove(islands)
        self.found &= self.measured
        return spread.predicted

    def remove_reduced_islands(self, steep: dict[int, float], clip: float) -> None:
        """Remove the islands at half and a quarter of the resolution, where blurred flanks are steep."""
        heights = self.heights
        for reduction in (2, 4):
            heights = halved(heights)
            if min(heights.shape) < _SMALLEST_REDUCED:
                break
            # A coarse point is a mean of two heights.
            step = self._step / reduction
            spread = estimate_spread(heights, _TILE_SIDE_REDUCED, may_predict=False, step=step)
            differences = normalised_differences(heights, spread)
            islands, steepness = find_islands(
                relief_of(differences), differences, np.isfinite(heights), clip, steep[reduction], reduction
            )
            mark_expanded(islands, reduction, self.found)
            raise_expanded(steepness, reduction, self.steepness)
            heights = with_holes_filled(heights, islands)
        self.found &= self.measured

    def texture(self, *, by_rule: bool) -> OneHeight:
        """Find the islands that belong to the surface; none unless the rule decides that."""
        found = self.found if by_rule else np.zeros_like(self.found)
        return islands_of_one_height(self._given, found, label_communities(found))

    def _normalised_differences(self, *, may_predict: bool) -> tuple[Spread, Differences]:
        spread = estimate_spread(self.heights, _TILE_SIDE, may_predict=may_predict, step=self._step)
        return spread, normalised_differences(self.heights, spread)

    def _remove(self, outliers: Mask) -> None:
        self.found |= outliers
        self.heights = with_holes_filled(self.heights, outliers)


def _judged(
    heights: RelativeHeights, found: Mask, certainty: Certainty, spread: float, judge: CommunityJudge
) -> Mask:
    """The outliers among the communities found; `certainty` becomes that from which the score is made."""
    communities = communities_of(heights, found, certainty, spread)
    chances, least = judge.chances(communities), judge.threshold
    are_outliers = chances >= least
    sure = np.where(are_outliers, (chances - least) / (1 - least), chances / least)
    certainty.flat[communities.points] = sure[communities.labels]
    outliers: Mask = np.zeros(found.shape, np.bool_)
    outliers.flat[communities.points] = are_outliers[communities.labels]
    return outliers


def _required_steepness(isolated: float, depth_of_field: float | None, rules: Rules) -> dict[int, float]:
    """Steepness above which a community is an island, by reduction; `isolated` is the share of isolated points."""
    if depth_of_field is not None:
        return dict.fromkeys(STEEPER, STEEP_WITH_OPTICS)
    steep = rules.steep - EASIER * math.log2(max(isolated / rules.few, 1.0))
    return {reduction: max(steep + more, LEAST_STEEP) for reduction, more in STEEPER.items()}


@kernel
def _scale_scores(score: _OutlierScores, outliers: Mask, measured: Mask) -> int:
    """Turn steepness into the score in place: above 0.5 exactly for outliers, NaN where not measured.

    Returns:
        The number of kept points with a steepness of at least `NEARLY`.
    """
    height, width = score.shape
    nearly = 0
    for row in range(height):
        for column in range(width):
            if not measured[row, column]:
                score[row, column] = np.nan
            elif outliers[row, column]:
                sure = max(score[row, column], np.float32(0.1))
                score[row, column] = np.float32(0.5) + min(sure, np.float32(1)) / 2
            else:
                nearly += score[row, column] >= NEARLY
                score[row, column] = min(score[row, column], np.float32(1)) / 2
    return nearly
