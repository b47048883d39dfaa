# SPDX-License-Identifier: Apache-2.0
"""Known outliers of a recording: from recorded truth masks, or from the true surface of a simulated stack."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from socialcircle_ros.cloud import Mask
from socialcircle_ros.errors import MessageError
from socialcircle_ros.messages import diagnostics, image, point_cloud
from socialcircle_ros.messages.diagnostics import Status
from socialcircle_ros.messages.header import stamp_of
from socialcircle_ros.messages.image import NOT_MEASURED, OUTLIER, decode_mono8
from socialcircle_ros.messages.point_cloud import PointCloud
from socialcircle_ros.simulation import DepthTruth

from .reader import RecordingReader
from .simulated import DESCRIPTION, SURFACE

MASK = '/truth/outlier_mask'
"""The topic of truth masks, in the namespace of the clouds."""

_UM_PER_METRE = 1e6


@dataclass(frozen=True, eq=False)
class RecordedTruth:
    """The known outliers of a cloud.

    Attributes:
        outlier: (H, W) bool, the outliers.
        counted: (H, W) bool, the points that are certain to be outliers or not.
    """

    outlier: Mask
    counted: Mask


Truths = Callable[[str, bytes], RecordedTruth | None]
"""From a namespace, and a serialized cloud in it, to the truth; None if it is not known."""


def truths_of(reader: RecordingReader) -> Truths:
    """Read the truth of a recording.

    A mask on `truth/outlier_mask` belongs to the cloud with the same namespace, stamp and size. Its pixels are 0
    for the surface, 255 for an outlier, and 127 for a point that is not measured or too close to call. Other
    clouds are compared with the true surface that `socialcircle simulate` writes, if the recording has one of
    their size.
    """
    names = [name for name in reader.topics if name.endswith(MASK) and _has_type(reader, name, image.TYPE)]
    masks = {}
    for message in reader.messages(names):
        with suppress(MessageError):  # a message that is no image has no cloud
            masks[message.topic.removesuffix(MASK), stamp_of(message.data)] = message.data
    surface = _first(reader, SURFACE, point_cloud.TYPE)
    description = _first(reader, DESCRIPTION, diagnostics.TYPE)

    def truth_of(namespace: str, message: bytes) -> RecordedTruth | None:
        cloud = PointCloud.decode(message)
        mask_message = masks.get((namespace, cloud.header.stamp))
        if mask_message is not None:
            mask = decode_mono8(mask_message)
            if mask.shape == (cloud.height, cloud.width):
                return RecordedTruth(mask == OUTLIER, mask != NOT_MEASURED)
        if surface is None or description is None:
            return None
        with suppress(MessageError, KeyError, ValueError):  # topics of other programs with these names
            return _compared_with_surface(cloud, PointCloud.decode(surface), Status.decode(description))
        return None

    return truth_of


def _has_type(reader: RecordingReader, name: str, kind: str) -> bool:
    return name in reader.topics and reader.topics[name].type == kind


def _first(reader: RecordingReader, name: str, kind: str) -> bytes | None:
    """The first message on a topic of a type."""
    if not _has_type(reader, name, kind):
        return None
    return next((message.data for message in reader.messages([name])), None)


def _compared_with_surface(cloud: PointCloud, surface: PointCloud, description: Status) -> RecordedTruth | None:
    """Compare the heights of a cloud with the true surface; None if the sizes differ."""
    if (cloud.height, cloud.width) != (surface.height, surface.width):
        return None
    good, bad = (float(description.values[f'{name}_bound_m']) * _UM_PER_METRE for name in ('good', 'bad'))
    depth = surface.xyz()[..., 2].astype(np.float64)
    cause = depth.astype('u1')  # classify() does not use it
    true_surface = DepthTruth(depth * _UM_PER_METRE, cause, good, bad)
    verdict = true_surface.classify(cloud.xyz()[..., 2] * _UM_PER_METRE)
    return RecordedTruth(verdict.bad, verdict.good | verdict.bad)
