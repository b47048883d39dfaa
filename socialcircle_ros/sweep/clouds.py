# SPDX-License-Identifier: Apache-2.0
"""The clouds of a sweep, each with the outliers that a setting should remove."""

import threading
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from socialcircle_ros.baselines import median_filter
from socialcircle_ros.baselines.settings import MedianSettings
from socialcircle_ros.circle.not_measured import AUTO, without_marks
from socialcircle_ros.cloud import Cloud, Mask, measured_points
from socialcircle_ros.errors import RecordingError, SocialCircleError
from socialcircle_ros.kernels.ordered import in_order
from socialcircle_ros.messages.point_cloud import PointCloud
from socialcircle_ros.pipeline.stacks import Refusal
from socialcircle_ros.recording import open_recording
from socialcircle_ros.recording.named_clouds import NamedCloud, not_refused, spread_clouds
from socialcircle_ros.recording.truth import truths_of
from socialcircle_ros.settings import FocusSettings, PipelineSettings, RosValue

CRITERION = (
    'A point should be removed if its height differs from the median of its {window}×{window} window by more than'
    ' {sigmas:g} robust standard deviations. One robust standard deviation is 1.4826 times the median of these'
    ' differences over the cloud.'
).format(**asdict(MedianSettings()))
"""The criterion that takes the place of the truth where a recording holds none, in words."""


@dataclass(frozen=True, eq=False)
class SweepCloud:
    """One cloud of a sweep.

    Attributes:
        name: topic and number of the cloud, such as `/points 3`.
        points: the serialized PointCloud2.
        outlier: (H, W) the points that should be removed, by the truth or by `CRITERION`.
        counted: (H, W) the points with a certain truth; by `CRITERION`, the measured points.
        has_truth: whether `outlier` is the truth.
        depth_of_field: depth of field of a cloud from a stack, in the unit of the cloud; None if not known.
        unit: of the cloud; None if not known.
        not_measured: which points are not measured, as `circle.not_measured`.
    """

    name: str
    points: bytes
    outlier: Mask
    counted: Mask
    has_truth: bool
    depth_of_field: float | None = None
    unit: str | None = None
    not_measured: str = AUTO

    @property
    def xyz(self) -> Cloud:
        """The coordinates, (H, W, 3), NaN where not measured."""
        return without_marks(PointCloud.decode(self.points).xyz(), self.not_measured)


def sweep_cloud(
    name: str,
    points: bytes,
    truth: tuple[Mask, Mask] | None,
    depth_of_field: float | None = None,
    unit: str | None = None,
    not_measured: str = AUTO,
) -> SweepCloud:
    """Make a cloud of a sweep, with `CRITERION` where the truth is not known.

    Args:
        name: topic and number of the cloud.
        points: the serialized PointCloud2.
        truth: (H, W) the outliers, and (H, W) the points with a certain truth; None where not known.
        depth_of_field: depth of field of a cloud from a stack, in the unit of the cloud.
        unit: of the cloud; None if not known.
        not_measured: as in `SweepCloud`.

    Raises:
        MessageError: the message is not an organized cloud.
    """
    has_truth = truth is not None
    if truth is None:
        xyz = without_marks(PointCloud.decode(points).xyz(), not_measured)
        truth = median_filter(xyz).outliers, measured_points(xyz)
    return SweepCloud(name, points, *truth, has_truth, depth_of_field, unit, not_measured)


CloudSource = Callable[[FocusSettings], Sequence[SweepCloud]]
"""Gives the clouds of a sweep for the focus settings with which stacks become clouds."""


class SweptRecording:
    """The clouds of a recording that a sweep filters; a `CloudSource` is its `load`.

    Args:
        recording: an MCAP file or a rosbag2 directory.
        parameters: parameters that are not varied, by their full names.
        topics: names of the topics of clouds; empty: all topics named `points`, and all focus stacks.
        max_clouds: most clouds to load, spread evenly over the recording.

    Attributes:
        refused: number of refused clouds and frames of the last `load`, by reason.
        damage: where the recording is damaged; None if it is intact.
    """

    def __init__(
        self, recording: Path, parameters: Mapping[str, RosValue], topics: tuple[str, ...], max_clouds: int
    ) -> None:
        self.refused: Counter[str] = Counter()
        self.damage: str | None = None
        self._recording, self._parameters = recording, dict(parameters)
        self._topics, self._max_clouds = topics, max_clouds

    def load(self, focus: FocusSettings) -> Sequence[SweepCloud]:
        """Read the clouds; stacks become clouds with `focus`.

        Returns:
            The clouds with a truth if there are any, otherwise all clouds, so that one score holds for all.

        Raises:
            RecordingError: the recording cannot be read, or it has no usable cloud.
        """
        self.refused.clear()
        settings = PipelineSettings.from_ros(self._parameters | focus.to_ros())
        with open_recording(self._recording) as reader:
            truths = truths_of(reader)
            chosen = spread_clouds(reader, settings, self._max_clouds, self.refused, topics=self._topics)
            self.damage = reader.damage

        def with_truth(item: tuple[NamedCloud, str | None]) -> SweepCloud | Refusal:
            (name, cloud), unit = item
            try:
                truth = truths(cloud.namespace, cloud.points)
                masks = None if truth is None else (truth.outlier, truth.counted)
                rule = settings.circle.not_measured
                return sweep_cloud(name, cloud.points, masks, cloud.depth_of_field, unit, rule)
            except SocialCircleError as error:
                return Refusal(str(error))

        clouds = list(not_refused(in_order(with_truth, chosen), self.refused))
        if not clouds:
            reasons = (
                ' '.join([*self.refused, *([self.damage] if self.damage else [])]) or 'Its topics hold no message.'
            )
            raise RecordingError(f'{self._recording} has no cloud that can be filtered. {reasons}')
        return [cloud for cloud in clouds if cloud.has_truth] or clouds


def cached(load: CloudSource) -> CloudSource:
    """Keep the clouds of the last two focus settings in memory. Threads may call the result at the same time."""
    lock = threading.Lock()
    kept: dict[FocusSettings, Sequence[SweepCloud]] = {}

    def clouds(focus: FocusSettings) -> Sequence[SweepCloud]:
        with lock:
            if focus not in kept:
                while len(kept) > 1:
                    del kept[next(iter(kept))]
                kept[focus] = load(focus)
            return kept[focus]

    return clouds
