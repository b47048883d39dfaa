# SPDX-License-Identifier: Apache-2.0
"""The good clouds, and the fields of them: those to teach on, and those kept back for the check."""

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from socialcircle_ros.arguments import OneOrSeveral, settings_of, several
from socialcircle_ros.circle.adaptive.heights import RelativeHeights, relative_heights
from socialcircle_ros.circle.not_measured import without_marks
from socialcircle_ros.cloud import Cloud, Floats, Mask, measured_points
from socialcircle_ros.errors import CloudError, SocialCircleError
from socialcircle_ros.kernels.order_statistics import MAD_TO_SIGMA
from socialcircle_ros.messages.point_cloud import PointCloud
from socialcircle_ros.recording import open_recording
from socialcircle_ros.recording.named_clouds import spread_clouds
from socialcircle_ros.settings import PipelineSettings

from .residuals import beside_edges, residuals

LEAST_POINTS = 10_000
"""Measured points that all good clouds must have together: fewer show too little of a texture."""

_NOISE_WINDOW, _SPIKE_WINDOW = 5, 13
"""Sides of the median windows: residuals to the first give the noise, residuals to the second the spikes."""
_SPIKE_STRIDE = 2
"""Every other row and column of the large window is enough. The point itself must be in one of them, or the window
beside a step has as many points on the other side."""
_SPIKE = 10.0
"""A point further than this from the median of the spike window stands out, in robust σ of such residuals."""
_MOST_SPIKES = 0.001
"""Share of the points up to which those that stand out are suspects; more of them are the texture of the part."""
_LONG = 400
"""Points along the longer side from which a cloud is cut into four fields instead of two."""


@dataclass(frozen=True, eq=False)
class GoodCloud:
    """A cloud of a good part.

    Attributes:
        name: file, topic and number.
        points: (H, W, 3), NaN where not measured.
        depth_of_field: of a cloud that was a stack, in the unit of the cloud; None for other clouds.
        unit: of the coordinates; None: not known.
    """

    name: str
    points: Cloud
    depth_of_field: float | None = None
    unit: str | None = None


@dataclass(frozen=True, eq=False)
class GoodField:
    """A good cloud, or a part of one.

    Attributes:
        cloud: the cloud or the part of one.
        heights: (H, W), NaN where not measured.
        noise: robust σ of the residuals to a 5×5 median along the local slope, in the unit of the cloud; above 0.
        stands_out: (H, W) bool, points far off their surroundings.
        suspects: (H, W) bool, those that stand out so rarely that they may be outliers themselves.
        edges: (H, W) bool, points near the highest steps and beside holes.
    """

    cloud: GoodCloud
    heights: Floats
    noise: float
    stands_out: Mask
    suspects: Mask
    edges: Mask

    @property
    def name(self) -> str:
        """Name of the cloud, with the number of the part."""
        return self.cloud.name


def read_good_clouds(
    files: OneOrSeveral[str | Path],
    settings: PipelineSettings,
    *,
    topics: OneOrSeveral[str] = (),
    most: int = 8,
    progress: Callable[[str], None] = lambda text: None,
) -> tuple[list[GoodCloud], Counter[str], list[str]]:
    """Read the clouds of recordings and measurement files; stacks become clouds.

    Args:
        files: recordings or measurement files of good parts.
        settings: how stacks become clouds, and which points count as not measured.
        topics: topics of clouds; none: all topics named `points`, and all stacks.
        most: clouds to use of each file, spread evenly.
        progress: called with what is read.

    Returns:
        The clouds, the number of refused ones by reason, and a sentence for each recording that is damaged.

    Raises:
        RecordingError: a file cannot be read, or it has no cloud.
        CloudError: no cloud of the files can be used.
    """
    settings_of(PipelineSettings, settings)
    refused: Counter[str] = Counter()
    clouds, damage = [], []
    for path in map(Path, several(files)):
        progress(f'reading {path.name}')
        with open_recording(path) as reader:
            chosen = spread_clouds(reader, settings, most, refused, topics=topics)
            damage += [reader.damage] if reader.damage else []
        for (name, cloud), unit in chosen:
            depth = settings.circle.depth_of_field or cloud.depth_of_field
            title = f'{path.name} {name}'
            try:
                good = good_cloud(title, cloud.points, settings.circle.not_measured, depth, unit)
            except SocialCircleError as error:
                refused[str(error)] += 1
                continue
            clouds.append(good)
    if not clouds:
        raise CloudError(f'There is no cloud to teach on. {" ".join([*refused, *damage])}'.strip())
    return clouds, refused, damage


