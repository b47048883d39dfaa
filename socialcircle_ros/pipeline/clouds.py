"""One cloud message in, its answers out: the job that the node does live and `socialcircle filter` offline.

Both publish exactly these bytes, so that what a replay shows is what the line did.
"""

import threading
import time
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from socialcircle_ros.circle import CircleResult, remove_outliers
from socialcircle_ros.messages import diagnostics
from socialcircle_ros.messages.image import encode_image, mask_pixels
from socialcircle_ros.messages.point_cloud import PointCloud
from socialcircle_ros.repair import repair_holes
from socialcircle_ros.settings import CircleSettings, OutputSettings, RepairSettings

STATUS_NAME = 'social_circle: measurement'


@dataclass(frozen=True)
class Answers:
    """What is published beside the filtered cloud: serialized messages, and what they say in numbers."""

    mask: bytes | None
    """Image mono8; None where it is not wanted."""
    score: bytes | None
    """Image 32FC1: 0 to 1, above 0.5 for outliers; None where it is not wanted, and from the paper's mode."""
    repaired: bytes | None
    """PointCloud2 as the filtered one, with holes of outliers filled; None where it is not wanted."""
    points: int
    measured: int
    outliers: int
    seed: tuple[int, int]
    radius: float
    times: dict[str, float]
    """Milliseconds that each stage took, in the order of the stages."""
    status: diagnostics.Status
    """The measurement, without times."""

    @property
    def measurement(self) -> diagnostics.Status:
        """What `~/measurement` says: the status and the times."""
        times = {f'time_{stage}_ms': f'{milliseconds:.3f}' for stage, milliseconds in self.times.items()}
        values = {**self.status.values, **times}
        status = self.status
        return diagnostics.Status(status.level, status.name, status.message, status.hardware_id, values)


@dataclass(frozen=True)
class CloudOutputs(Answers):
    """All that is published of one cloud."""

    filtered: bytes
    """PointCloud2 as it came, with x, y and z of the outliers NaN."""


def filter_cloud(
    message: bytes,
    circle: CircleSettings | None = None,
    output: OutputSettings | None = None,
    repair: RepairSettings | None = None,
    depth_of_field: float | None = None,
) -> CloudOutputs:
    """Filter one serialized PointCloud2.

    Args:
        message: the cloud as it came, in CDR.
        circle: how to filter.
        output: what is wanted.
        repair: how holes are filled, where that is wanted.
        depth_of_field: of a cloud that was a stack, in the unit of the cloud; what `circle` says goes first.

    Returns:
        The messages to publish; the same for the same cloud and settings, but for the times.

    Raises:
        MessageError: the message is not an organized cloud, or contradicts itself.
        CloudError: the method can give no answer for this cloud.
    """
    filtering = Filtering(message, circle, depth_of_field)
    filtered = filtering.filtered()
    return CloudOutputs(filtered=filtered, **vars(filtering.answers(output, repair)))


