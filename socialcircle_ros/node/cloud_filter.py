# SPDX-License-Identifier: Apache-2.0
"""Clouds in the node: the newest one is filtered on a worker's thread, and its outputs are published.

A cloud goes one way: it arrives or is made from a stack, waits, is filtered, and its outputs are published. Its
message is never altered, so that it can be filtered again and published as it came.
"""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

from rclpy.lifecycle import LifecycleNode

from socialcircle_ros.errors import SocialCircleError, printable
from socialcircle_ros.interface import CLOUD_OUTPUTS, LAST_POINTS, MEASUREMENT, POINTS, NodeTopic
from socialcircle_ros.kernels.memory import give_back_freed_memory, reserve_memory
from socialcircle_ros.messages import diagnostics
from socialcircle_ros.messages.header import readable_header
from socialcircle_ros.pipeline.clouds import Measurement, failure_sentence, process_cloud

from .health import Health
from .live_rows import LiveRows
from .lost_messages import LostMessages, lost_sentence
from .parameters import Configuration
from .rclpy_internals import MessageInput, TakenMessage, listen
from .spare_memory import PLANES_HELD, SpareMemory
from .topics import CLASSES, Publishers, qos_options
from .worker import LatestWorker, always

LOG_PERIOD_S = 5.0
"""Time between two log lines of one kind."""

# Clouds for which the node needs memory: in the reader, two on the way from it, the last one, and in the writer.
# The result takes the place of one on the way. Where a cloud comes while another is filtered, more are needed.
_CLOUDS_HELD = 5

# Bytes of a point, and of a cloud. What is reserved for it is given back if clouds are far smaller.
_POINT_SIZE = 16
_EXPECTED_SIZE = 1280 * 960 * _POINT_SIZE

_REPLACED = 'A cloud was dropped: a newer one arrived while the one before was being filtered.'
_TOO_LATE = 'A cloud was dropped: it waited when the node was deactivated.'
_TOO_LATE_AT_END = 'A cloud was dropped: it waited when the node ended.'
_TOO_SLOW = 'A cloud was dropped: it was still being filtered when the node was no longer active.'
_UNFINISHED = 'A cloud was dropped: it was still being filtered when the node ended.'

DRAINING_S = 5.0
"""How long deactivation and the end of the node wait for the cloud at hand."""

_FORGETTING_S = 1.0  # how long a reset waits for it: no message is taken meanwhile


@dataclass(frozen=True)
class QueuedCloud:
    """A cloud that is to be filtered.

    Attributes:
        message: the serialized PointCloud2.
        arrived_s: time of its arrival, of time.monotonic().
        depth_of_field: in m, of a cloud that was a stack.
        unit: of the coordinates; None: no message says it.
        again: whether it was filtered before, and is filtered again because parameters changed.
    """

    message: bytes | memoryview
    arrived_s: float
    depth_of_field: float | None = None
    unit: str | None = None
    again: bool = False