def good_cloud(
    name: str, message: bytes, not_measured: str, depth_of_field: float | None, unit: str | None
) -> GoodCloud:
    """A cloud of a good part from its message.

    Args:
        name: of the cloud.
        message: the PointCloud2, serialized.
        not_measured: which points are not measured, as `circle.not_measured`.
        depth_of_field: of a cloud that was a stack, in the unit of the cloud.
        unit: of the coordinates; None: not known.

    Raises:
        MessageError: the message is no organized cloud.
    """
    xyz = without_marks(PointCloud.decode(message).xyz(), not_measured)
    return GoodCloud(name, xyz, depth_of_field, unit)


def good_fields(clouds: Sequence[GoodCloud]) -> tuple[list[GoodField], list[GoodField]]:
    """The fields to teach on, and those kept back for the check.

    Of several clouds every second one is kept back. One cloud is cut into strips along its longer side, of which
    every second one is kept back.

    Raises:
        CloudError: the clouds have too few measured points.
    """
    parts = list(clouds)
    if len(clouds) == 1:
        parts = list(_strips(clouds[0]))
    fields = _without_texture([_field(part) for part in parts])
    for kept_back, group in enumerate((fields[::2], fields[1::2])):
        measured = sum(int(np.isfinite(field.heights).sum()) for field in group)
        if measured < LEAST_POINTS // 2:
            what = 'to check on' if kept_back else 'to teach on'
            raise CloudError(
                f'The good clouds have {measured} measured points {what}, and a lesson needs at least'
                f' {LEAST_POINTS // 2}: give larger clouds, or more of them.'
            )
    return fields[::2], fields[1::2]


def _strips(cloud: GoodCloud) -> Iterator[GoodCloud]:
    """Parts of a cloud along its longer side."""
    height, width = cloud.points.shape[:2]
    number = 4 if max(height, width) >= _LONG else 2
    for place in range(number):
        rows, columns = slice(None), slice(None)
        if width > height:
            columns = slice(width * place // number, width * (place + 1) // number)
        else:
            rows = slice(height * place // number, height * (place + 1) // number)
        name = f'{cloud.name}, part {place + 1} of {number}'
        yield GoodCloud(name, cloud.points[rows, columns].copy(), cloud.depth_of_field, cloud.unit)


def _field(cloud: GoodCloud) -> GoodField:
    """A cloud as a field; all points that stand out are suspects."""
    measured = measured_points(cloud.points)
    heights = cloud.points[..., 2].copy()
    heights[~measured] = np.nan
    relative: RelativeHeights = np.full(heights.shape, np.nan, np.float32)
    exponent = 0
    if measured.any():
        relative, exponent = relative_heights(heights)
    fine, coarse = residuals(relative, _NOISE_WINDOW), residuals(relative, _SPIKE_WINDOW, _SPIKE_STRIDE)
    spikes: Mask = measured & (coarse > _SPIKE * _robust(coarse[measured]))
    noise = math.ldexp(_robust(fine[measured]), exponent)
    return GoodField(cloud, heights, noise, spikes, spikes, beside_edges(relative))


def _without_texture(fields: list[GoodField]) -> list[GoodField]:
    """The fields without suspects, where so many points stand out that they are the texture of the part."""
    suspects = sum(int(np.count_nonzero(each.suspects)) for each in fields)
    if suspects <= _MOST_SPIKES * sum(int(np.isfinite(each.heights).sum()) for each in fields):
        return fields
    return [replace(each, suspects=np.zeros_like(each.suspects)) for each in fields]


def _robust(residuals: npt.NDArray[np.float32 | np.float64]) -> float:
    """Robust σ of residuals, or their mean where more than half of them are 0; at least the smallest number."""
    if not residuals.size:
        return math.ulp(0.0)
    return float(max(MAD_TO_SIGMA * np.median(residuals) or np.mean(residuals), np.finfo(np.float32).tiny))
