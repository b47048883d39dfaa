# SPDX-License-Identifier: Apache-2.0
"""Two settings on one cloud, filtered in this process in the same way as in the node."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from socialcircle_ros.interface import MASK
from socialcircle_ros.messages.image import NOT_MEASURED, OUTLIER, decode_mono8
from socialcircle_ros.pictures.thinning import any_in_tile, thinned
from socialcircle_ros.pipeline.clouds import Measurement, filter_cloud
from socialcircle_ros.settings import CircleSettings, OutputSettings, PipelineSettings, RosValue

from . import colours

_PIXELS = 400  # most pixels along the longer side of a picture


@dataclass(frozen=True, eq=False)
class Side:
    """The result of one of the two settings.

    Attributes:
        name: of the setting.
        measurement: what the filter says of the cloud.
        mask: (H, W) uint8, with the values of `outlier_mask`.
    """

    name: str
    measurement: Measurement
    mask: npt.NDArray[np.uint8]


@dataclass(frozen=True)
class Comparison:
    """Both results, and how the settings differ.

    Attributes:
        cloud: the serialized PointCloud2.
        a: the result of the one setting.
        b: the result of the other.
        differing: name, value in A and value in B of each parameter that differs.
    """

    cloud: bytes
    a: Side
    b: Side
    differing: tuple[tuple[str, RosValue, RosValue], ...]

    @property
    def counts(self) -> tuple[int, int, int]:
        """How many points are outliers of both, of A only, and of B only."""
        a, b = self.a.mask == OUTLIER, self.b.mask == OUTLIER
        return int(np.count_nonzero(a & b)), int(np.count_nonzero(a & ~b)), int(np.count_nonzero(b & ~a))

    def picture(self) -> npt.NDArray[np.uint8]:
        """Where both settings, only A, or only B find outliers.

        Returns:
            (h, w, 3) uint8. A pixel that stands for several points shows a difference rather than agreement.
        """
        a, b = self.a.mask == OUTLIER, self.b.mask == OUTLIER
        small = thinned(self.a.mask, _PIXELS)
        picture = np.full((*small.shape, 3), colours.KEPT, np.uint8)
        picture[small == NOT_MEASURED] = colours.NOT_MEASURED
        for where, colour in ((a & b, colours.BOTH), (a & ~b, colours.ONLY_A), (b & ~a, colours.ONLY_B)):
            picture[any_in_tile(where, _PIXELS)] = colour
        return picture


def compare(
    cloud: bytes,
    a: tuple[str, Mapping[str, RosValue]],
    b: tuple[str, Mapping[str, RosValue]],
    depth_of_field: float | None = None,
) -> Comparison:
    """Filter one cloud with two settings.

    Args:
        cloud: a serialized PointCloud2.
        a: name of the one setting, and the value of every parameter.
        b: the same for the other.
        depth_of_field: of the stack that gave the cloud, in the cloud's unit; None: it is unknown.

    Raises:
        SocialCircleError: a setting is invalid, or the cloud cannot be filtered.
    """
    sides = []
    for name, values in (a, b):
        settings = PipelineSettings(circle=CircleSettings.from_ros(values), output=OutputSettings(mask=True))
        outputs = filter_cloud(cloud, settings, depth_of_field)
        sides.append(Side(name, outputs.measurement, decode_mono8(outputs.messages[MASK])))
    differing = tuple((key, value, b[1][key]) for key, value in a[1].items() if value != b[1].get(key, value))
    return Comparison(cloud, sides[0], sides[1], differing)
