# SPDX-License-Identifier: Apache-2.0
"""What a result says of itself: settings without effect, a circle that is too large, and too many outliers."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import HeightMap, Mask
from socialcircle_ros.settings import CircleSettings

from .adaptive import MANY_UNDECIDED, Islands, Sureness

_TOO_MANY = 0.3
"""Share of outliers above which the adaptive mode warns: in tests it then took good points for outliers."""
_RICH_TEXTURE = 0.04
"""Share of the points in shapes that are nearly islands above which the rules warn. Of 41 measured surfaces 15
lose more than 0.5 % of their good points; 14 of these are above, and no other."""
_ONE_STEP, _OFF_A_STEP, _AT_REST = 0.7, 0.01, 0.9
"""Single outliers may be noise of stored steps if this share of them differ from their neighbours by one height,
within this share of it, and this share of the other points do not differ at all, but for a form."""
_FEWEST_STEPS, _SHARE_OF_STEPS = 30, 2e-3
"""Fewer single outliers than so many, or than this share of the points, do no harm."""
_SAMPLED_OUTLIERS = 4096
_ROUNDINGS = 4.0
"""A second difference is the sum of four heights, each rounded to float32."""
_MANY_PARTS = 3
"""Number of removed islands that the network takes for parts of the surface from which the result warns: fewer may
well be dirt."""
_IF_PARTS = 'if they are parts of the surface, teach it with `socialcircle teach`'
_FAR_TOO_LARGE = 10.0
"""A circle of more than this many median differences is far larger than the roughness: in the adaptive mode it is
about 5 of them."""
_FAR_TOO_DEEP = 10.0
"""A depth of field of more than this many ranges of all heights is probably in another unit."""
_HARDLY_ANY = 1e-3
"""Share of neighbours that may differ by more than the circle where hardly a point can be an outlier."""
_SAMPLED_ROWS = 64
_ROWS = 256
"""Rows that are compared at once, so that memory does not grow with the cloud."""


class _LargeCircle(NamedTuple):
    """A radius that is far larger than the differences in height between neighbours in a row or column.

    Attributes:
        differences: their number.
        beyond: number of those that the radius does not exceed.
        ratio: the radius relative to their median; inf where that is 0.
    """

    differences: int
    beyond: int
    ratio: float


def doubts_of(
    heights: HeightMap, kept: int, removed: int, radius: float, settings: CircleSettings
) -> tuple[str, ...]:
    """Say what may be wrong with a result, in sentences.

    Args:
        heights: (H, W), NaN or infinite where not measured.
        kept: number of inliers.
        removed: number of outliers.
        radius: in force, in the unit of the heights.
        settings: in force.
    """
    adaptive = settings.mode == 'adaptive'
    doubts = [
        f'{name} has no effect in the adaptive mode; set circle.mode to paper to use it.'
        for name in settings.without_effect()
    ]
    if adaptive and _by_network_lesson(settings):
        doubts += _without_effect_on_a_lesson(settings)
    if removed > kept:
        doubts.append(
            'the outliers are more than half of the points: '
            + (
                'they may be the surface; look at the mask.'
                if adaptive
                else 'the circle may have stayed on one part of the surface; raise circle.radius_scale, or move'
                ' circle.vote_region to the surface.'
            )
        )
    if adaptive and removed > _TOO_MANY * (kept + removed):
        share = 100 * removed / (kept + removed)
        doubts.append(f'{share:.0f} % of the points were removed; good points may be among so many.')
    if adaptive and removed == 0 and settings.depth_of_field and not _by_network_lesson(settings):
        doubts += _too_deep(heights, settings.depth_of_field)
    found = _large_circle(heights, radius) if removed == 0 else None
    if found is not None and adaptive and found.beyond == 0:
        doubts.append(
            'the heights are stored in steps so coarse that neighbours differ by few of them: an outlier of this'
            ' height cannot be told from noise.'
        )
    elif found is not None and not adaptive:
        doubts.append(_too_large(found))
    return tuple(doubts)


def _by_network_lesson(settings: CircleSettings) -> bool:
    """Whether a lesson on what the network finds decides, which uses no depth of field."""
    return settings.taught is not None and settings.taught.judge == 'network'


def _too_deep(heights: HeightMap, depth_of_field: float) -> list[str]:
    """Warn of a depth of field in another unit than the heights: islands lower than a third of it are kept.

    The heights of a clean plane from a stack may all lie within its depth of field.
    """
    known = heights[np.isfinite(heights)]
    span = float(known.max() - known.min()) if known.size else 0.0
    if not 0 < _FAR_TOO_DEEP * span < depth_of_field:
        return []
    times = f'{depth_of_field / span:.3g} times the range of all heights'
    unit = 'circle.depth_of_field is in the unit of the cloud'
    return [f'no point can be an outlier: the depth of field, {depth_of_field:g}, is {times}; {unit}.']


def _without_effect_on_a_lesson(settings: CircleSettings) -> list[str]:
    """Warn of settings that a lesson on what the network finds does not use."""
    doubts = []
    if settings.judge == 'rules':
        doubts.append('circle.judge has no effect: circle.lesson was taught with the network, which it uses.')
    if settings.depth_of_field is not None:
        doubts.append(
            'the depth of field has no effect: circle.lesson was taught on clouds without one; teach on stacks to'
            ' use it.'
        )
    return doubts


def texture_doubts(nearly: float) -> list[str]:
    """Warn of a texture that the rules of the adaptive mode can hardly tell from outliers.

    Args:
        nearly: as in `AdaptiveResult`.
    """
    if nearly <= _RICH_TEXTURE:
        return []
    shapes = f'{100 * nearly:.0f} % of the points belong to shapes that are nearly as steep as outliers'
    cure = 'teach this texture with `socialcircle teach`, or set circle.judge to network'
    return [f'{shapes}: good points may be among the removed ones; {cure}.']


def unknown_texture(sureness: Sequence[Sureness], removed: int) -> list[str]:
    """Warn of a surface that the network can hardly tell from outliers: it is unlike those that it was trained on.

    What became of the undecided points does not matter: where it removes most of them, that is as doubtful.

    Args:
        sureness: as `AdaptiveResult.sureness`. Single outliers raise the share of certain points, but not that of
            those in sets.
        removed: number of outliers.
    """
    risk = 'outliers may have stayed' + (', and good points may be among the removed ones' if removed else '')
    for (undecided, certain), points in zip(
        sureness, ('the points', 'the points, single ones aside'), strict=False
    ):
        if undecided > max(MANY_UNDECIDED, certain):
            share = f'the network is undecided about {100 * undecided:.1f} % of {points}'
            sure = f'more than the {100 * certain:.1f} % that surely are outliers'
            return [f'{share}, {sure}: {risk}; teach this texture with `socialcircle teach`.']
    return []


def kept_islands(number: int, *, narrowly: bool) -> list[str]:
    """Warn of islands of one height that were kept: outliers may be among them.

    Args:
        number: as `AdaptiveResult.islands_kept`.
        narrowly: as `AdaptiveResult.kept_narrowly`.
    """
    if not number:
        return []
    how = ', narrowly: with a few points more or less they would have been removed' if narrowly else ''
    kept = f'{number} islands of one height were kept as the texture of the surface{how}'
    return [f'{kept}; this mode cannot tell such islands from outliers.']


def removed_islands(alike: Islands, taken_for_parts: Islands) -> list[str]:
    """Warn of removed islands that may be parts of the surface.

    Args:
        alike: as in `AdaptiveResult`.
        taken_for_parts: as in `AdaptiveResult`.
    """
    if alike.number:
        return [f'{_counted(alike)} of one height were removed; {_IF_PARTS}.']
    if taken_for_parts.number >= _MANY_PARTS:
        found = f'{_counted(taken_for_parts)} far off a plain surface were removed'
        return [f'{found}, though the network takes them for parts of it; {_IF_PARTS}.']
    return []


def notes_of_removed_islands(alike: Islands, taken_for_parts: Islands) -> list[str]:
    """Note removed islands that may be parts of the surface, where they are too few for a warning.

    Args:
        alike: as in `AdaptiveResult`.
        taken_for_parts: as in `AdaptiveResult`.
    """
    if alike.number or not 0 < taken_for_parts.number < _MANY_PARTS:
        return []
    verb = 'was' if taken_for_parts.number == 1 else 'were'
    what = 'it' if taken_for_parts.number == 1 else 'them'
    part = 'a part' if taken_for_parts.number == 1 else 'parts'
    found = f'{_counted(taken_for_parts)} far off a plain surface {verb} removed'
    return [f'{found}, though the network takes {what} for {part} of it; {_IF_PARTS}.']


def _counted(islands: Islands) -> str:
    if islands.number == 1:
        return f'1 island of {islands.points} points'
    return f'{islands.number} islands ({islands.points} points, the largest has {islands.largest})'


def single_steps(heights: HeightMap, outliers: Mask) -> list[str]:
    """Warn where single outliers may be noise of stored steps: they differ by one height, and the rest by none.

    Args:
        heights: (H, W), NaN where not measured.
        outliers: (H, W) bool.
    """
    height, width = heights.shape
    found = np.flatnonzero(outliers)
    if found.size < max(_FEWEST_STEPS, _SHARE_OF_STEPS * heights.size) or width < 3:
        return []
    rows, columns = np.divmod(found[:: max(1, found.size // _SAMPLED_OUTLIERS)], width)
    columns = np.clip(columns, 1, width - 2)
    alone = outliers[rows, columns] & ~(outliers[rows, columns - 1] | outliers[rows, columns + 1])
    rows, columns = rows[alone], columns[alone]
    left, here, right = (heights[rows, columns + shift].astype(np.float64) for shift in (-1, 0, 1))
    rises = np.abs(here - (left + right) / 2)
    rises = rises[np.isfinite(rises)]
    if rises.size < _FEWEST_STEPS:
        return []
    step = float(np.partition(rises, rises.size // 2)[rises.size // 2])
    if np.count_nonzero(np.abs(rises - step) <= _OFF_A_STEP * step) < _ONE_STEP * rises.size:
        return []
    lines = slice(None, None, max(1, height // _SAMPLED_ROWS))
    if not _is_at_rest(np.where(outliers[lines], np.nan, heights[lines])):
        return []
    differ = (
        f'most single outliers differ from their neighbours by one height, {step:.3g} in the unit of the cloud'
    )
    risk = 'and the other points hardly at all: if heights are stored in such steps, they may be noise'
    return [f'{differ}, {risk}; then teach this surface with `socialcircle teach`.']


def _is_at_rest(lines: HeightMap) -> bool:
    """Whether hardly a height of some rows differs from those beside it, but for a form and rounding."""
    curves = np.diff(lines.astype(np.float64), 2, axis=1)
    curves = curves[np.isfinite(curves)]
    if not curves.size:
        return False
    sizes = np.abs(lines - np.nanmedian(lines))
    rounding = _ROUNDINGS * float(np.spacing(np.nanquantile(sizes, _AT_REST).astype(np.float32)))
    middle = np.partition(curves, curves.size // 2)[curves.size // 2]
    return bool(np.count_nonzero(np.abs(curves - middle) <= rounding) >= _AT_REST * curves.size)


def _too_large(found: _LargeCircle) -> str:
    number, differences = 'no', 'every height difference'
    if found.beyond:
        number, differences = 'hardly a', f'all but {found.beyond} of the {found.differences} height differences'
    median = 'most of these are 0' if math.isinf(found.ratio) else f'their median {found.ratio:.0f} times'
    return (
        f'{number} point can be an outlier: the circle exceeds {differences} between'
        f' neighbours, and {median}; set circle.mode to adaptive, or lower circle.radius_scale.'
    )


def _large_circle(heights: HeightMap, radius: float) -> _LargeCircle | None:
    """Compare the radius with the differences between neighbours; None unless it is far too large for them."""
    stride = max(1, len(heights) // _SAMPLED_ROWS)
    sample = _differences(heights[::stride], 1)
    median = float(np.median(sample)) if sample.size else math.inf
    if not radius > _FAR_TOO_LARGE * median:
        return None
    number, beyond, largest = 0, 0, 0.0
    for row in range(0, len(heights), _ROWS):
        for between in (
            _differences(heights[row : row + _ROWS], 1),
            _differences(heights[row : row + _ROWS + 1], 0),
        ):
            number += between.size
            beyond += int(np.count_nonzero(between > radius))
            largest = max(largest, float(between.max(initial=0)))
    # A plane has no difference that could tell how large the circle should be.
    if largest == 0 or beyond > _HARDLY_ANY * number:
        return None
    return _LargeCircle(number, beyond, radius / median if median else math.inf)


def _differences(heights: HeightMap, axis: int) -> npt.NDArray[np.floating]:
    """The absolute differences between measured neighbours along an axis, (n,)."""
    with np.errstate(invalid='ignore', over='ignore'):
        between = np.abs(np.diff(heights, axis=axis))
    known: npt.NDArray[np.floating] = between[np.isfinite(between)]
    return known
