# SPDX-License-Identifier: Apache-2.0
"""One cloud: message → cloud → result → outputs. The node does this live, `socialcircle filter` does it offline.

Both emit the same bytes, so that a replay shows what the line did.
"""

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from socialcircle_ros.arguments import settings_or_default
from socialcircle_ros.circle import CircleResult, remove_outliers
from socialcircle_ros.cloud import Cloud, Mask, measured_only
from socialcircle_ros.digits import share_text
from socialcircle_ros.errors import printable
from socialcircle_ros.interface import (
    FAILED,
    FILTERED,
    MASK,
    MEASUREMENT,
    PASSED,
    REPAIRED,
    SCORE,
    STAGE_TIME,
    MeasurementValues,
    NodeTopic,
    outputs_of,
)
from socialcircle_ros.kernels.memory import new_memory
from socialcircle_ros.kernels.stopwatch import Stopwatch
from socialcircle_ros.messages import diagnostics
from socialcircle_ros.messages.image import encode_image, mask_pixels
from socialcircle_ros.messages.point_cloud import PointCloud
from socialcircle_ros.repair import repair_holes
from socialcircle_ros.settings import LimitSettings, PipelineSettings, RepairSettings

from .limits import Verdict, verdict

STATUS_NAME = 'social_circle: measurement'

_NAME = re.compile(r'\w+\.\w')  # such as circle.radius_scale

Emit = Callable[[NodeTopic, bytes | memoryview], None]
"""Takes an output as soon as it is made. A memoryview is valid during the call only."""

TakeKept = Callable[[Cloud, Mask], None]
"""Takes the coordinates of a cloud, (H, W, 3), and the mask of its kept points, (H, W)."""


@dataclass(frozen=True)
class Measurement:
    """What the filter says of a cloud.

    Attributes:
        level: of diagnostics; WARN where a person should look, ERROR where the measurement failed its limits.
        message: the result in sentences.
        frame_id: the cloud's frame.
        values: the counts, seed and radius.
        settings: the settings of the circle in force, by their full names.
        times_ms: time of each stage in ms, in the order of the stages, and `total`.
        failures: the outputs that could not be made or emitted, and why; the others were.
        notes: the sentences of `message` on points that count as not measured, and on few removed islands.
        warnings: the sentences of `message` that a person should look at.
        verdict: whether the measurement passes its limits; None: there is none.
    """

    level: int
    message: str
    frame_id: str
    values: MeasurementValues
    settings: Mapping[str, str]
    times_ms: Mapping[str, float]
    failures: Mapping[NodeTopic, Exception]
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    verdict: Verdict | None = None

    def in_unit(self, unit: str | None) -> 'Measurement':
        """The measurement with lengths in the unit of the cloud, where it says which limits fail."""
        before = self.values.verdict_reason
        if self.verdict is None or before is None:
            return self
        reason = ' '.join(self.verdict.reasons(unit))
        values = replace(self.values, verdict_reason=reason)
        return replace(self, message=self.message.replace(before, reason, 1), values=values)

    def status(self, *, timed: bool) -> diagnostics.Status:
        """The measurement as a message; without times it is the same for the same cloud and settings."""
        times = (
            {STAGE_TIME.format(stage=stage): f'{ms:.3f}' for stage, ms in self.times_ms.items()} if timed else {}
        )
        values = {**self.values.to_text(), **self.settings, **times}
        return diagnostics.Status(self.level, STATUS_NAME, self.message, self.frame_id, values)


@dataclass(frozen=True)
class CloudOutputs:
    """All outputs of one cloud.

    Attributes:
        messages: the serialized messages by topic; the measurement among them holds no times.
        measurement: what the filter says of the cloud.
    """

    messages: Mapping[NodeTopic, bytes]
    measurement: Measurement


