"""The adaptive mode, composed: isolated points, then islands, then islands seen from further off."""

import math
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Mask
from socialcircle_ros.kernels.compiled import kernel

from .differences import Heights, estimate_spread, normalised_differences
from .islands import islands
from .isolated import isolated_points, with_holes_filled
from .optics import beside_walls, beyond_tolerance
from .relief import relief_of
from .texture import islands_of_one_height

MORE = {1: 0.0, 2: 0.01, 4: 0.03}
"""By how far off the cloud is seen, so much steeper a border must be: chance does more to one of few points."""
EASIER, EASIEST = 0.05, 0.80
"""With each doubling of the isolated points beyond `Rules.few` so much less steepness is asked for, down to the
last: the more outliers are about, the likelier is an island to be one."""
CLIP_PREDICTED, EASIER_PREDICTED = 3.0, 0.02
"""Where differences foretell each other: such surfaces have hardly an island of their own."""
STRONG_BY_OPTICS = 0.85
"""The steepness where the depth of field has the last word."""

_TILE, _TILE_FAR = 16, 10
_SCALES = (2, 4)
_FEWEST = 16
_ROUNDS = 2
_FURTHEST = float(np.finfo(np.float32).max) / 16
"""Heights further off are as good as this, of which sums and differences are finite."""


@dataclass(frozen=True)
class Rules:
    """What is asked of a community before it counts as an island; chosen with each measured surface left out once.

    Attributes:
        steep: the border of an island is steeper than this, where 1 is every difference clipped.
        clip: spreads beyond which a difference says no more of a border.
        few: share of the points that may be isolated points before less is asked.
    """

    steep: float = 0.955
    clip: float = 4.0
    few: float = 0.0125


@dataclass(frozen=True)
class AdaptiveResult:
    """What the adaptive mode found.

    Attributes:
        outliers: (H, W) bool.
        score: (H, W) float32, 0 to 1: above 0.5 for outliers, NaN where not measured.
        spread: of neighbouring heights, in the cloud's unit: the mean over the four directions.
        islands_kept: islands of one height that were taken for the surface's texture.
        times: seconds that each step took.
    """

    outliers: Mask
    score: npt.NDArray[np.float32]
    spread: float
    islands_kept: int
    times: dict[str, float]


def find_outliers(
    heights: npt.NDArray[Any], depth_of_field: float | None = None, rules: Rules | None = None
) -> AdaptiveResult:
    """Tell outliers from the surface by the surface's own measure.

    Nothing depends on the unit of the heights, nor on the pitch: heights are compared with heights.

    Args:
        heights: (H, W) float32 or float64, NaN where not measured; one at least is.
        depth_of_field: of the optics that the heights come from, in their unit; None where they do not come from
            focus, or it is not known.
        rules: other than the ones that every cloud is met with.
    """
    rules = rules or Rules()
    clock = _Clock()
    # The depth of field settles what is too low to be an outlier: no measure has to be as fine as can be.
    may_predict = depth_of_field is None
    work = _relative(heights)
    measured: Mask = np.isfinite(work)
    found: Mask = np.zeros(work.shape, np.bool_)
    score = np.zeros(work.shape, np.float32)
    clock.step('heights')

    spread = 0.0
    for _ in range(_ROUNDS):
        scale = estimate_spread(work, _TILE, may_predict=False)
        spread = float(scale.spreads.mean())
        lone = isolated_points(normalised_differences(work, scale))
        found |= lone
        work = with_holes_filled(work, lone)
    strong = _asked_for(float(found.sum() / measured.sum()), depth_of_field, rules)
    clock.step('isolated')

    scale = estimate_spread(work, _TILE, may_predict=may_predict)
    differences = normalised_differences(work, scale)
    if scale.predicted:
        # The finer measure finds isolated points that the slope hid.
        lone = isolated_points(differences)
        found |= lone
        work = with_holes_filled(work, lone)
        scale = estimate_spread(work, _TILE, may_predict=may_predict)
        differences = normalised_differences(work, scale)
    score[found] = 1.0
    steep = (CLIP_PREDICTED, strong[1] - EASIER_PREDICTED) if scale.predicted else (rules.clip, strong[1])
    spot, steepness = islands(relief_of(differences), differences, np.isfinite(work), *steep, 1)
    np.maximum(score, steepness, out=score)
    found |= spot
    work = with_holes_filled(work, spot)
    clock.step('islands')

    own = _relative(heights)
    found &= measured
    texture, kept = islands_of_one_height(own, found)
    clock.step('texture')

    # Flanks that are blurred are steps when seen from further off. A surface whose differences foretell each other
    # has been smoothed: there its own hills would be steps as well, and where it is islands, what is between them.
    if not scale.predicted and not kept:
        far = work
        for times in _SCALES:
            far = _halved(far)
            if min(far.shape) < _FEWEST:
                break
            differences = normalised_differences(far, estimate_spread(far, _TILE_FAR, may_predict=False))
            spot, steepness = islands(
                relief_of(differences), differences, np.isfinite(far), rules.clip, strong[times], times
            )
            _spread_out(spot, times, found)
            _raise_score(steepness, times, score)
            far = with_holes_filled(far, spot)
        found &= measured
        clock.step('reduced')
        texture, kept = islands_of_one_height(own, found)
        clock.step('texture')
    found &= ~texture
    if depth_of_field is not None:
        found = beyond_tolerance(own, found, depth_of_field)
        found |= beside_walls(own, found, depth_of_field)
        clock.step('optics')
    _settle(score, found, measured)
    clock.step('score')
    return AdaptiveResult(found, score, spread, kept, clock.times)