def _reserve(size: int) -> None:
    """Reserve the memory that clouds of a size need, as the first one would wait for it otherwise."""
    reserve_memory(_CLOUDS_HELD * size, PLANES_HELD * size // _POINT_SIZE)


def _fit_memory(size: int) -> None:
    """Adapt what is reserved to the size of the clouds that come.

    Args:
        size: of a cloud's message, in bytes.
    """
    if size < _EXPECTED_SIZE / 2:
        give_back_freed_memory()
        _reserve(size)


class CloudFilter:
    """What the node does with `points` and with the clouds of stacks.

    Args:
        node: the lifecycle node, unconfigured or inactive.
        configuration: gives the settings in force.
        health: counts arrivals, refusals and latencies.
    """

    def __init__(
        self,
        node: LifecycleNode,
        configuration: Callable[[], Configuration],
        health: Health,
    ) -> None:
        self._node = node
        self._configuration = configuration
        self._health = health
        self._input: MessageInput | None = None
        self._last: QueuedCloud | None = None
        self._forgotten_s = float('-inf')  # clouds that arrived until then are forgotten
        self._forgetting = threading.Lock()
        self._is_first = True
        self._too_late = _TOO_LATE
        self._spare = SpareMemory()
        self._rows = LiveRows(node, configuration().measurements, health)
        self._publishers = Publishers(node, (*CLOUD_OUTPUTS, LAST_POINTS))
        self._worker = LatestWorker(self._process, self._dropped, self._process_again)

    @property
    def busy_s(self) -> float:
        """For how long the cloud at hand has been filtered; at most 0 where there is none."""
        return self._worker.busy_s

    @property
    def input(self) -> MessageInput | None:
        """The subscription to `points`; None while the node is not active."""
        return self._input

    def reserve(self) -> None:
        """Reserve memory for clouds of the usual size, until one has come."""
        if self._is_first:
            _reserve(_EXPECTED_SIZE)

    def look_after_memory(self, *, is_used: bool) -> None:
        """Give back the memory that clouds no longer need; to be called once a second.

        Args:
            is_used: whether what is free will be used by others.
        """
        if is_used:
            self._spare.use()
        elif self._last is not None:
            size = len(self._last.message)
            self._spare.look(size, size // _POINT_SIZE)

    def listen(self) -> None:
        """Subscribe to clouds."""
        lost = LostMessages(self._clouds_lost)

        def arrived(taken: TakenMessage) -> None:
            lost.arrived(taken)
            self._cloud_arrived(taken.message)

        kind, options = CLASSES[POINTS.type], qos_options(POINTS)
        self._input = listen(self._node, kind, POINTS.name, arrived, event_callbacks=lost, **options)

    def ignore(self) -> None:
        """End the subscription."""
        if self._input is not None:
            self._input.destroy()
            self._input = None

    def filter(self, message: bytes | memoryview) -> None:
        """Hand a cloud that arrived to the worker."""
        self._worker.put(QueuedCloud(message, time.monotonic()))

    def filter_stack(self, message: bytes | memoryview, depth_of_field: float | None) -> None:
        """Hand a cloud that a stack became, which is in m, to the worker."""
        self._worker.put(QueuedCloud(message, time.monotonic(), depth_of_field, 'm'))

    def filter_again(self) -> None:
        """Filter the last cloud again, unless a newer one is filtered first."""
        if self._last is not None:
            self._worker.put_again()

    def publish_last(self) -> bool:
        """Publish the last cloud as it came, and filter it again; False: there is none."""
        last = self._last
        if last is None:
            return False
        self._publishers.publish(LAST_POINTS, last.message)
        self._worker.put_again()
        return True

    def finish(self) -> None:
        """Drop the cloud that waits, and let the one at hand be published, if it is filtered soon."""
        self._worker.forget()
        self._worker.drain(DRAINING_S)

    def forget(self) -> None:
        """Drop the cloud that waits, and forget the last one; if that is filtered for long, it is not counted."""
        self._worker.forget()
        self._worker.drain(_FORGETTING_S)
        with self._forgetting:
            self._last, self._forgotten_s = None, time.monotonic()

    def close(self, patient: Callable[[], bool] = always) -> bool:
        """Stop the worker and destroy the publishers; argument and result as of `LatestWorker.stop`."""
        self._too_late = _TOO_LATE_AT_END
        try:
            self.ignore()
        finally:
            ended = self._worker.stop(patient)
        if not ended:
            self._drop(_UNFINISHED)
        self._rows.close()
        self._publishers.destroy()
        return ended

    def _cloud_arrived(self, message: memoryview) -> None:
        self._health.received()
        self.filter(message)

    def _clouds_lost(self, count: int) -> None:
        reason = lost_sentence(count, self._node.resolve_topic_name(POINTS.name))
        self._health.lost(count, reason)
        self._node.get_logger().warning(reason, throttle_duration_sec=LOG_PERIOD_S)

    def _dropped(self, _: QueuedCloud) -> None:
        if self._input is not None:
            self._health.dropped(_REPLACED)
        else:
            self._drop(self._too_late)

    def _drop(self, reason: str) -> None:
        """Count a dropped cloud, and log it: whoever deactivates or ends the node may not see its diagnostics."""
        self._health.dropped(reason)
        if self._node.context.ok():
            self._node.get_logger().warning(reason)

    def _process_again(self) -> None:
        last = self._last
        if last is not None:
            self._process(last)

    def _unless_forgotten(self, cloud: QueuedCloud, act: Callable[[], None]) -> None:
        with self._forgetting:
            if cloud.arrived_s > self._forgotten_s:
                act()

    def _keep(self, cloud: QueuedCloud) -> None:
        self._last = replace(cloud, again=True)

    def _process(self, cloud: QueuedCloud) -> None:
        """Filter one cloud and publish its outputs; on the worker's thread, so no exception may escape."""
        # A refused cloud is kept too: the next change of parameters may be what it needs.
        self._unless_forgotten(cloud, lambda: self._keep(cloud))
        settings = self._configuration()
        published: list[bool] = []

        def publish(topic: NodeTopic, output: bytes | memoryview) -> None:
            published.append(self._publishers.publish(topic, output))

        try:
            measurement = process_cloud(
                cloud.message, publish, settings, cloud.depth_of_field, lend=True, take_kept=self._rows.take_kept
            )
            if all(published):  # a node that is not active has dropped the first outputs
                publish(MEASUREMENT, measurement.status(timed=True).encode())
        except SocialCircleError as refusal:
            reason = str(refusal)
            self._unless_forgotten(cloud, lambda: self._health.refused(reason, again=cloud.again))
            if not cloud.again:
                self._rows.put(str(refusal), None, settings, cloud.unit, readable_header(cloud.message))
            self._node.get_logger().warning(f'Cloud refused: {refusal}', throttle_duration_sec=LOG_PERIOD_S)
            return
        except Exception as error:  # noqa: BLE001 - whatever it is, the next cloud must be filtered
            self._failed(f'A cloud could not be filtered: {type(error).__name__}: {error}', cloud)
            return
        if self._is_first:
            self._is_first = False
            _fit_memory(len(cloud.message))
        if not all(published):
            if not cloud.again:
                self._unless_forgotten(cloud, lambda: self._drop(_TOO_SLOW))
            return
        latency_s = time.monotonic() - cloud.arrived_s
        self._unless_forgotten(cloud, lambda: self._count(cloud, measurement, latency_s))
        if not cloud.again:
            self._rows.put(measurement, 1000 * latency_s, settings, cloud.unit)
        for topic, failure in measurement.failures.items():
            self._failed(failure_sentence(topic, failure), cloud)
        if measurement.level == diagnostics.WARN:
            self._node.get_logger().warning(measurement.message, throttle_duration_sec=LOG_PERIOD_S)

    def _count(self, cloud: QueuedCloud, measurement: Measurement, latency_s: float) -> None:
        self._health.judged(measurement.values.verdict_reason or '', again=cloud.again)
        if not cloud.again:
            self._health.published(latency_s)

    def _failed(self, reason: str, cloud: QueuedCloud) -> None:
        """Tell of a fault of this package; what fails while the process ends is none."""
        if self._node.context.ok():
            self._unless_forgotten(cloud, lambda: self._health.cloud_failed(printable(reason), again=cloud.again))
            self._node.get_logger().error(printable(reason), throttle_duration_sec=LOG_PERIOD_S)
