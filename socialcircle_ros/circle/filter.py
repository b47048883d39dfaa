# SPDX-License-Identifier: Apache-2.0
"""The filter (section 3.2), composed of its three steps: seed, radius, expansion."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from socialcircle_ros.arguments import settings_or_default
from socialcircle_ros.cloud import Cloud, Mask, PitchLike, measured_only, measured_points, organized_from
from socialcircle_ros.digits import size_text
from socialcircle_ros.errors import CloudError, NoSeedError, SocialCircleError, install_command
from socialcircle_ros.kernels.stopwatch import Stopwatch
from socialcircle_ros.settings import CircleSettings

from .adaptive import (
    TOUCH,
    LessonJudge,
    find_outliers,
    find_probable_outliers,
    outliers_with_few_neighbours,
    unlike,
)
from .doubts import (
    doubts_of,
    kept_islands,
    notes_of_removed_islands,
    removed_islands,
    single_steps,
    texture_doubts,
    unknown_texture,
)
from .expansion import divide
from .not_measured import recognise
from .radius import circle_limit
from .region import NOTHING_MEASURED
from .seed import elect_seed

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False, repr=False)
class CircleResult:
    """What the filter found. Each mask is (H, W) bool.

    A point that is not measured is neither an inlier nor an outlier.
    """

    inliers: Mask
    outliers: Mask
    seed: tuple[int, int]
    """Row and column of the initial point; in the adaptive mode of the kept point nearest to the middle."""
    radius: float
    """Radius in force, in the unit of the cloud. In the adaptive mode, the difference in height within which
    neighbours are linked where the surface has its mean roughness."""
    times_ms: dict[str, float]
    """Time of each step in ms, in the order of the steps."""
    score: npt.NDArray[np.float32] | None = None
    """Outlier score, (H, W), 0 to 1: above 0.5 for outliers, NaN where not measured. None in the paper's mode."""
    warnings: tuple[str, ...] = ()
    """What the method could not decide, what it did, and which settings have no effect."""
    notes: tuple[str, ...] = ()
    """What was done before the method: which points count as not measured. And single islands that were removed,
    though the network takes them for parts of the surface."""

    def __repr__(self) -> str:
        """The counts, the seed and the radius."""
        kept, removed = np.count_nonzero(self.inliers), np.count_nonzero(self.outliers)
        rows, columns = self.inliers.shape
        return (
            f'CircleResult({size_text(rows, columns)}: {kept} kept, {removed} outliers,'
            f' {rows * columns - kept - removed} not measured; seed {self.seed}, radius {self.radius:.4g})'
        )

    def plot(self) -> 'Figure':
        """Draw which points were kept, removed and not measured; in a notebook, the figure is shown.

        Raises:
            SocialCircleError: matplotlib is not installed.
        """
        try:
            from matplotlib.colors import ListedColormap  # noqa: PLC0415 - an extra
            from matplotlib.figure import Figure  # noqa: PLC0415
            from matplotlib.patches import Patch  # noqa: PLC0415
        except ImportError:
            raise SocialCircleError(f'Pictures need matplotlib: {install_command("pictures")}.') from None
        classes = {'not measured': '#c8c8c8', 'kept': '#4f6d8f', 'outlier': '#e8590c'}
        figure = Figure(figsize=(7, 5), layout='constrained')
        axes = figure.subplots()
        axes.imshow(
            self.inliers + np.uint8(2) * self.outliers, ListedColormap(list(classes.values())), vmin=0, vmax=2
        )
        axes.set(xlabel='column', ylabel='row', title=repr(self).partition(': ')[2].partition(';')[0])
        handles = [Patch(color=colour, label=name) for name, colour in classes.items()]
        axes.legend(handles=handles, loc='upper center', bbox_to_anchor=(0.5, -0.12), ncol=3)  # matplotlib 3.6
        return figure