def _asked_for(lone: float, depth_of_field: float | None, rules: Rules) -> dict[int, float]:
    """Steepness that an island needs, by how far off the cloud is seen; `lone`: the share of isolated points."""
    if depth_of_field is not None:
        return dict.fromkeys(MORE, STRONG_BY_OPTICS)
    steep = rules.steep - EASIER * math.log2(max(lone / rules.few, 1.0))
    return {times: max(steep + more, EASIEST) for times, more in MORE.items()}


def _relative(heights: npt.NDArray[Any]) -> Heights:
    """Heights above a middle one: in float32 nothing is to be lost to an offset."""
    if heights.dtype == np.float32:
        return np.ascontiguousarray(heights)
    sample = heights[np.isfinite(heights)]
    with np.errstate(over='ignore'):
        relative = heights - np.median(sample[:: max(1, sample.size // 10_000)])
    clipped: Heights = np.clip(relative, -_FURTHEST, _FURTHEST).astype(np.float32)
    return clipped


class _Clock:
    def __init__(self) -> None:
        self.times: dict[str, float] = {}
        self._since = time.perf_counter()

    def step(self, name: str) -> None:
        now = time.perf_counter()
        self.times[name] = self.times.get(name, 0.0) + now - self._since
        self._since = now


@kernel
def _halved(heights: Any) -> Any:
    """Half the rows and columns: of four points the mean of the middle two, of fewer the mean; NaN of none."""
    height, width = heights.shape
    half = np.empty((height // 2, width // 2), np.float32)
    for row in range(height // 2):
        for column in range(width // 2):
            low, high = np.float32(np.inf), np.float32(-np.inf)
            total, count = np.float32(0), 0
            for y in range(2 * row, 2 * row + 2):
                for x in range(2 * column, 2 * column + 2):
                    value = heights[y, x]
                    if not np.isnan(value):
                        low, high = min(low, value), max(high, value)
                        total += value
                        count += 1
            if count > 2:
                total -= low + high
                count -= 2
            half[row, column] = total / count if count else np.nan
    return half


@kernel
def _spread_out(spots: Any, times: int, found: Any) -> None:
    """Mark all points of the cloud that a point seen from further off stands for."""
    for row in range(spots.shape[0]):
        for column in range(spots.shape[1]):
            if spots[row, column]:
                found[row * times : (row + 1) * times, column * times : (column + 1) * times] = True


@kernel
def _raise_score(far: Any, times: int, score: Any) -> None:
    for row in range(far.shape[0]):
        for column in range(far.shape[1]):
            value = far[row, column]
            if value > 0:
                for y in range(row * times, (row + 1) * times):
                    for x in range(column * times, (column + 1) * times):
                        score[y, x] = max(score[y, x], value)


@kernel
def _settle(score: Any, found: Any, measured: Any) -> None:
    """Above a half for outliers and for nobody else."""
    height, width = score.shape
    for row in range(height):
        for column in range(width):
            if not measured[row, column]:
                score[row, column] = np.nan
            elif found[row, column]:
                sure = max(score[row, column], np.float32(0.1))
                score[row, column] = np.float32(0.5) + min(sure, np.float32(1)) / 2
            else:
                score[row, column] = min(score[row, column], np.float32(1)) / 2