def filter_cloud(
    message: bytes,
    settings: PipelineSettings | None = None,
    depth_of_field: float | None = None,
    take_kept: TakeKept = lambda xyz, kept: None,
) -> CloudOutputs:
    """Filter one serialized PointCloud2, and keep its outputs.

    Args:
        message: the cloud in CDR.
        settings: how to filter and repair, and which outputs are wanted.
        depth_of_field: of a cloud that was a stack, in the unit of the cloud; `circle.depth_of_field` takes
            precedence.
        take_kept: called once with the kept points.

    Returns:
        The outputs; the same for the same cloud and settings, except for the times.

    Raises:
        MessageError: the message is not an organized cloud, or contradicts itself.
        CloudError: the method has no result for this cloud.
        Exception: an output could not be made.
    """
    messages: dict[NodeTopic, bytes] = {}

    def keep(topic: NodeTopic, output: bytes | memoryview) -> None:
        messages[topic] = bytes(output)

    measurement = process_cloud(message, keep, settings, depth_of_field, take_kept=take_kept)
    for failure in measurement.failures.values():
        raise failure
    messages[MEASUREMENT] = measurement.status(timed=False).encode()
    return CloudOutputs(messages, measurement)


def process_cloud(
    message: bytes | memoryview,
    emit: Emit,
    settings: PipelineSettings | None = None,
    depth_of_field: float | None = None,
    *,
    lend: bool = False,
    take_kept: TakeKept = lambda xyz, kept: None,
) -> Measurement:
    """Filter one serialized PointCloud2, and emit each output as soon as it is made: the filtered cloud first.

    An output that fails takes no other with it: the measurement names it.

    Args:
        message: the cloud in CDR; it is never altered.
        emit: takes each output but the measurement, which is returned.
        settings: how to filter and repair, and which outputs are wanted.
        depth_of_field: of a cloud that was a stack, in the unit of the cloud; `circle.depth_of_field` takes
            precedence.
        lend: whether the filtered cloud is emitted as a memoryview, whose memory is free after the call.
        take_kept: called once with the kept points, after all outputs are emitted.

    Raises:
        MessageError: the message is not an organized cloud, or contradicts itself.
        CloudError: the method has no result for this cloud.
    """
    settings = settings_or_default(PipelineSettings, settings)
    circle = settings.circle.of_a_stack(depth_of_field)
    wanted = outputs_of(circle.mode, settings.output)
    stopwatch = Stopwatch()
    cloud = PointCloud.decode(message)
    xyz = cloud.xyz()
    stopwatch.lap('decode')
    result = remove_outliers(xyz, circle)
    stopwatch.times_ms |= result.times_ms
    stopwatch.restart()
    outputs = _Outputs(cloud, xyz, result, settings.repair, emit)

    def filtered() -> bytes | memoryview:
        output = outputs.filtered(lend=lend)
        stopwatch.lap('cloud')  # emitting it is not part of the filter
        return output

    outputs.attempt(FILTERED, filtered)
    stopwatch.restart()
    if MASK in wanted:
        outputs.attempt(MASK, outputs.mask)
    score = result.score
    if SCORE in wanted and score is not None:
        outputs.attempt(SCORE, lambda: encode_image(cloud.header, score))
    stopwatch.lap('mask')
    if REPAIRED in wanted:
        outputs.attempt(REPAIRED, outputs.repaired)
        stopwatch.lap('repair')

    judged = _judged(settings.limits, result, xyz, outputs.measured, stopwatch)
    take_kept(xyz, result.inliers)
    stopwatch.times_ms['total'] = sum(stopwatch.times_ms.values())
    values = outputs.values(depth_of_field, judged)
    warnings = (*result.warnings, *outputs.warnings)
    return Measurement(
        *_sentences(values, result.notes, warnings, outputs.failures),
        frame_id=cloud.header.frame_id,
        values=values,
        settings={name: str(value) for name, value in circle.to_ros().items()},
        times_ms=stopwatch.times_ms,
        failures=outputs.failures,
        notes=tuple(map(_as_sentence, result.notes)),
        warnings=tuple(map(_as_sentence, warnings)),
        verdict=judged,
    )