class Filtering:
    """`filter_cloud` step by step, for who cannot wait: the outliers are found, the filtered cloud is next.

    Args:
        message: the cloud as it came, in CDR.
        circle: how to filter.
        depth_of_field: of a cloud that was a stack, in the unit of the cloud; what `circle` says goes first.

    Raises:
        MessageError: the message is not an organized cloud, or contradicts itself.
        CloudError: the method can give no answer for this cloud.
    """

    def __init__(
        self,
        message: bytes | memoryview,
        circle: CircleSettings | None = None,
        depth_of_field: float | None = None,
    ) -> None:
        self._circle = (circle or CircleSettings()).of_a_stack(depth_of_field)
        self._depth_of_field = depth_of_field
        self._clock = _Stages()
        self._cloud = PointCloud.decode(message)
        self._xyz = self._cloud.xyz()
        self._clock.stage('decode')
        self._result = remove_outliers(self._xyz, self._circle)
        for step, seconds in self._result.times.items():
            self._clock.times[step] = 1e3 * seconds
        self._clock.restart()
        self._points = self._cloud.height * self._cloud.width
        self._outliers = int(np.count_nonzero(self._result.outliers))
        self._undo = _change_nothing
        self._undoing = threading.Lock()

    @cached_property
    def _measured(self) -> int:
        return self._outliers + int(np.count_nonzero(self._result.inliers))

    @property
    def _dense(self) -> bool:
        return self._outliers == 0 and self._measured == self._points

    def filtered(self) -> bytes:
        """PointCloud2 as it came, with x, y and z of the outliers NaN."""
        filtered = self._cloud.without(self._result.outliers, dense=self._dense)
        self._clock.stage('cloud')
        return filtered

    def filter_in_place(self) -> None:
        """Make of the message itself, which may be written to, what `filtered` gives: no copy of it is made."""
        self._undo = self._cloud.take_out(self._result.outliers, dense=self._dense)
        self._clock.stage('cloud')

    def put_back(self) -> None:
        """Make the message again what it was when it came; any thread may ask for it, also twice."""
        with self._undoing:
            self._undo()
            self._undo = _change_nothing

    def answers(self, output: OutputSettings | None = None, repair: RepairSettings | None = None) -> Answers:
        """The rest; the message is again what it was where that matters.

        Args:
            output: what is wanted.
            repair: how holes are filled, where that is wanted.
        """
        output = output or OutputSettings()
        header, result, clock = self._cloud.header, self._result, self._clock
        clock.restart()
        mask = encode_image(header, mask_pixels(result.inliers, result.outliers)) if output.mask else None
        score = encode_image(header, result.score) if output.score and result.score is not None else None
        clock.stage('mask')
        repaired, filled = None, 0
        if output.repaired:
            self.put_back()
            repair_result = repair_holes(self._xyz, result.outliers, repair)
            filled = int(np.count_nonzero(repair_result.filled))
            dense = self._measured - self._outliers + filled == self._points
            repaired = self._cloud.replaced(result.outliers, repair_result.xyz, dense=dense)
            clock.stage('repair')
        clock.times['total'] = sum(clock.times.values())
        return Answers(
            mask=mask,
            score=score,
            repaired=repaired,
            points=self._points,
            measured=self._measured,
            outliers=self._outliers,
            seed=result.seed,
            radius=result.radius,
            times=clock.times,
            status=_status(
                self._cloud,
                self._measured,
                self._outliers,
                filled,
                result,
                self._circle,
                self._depth_of_field,
            ),
        )


def _change_nothing() -> None:
    """What undoes nothing."""


class _Stages:
    """Stopwatch over the stages of one cloud."""

    def __init__(self) -> None:
        self.times: dict[str, float] = {}
        self.restart()

    def restart(self) -> None:
        self._since = time.perf_counter()

    def stage(self, name: str) -> None:
        now = time.perf_counter()
        self.times[name] = 1e3 * (now - self._since)
        self._since = now


def _status(
    cloud: PointCloud,
    measured: int,
    outliers: int,
    filled: int,
    result: CircleResult,
    circle: CircleSettings,
    depth_of_field: float | None,
) -> diagnostics.Status:
    """The measurement in words and values.

    Where most of the measured points fell, the seed's surface is likely not the part's: the method cannot
    know, but it must not be silent.
    """
    share = outliers / measured
    message = f'{outliers} of {measured} measured points are outliers ({100 * share:.2f} %).'
    level = diagnostics.OK
    if share > 0.5:
        level = diagnostics.WARN
        message += ' That is more than half: '
        message += (
            'what was removed may be the surface; look at the mask.'
            if circle.mode == 'adaptive'
            else 'the circle may have stayed on an outlier or on one part of the surface;'
            ' raise circle.radius_scale, or move circle.vote_region to the surface.'
        )
    for warning in result.warnings:
        level = diagnostics.WARN
        message += f' {warning[0].upper()}{warning[1:]}'
    values = {
        'stamp': f'{cloud.header.seconds}.{cloud.header.nanoseconds:09d}',
        'points': str(cloud.height * cloud.width),
        'measured': str(measured),
        'kept': str(measured - outliers),
        'outliers': str(outliers),
        'repaired': str(filled),
        'seed_row': str(result.seed[0]),
        'seed_column': str(result.seed[1]),
        'radius': repr(result.radius),
        **({} if depth_of_field is None else {'stack_depth_of_field': repr(depth_of_field)}),
        **{name: str(value) for name, value in circle.to_ros().items()},
    }
    return diagnostics.Status(level, STATUS_NAME, message, cloud.header.frame_id, values)