def remove_outliers(
    xyz: npt.ArrayLike, settings: CircleSettings | None = None, *, pitch: PitchLike | None = None
) -> CircleResult:
    """Separate the outliers of an organized cloud from its surface. The cloud is not changed.

    Args:
        xyz: (H, W, 3) float32 or float64; rows are y, columns are x. A point with a NaN or an infinite
            coordinate is not measured.
            Or heights (H, W), with `pitch`. What a masked array masks is not measured.
        settings: the method's parameters; None: the defaults of `CircleSettings`.
        pitch: (dx, dy) of heights (H, W), in their unit. A cloud has none, an xarray DataArray may have its own.

    Returns:
        The masks, the seed and the radius.

    Raises:
        CloudError: `xyz` is neither an organized cloud nor heights with a pitch, of float32 or float64.
        NoSeedError: no point is measured in the vote region, or in the cloud.
        NoRadiusError: no point is measured on the ring round the seed.
        SettingError: the settings are not `CircleSettings`.

    Example:
        >>> import numpy as np
        >>> from socialcircle_ros import remove_outliers
        >>> y, x = np.mgrid[:70, :80].astype(np.float32)
        >>> z = np.zeros_like(x)
        >>> z[20, 30] = 9.0
        >>> result = remove_outliers(np.dstack([x, y, z]))
        >>> np.argwhere(result.outliers).tolist()
        [[20, 30]]
    """
    settings = settings_or_default(CircleSettings, settings)
    cloud = organized_from(xyz, pitch)
    unmeasured = recognise(cloud, settings.not_measured)
    if unmeasured.points is not None:
        cloud = measured_only(cloud, ~unmeasured.points)
    remove = _remove_adaptively if settings.mode == 'adaptive' else _remove_as_in_the_paper
    try:
        result = remove(cloud, settings)
    except CloudError as refusal:
        if not unmeasured.note:
            raise
        # Points that only count as not measured may be what the method lacks.
        raise type(refusal)(f'{refusal} {unmeasured.note}') from None
    notes = (unmeasured.note,) if unmeasured.note else ()
    unclear = (unmeasured.doubt,) if unmeasured.doubt else ()
    kept, removed = int(np.count_nonzero(result.inliers)), int(np.count_nonzero(result.outliers))
    doubts = doubts_of(cloud[..., 2], kept, removed, result.radius, settings)
    return replace(result, notes=(*notes, *result.notes), warnings=(*unclear, *doubts, *result.warnings))


def _remove_as_in_the_paper(cloud: Cloud, settings: CircleSettings) -> CircleResult:
    """Separate the outliers as in section 3.2 of the paper."""
    stopwatch = Stopwatch()
    seed = elect_seed(cloud, settings.vote_region)
    stopwatch.lap('vote')
    limit = circle_limit(cloud, seed, settings.window, settings.radius, settings.radius_scale)
    stopwatch.lap('radius')
    inliers, outliers = divide(cloud, seed, limit, settings.window)
    stopwatch.lap('expansion')
    return CircleResult(
        inliers=inliers,
        outliers=outliers,
        seed=seed,
        radius=float(np.sqrt(limit)),
        times_ms=stopwatch.times_ms,
    )


def _remove_adaptively(cloud: Cloud, settings: CircleSettings) -> CircleResult:
    """Separate the outliers in the adaptive mode: the surface's own spread, and many communities."""
    measured = measured_points(cloud)
    if not measured.any():
        raise NoSeedError(NOTHING_MEASURED)
    lesson = settings.taught
    judge = None if lesson is None else LessonJudge(lesson)
    heights = np.where(measured, cloud[..., 2], np.nan)
    warnings = []
    if settings.finds_by == 'network':
        from .network import packaged_network  # noqa: PLC0415 - slow to load

        found = find_probable_outliers(heights, packaged_network(settings.provider).probabilities, judge)
        if lesson is None:
            warnings = unknown_texture(found.sureness, int(np.count_nonzero(found.outliers)))
    else:
        found = find_outliers(heights, settings.depth_of_field, judge=judge)
        if lesson is None and settings.depth_of_field is None and found.outliers.any():
            warnings = texture_doubts(found.nearly)
    if lesson is not None:
        warnings = unlike(lesson, found.spread)
    stopwatch = Stopwatch()
    sparse = outliers_with_few_neighbours(heights)
    if sparse.any():
        found = replace(
            found, outliers=found.outliers | sparse, score=np.where(sparse, np.float32(1), found.score)
        )
    stopwatch.lap('few_neighbours')
    inliers = measured & ~found.outliers
    if lesson is None and settings.depth_of_field is None:
        warnings += single_steps(heights, found.outliers)
    warnings += kept_islands(found.islands_kept, narrowly=found.kept_narrowly)
    warnings += removed_islands(found.alike, found.taken_for_parts)
    return CircleResult(
        inliers=inliers,
        outliers=found.outliers,
        seed=_nearest_to_middle(inliers if inliers.any() else measured),
        radius=TOUCH * found.spread,
        times_ms=found.times_ms | stopwatch.times_ms,
        score=found.score,
        warnings=tuple(warnings),
        notes=tuple(notes_of_removed_islands(found.alike, found.taken_for_parts)),
    )


def _nearest_to_middle(points: Mask) -> tuple[int, int]:
    """Return row and column of the point nearest to the middle of the cloud."""
    rows, columns = np.nonzero(points)
    height, width = points.shape
    nearest = int(np.argmin((rows - height // 2) ** 2 + (columns - width // 2) ** 2))
    return int(rows[nearest]), int(columns[nearest])