class _Outputs:
    """The outputs of one cloud, each made and emitted by itself, so that one that fails takes no other with it."""

    def __init__(
        self, cloud: PointCloud, xyz: Cloud, result: CircleResult, repair: RepairSettings, emit: Emit
    ) -> None:
        self._cloud, self._xyz, self._result = cloud, xyz, result
        self._repair, self._emit = repair, emit
        self.points = cloud.height * cloud.width
        self.outliers = int(np.count_nonzero(result.outliers))
        self.measured = self.outliers + int(np.count_nonzero(result.inliers))
        self.filled = 0
        self.warnings: tuple[str, ...] = ()
        self.failures: dict[NodeTopic, Exception] = {}

    def values(self, depth_of_field: float | None, judged: Verdict | None) -> MeasurementValues:
        """The counts, seed and radius, once all outputs are made.

        Args:
            depth_of_field: of the stack, as `process_cloud` takes it.
            judged: whether it passes its limits.
        """
        header = self._cloud.header
        reasons = '' if judged is None else ' '.join(judged.reasons())
        return MeasurementValues(
            stamp=f'{header.seconds}.{header.nanoseconds:09d}',
            points=self.points,
            measured=self.measured,
            kept=self.measured - self.outliers,
            outliers=self.outliers,
            repaired=self.filled,
            seed_row=self._result.seed[0],
            seed_column=self._result.seed[1],
            radius=self._result.radius,
            stack_depth_of_field=depth_of_field,
            verdict=None if judged is None else (FAILED if reasons else PASSED),
            verdict_reason=reasons or None,
        )

    def attempt(self, topic: NodeTopic, make: Callable[[], bytes | memoryview]) -> None:
        """Make and emit an output, or note why it is missing."""
        try:
            self._emit(topic, make())
        except Exception as error:  # noqa: BLE001 - whatever it is, the other outputs must be emitted
            self.failures[topic] = error

    def filtered(self, *, lend: bool) -> bytes | memoryview:
        """The filtered cloud; `lend`: in memory that ends with the call."""
        outliers, dense = self._result.outliers, self.outliers == 0 and self.measured == self.points
        if not lend:
            return self._cloud.without(outliers, dense=dense)
        memory = memoryview(new_memory(len(self._cloud.message)))
        self._cloud.write_without(outliers, memory, dense=dense)
        return memory

    def mask(self) -> bytes:
        """The mask as an image."""
        return encode_image(self._cloud.header, mask_pixels(self._result.inliers, self._result.outliers))

    def repaired(self) -> bytes:
        """The cloud with its holes filled."""
        measured = self._result.inliers | self._result.outliers  # without marks, which are no surface
        repair = repair_holes(measured_only(self._xyz, measured), self._result.outliers, self._repair)
        self.filled, self.warnings = int(np.count_nonzero(repair.filled)), repair.warnings
        dense = self.measured - self.outliers + self.filled == self.points
        return self._cloud.replaced(self._result.outliers, repair.xyz, dense=dense)


def _judged(
    limits: LimitSettings, result: CircleResult, xyz: Cloud, measured: int, stopwatch: Stopwatch
) -> Verdict | None:
    """Whether a measurement passes its limits; None, in no time, if there is none."""
    if not limits.are_set:
        return None
    found = verdict(limits, xyz, result.inliers, measured)
    stopwatch.lap('limits')
    return found


def failure_sentence(topic: NodeTopic, error: Exception) -> str:
    """What to say of an output that could not be made or emitted."""
    return printable(f'{topic.name} of a cloud is missing: {type(error).__name__}: {error}')


def _as_sentence(text: str) -> str:
    """The text with a capital at its beginning, unless that is the name of a parameter."""
    return text if _NAME.match(text) else f'{text[0].upper()}{text[1:]}'


def _sentences(
    values: MeasurementValues,
    notes: Iterable[str],
    warnings: Iterable[str],
    failures: Mapping[NodeTopic, Exception],
) -> tuple[int, str]:
    """Level and sentences of a measurement."""
    share = values.outliers / values.measured
    message = f'{values.outliers} of {values.measured} measured points are outliers ({share_text(share)}).'
    level = diagnostics.OK
    for note in notes:
        message += f' {_as_sentence(note)}'
    for warning in warnings:
        level = diagnostics.WARN
        message += f' {_as_sentence(warning)}'
    for topic, error in failures.items():
        level = diagnostics.ERROR
        message += f' {failure_sentence(topic, error)}'
    if values.verdict == FAILED:
        return diagnostics.ERROR, f'Failed: {values.verdict_reason} {message}'
    return level, message
