# SPDX-License-Identifier: Apache-2.0
"""The node's clouds as rows of measurements, where `measurements.folder` is set."""

import importlib.metadata
import time
from pathlib import Path

from rclpy.node import Node

from socialcircle_ros.cloud import Cloud, Mask
from socialcircle_ros.errors import printable
from socialcircle_ros.interface import POINTS
from socialcircle_ros.measurements import Origin, SettingsText
from socialcircle_ros.measurements.row_writer import LiveCloud, RowWriter
from socialcircle_ros.messages.header import Header
from socialcircle_ros.pipeline.clouds import Measurement
from socialcircle_ros.settings import MeasurementSettings

from .health import Health
from .parameters import Configuration

_LOG_PERIOD_S = 60.0


class LiveRows:
    """Hands a row of each cloud to the writer; does nothing if no folder is set.

    Args:
        node: names the cell where no parameter does.
        settings: where rows go, and how often.
        health: is told of rows that wait or are lost.

    Raises:
        SocialCircleError: a folder is set, and pyarrow is not installed.
    """

    def __init__(self, node: Node, settings: MeasurementSettings, health: Health) -> None:
        self._node = node
        self._health = health
        self._version = importlib.metadata.version('socialcircle_ros')
        self._number = 0
        self._kept: tuple[Cloud, Mask] | None = None
        self._settings: tuple[Configuration, SettingsText] | None = None
        self._writer: RowWriter | None = None
        if settings.folder:
            name = node.get_fully_qualified_name().strip('/').replace('/', '-')
            self._writer = RowWriter(Path(settings.folder), f'live-{name}', settings.period, self._tell)

    def take_kept(self, xyz: Cloud, kept: Mask) -> None:
        """Keep the points of the cloud at hand for its texture."""
        if self._writer is not None:
            self._kept = xyz, kept

    def put(
        self,
        outcome: Measurement | str,
        latency_ms: float | None,
        configuration: Configuration,
        unit: str | None,
        header: Header | None = None,
    ) -> None:
        """Hand over what came of the cloud at hand, with the settings that it was filtered with, and its unit.

        A refusal has the header of the cloud, if it can be read.
        """
        kept, self._kept = self._kept, None
        if self._writer is None:
            return
        xyz, mask = kept if kept is not None and not isinstance(outcome, str) else (None, None)
        self._writer.put(LiveCloud(self._origin(configuration, unit), outcome, latency_ms, xyz, mask, header))
        self._number += 1

    def close(self) -> None:
        """Write what waits, and tell what cannot be written."""
        lost = printable(self._writer.close()) if self._writer is not None else ''
        if lost:
            self._health.rows_failed(lost)
            if self._node.context.ok():
                self._node.get_logger().error(lost)

    def _origin(self, configuration: Configuration, unit: str | None) -> Origin:
        if self._settings is None or self._settings[0] is not configuration:
            self._settings = configuration, SettingsText.of(configuration)
        return Origin(
            source='node',
            recording=None,
            content=None,
            cell=configuration.measurements.cell or self._node.get_namespace().strip('/'),
            part=configuration.measurements.part or None,
            topic=self._node.resolve_topic_name(POINTS.name),
            number=self._number,
            time_ns=time.time_ns(),
            settings=self._settings[1],
            version=self._version,
            unit=unit,
        )

    def _tell(self, sentence: str) -> None:
        self._health.rows_failed(printable(sentence))
        if self._node.context.ok():
            self._node.get_logger().warning(printable(sentence), throttle_duration_sec=_LOG_PERIOD_S)
