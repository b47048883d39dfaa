# SPDX-License-Identifier: Apache-2.0
"""Joins each cloud with the results that a node publishes for it."""

from collections import OrderedDict
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from socialcircle_ros.interface import MeasurementValues
from socialcircle_ros.messages.diagnostics import Status
from socialcircle_ros.messages.header import stamp_of, stamp_text
from socialcircle_ros.messages.image import Image, decode_mono8

_MOST_CLOUDS = 12
_MOST_BYTES = 512 << 20


@dataclass(frozen=True, eq=False)
class MatchedCloud:
    """A cloud with its results.

    Attributes:
        cloud: serialized, as it came.
        mask: (H, W) uint8, as on the topic of the outlier mask.
        measurement: what the node says of the cloud.
    """

    cloud: bytes
    mask: npt.NDArray[np.uint8]
    measurement: Status


class CloudMatcher:
    """Joins clouds, masks and measurements with the same stamp; they may come in any order.

    At most 12 clouds and 512 MiB of clouds are kept, the newest ones. A mask or measurement is kept until the next
    one comes, and is used once: otherwise the old mask of a cloud that is filtered again, which keeps its stamp,
    could match the new measurement.
    """

    def __init__(self) -> None:
        self._clouds: OrderedDict[int, bytes] = OrderedDict()
        self._mask: tuple[int, npt.NDArray[np.uint8]] | None = None
        self._measurement: tuple[str, Status] | None = None

    def add_cloud(self, message: bytes) -> MatchedCloud | None:
        """Take a serialized PointCloud2; the match, if it is complete.

        Raises:
            MessageError: the message ends early.
        """
        stamp = stamp_of(message)
        self._clouds[stamp] = message
        self._clouds.move_to_end(stamp)
        while len(self._clouds) > _MOST_CLOUDS or sum(map(len, self._clouds.values())) > _MOST_BYTES:
            self._clouds.popitem(last=False)
        return self._match()

    def add_mask(self, message: bytes) -> MatchedCloud | None:
        """Take a serialized outlier mask; the match, if it is complete.

        Raises:
            MessageError: the message is no mask.
        """
        self._mask = (Image.decode(message).header.stamp, decode_mono8(message))
        return self._match()

    def add_measurement(self, message: bytes) -> MatchedCloud | None:
        """Take a serialized measurement; the match, if it is complete.

        Raises:
            MessageError: the message is no measurement.
        """
        status = Status.decode(message)
        self._measurement = (MeasurementValues.from_text(status.values).stamp, status)
        return self._match()

    def _match(self) -> MatchedCloud | None:
        if self._mask is None or self._measurement is None:
            return None
        stamp, mask = self._mask
        measured_stamp, measurement = self._measurement
        cloud = self._clouds.get(stamp)
        if cloud is None or measured_stamp != stamp_text(stamp):
            return None
        self._mask = self._measurement = None
        return MatchedCloud(cloud, mask, measurement)
