"""Two settings on one cloud, filtered here as the node would."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from socialcircle_ros.messages.image import NOT_MEASURED, OUTLIER, decode_mono8
from socialcircle_ros.pipeline.clouds import CloudOutputs, filter_cloud
from socialcircle_ros.report.pictures import any_in_tile, thinned
from socialcircle_ros.settings import CircleSettings, OutputSettings, RosValue

from . import colours
from .view import PIXELS


@dataclass(frozen=True)
class Side:
    """What one of the two settings makes of the cloud."""

    name: str
    cleaned: CloudOutputs
    mask: npt.NDArray[np.uint8]


@dataclass(frozen=True)
class Comparison:
    """Both answers, and where they differ."""

    cloud: bytes
    a: Side
    b: Side
    differing: tuple[tuple[str, RosValue, RosValue], ...]
    """Name, value in A, value in B, of the parameters that differ."""

    @property
    def counts(self) -> tuple[int, int, int]:
        """Outliers of both, of A only, and of B only."""
        a, b = self.a.mask == OUTLIER, self.b.mask == OUTLIER
        return tuple(int(np.count_nonzero(where)) for where in (a & b, a & ~b, b & ~a))  # type: ignore[return-value]

    def picture(self) -> npt.NDArray[np.uint8]:
        """(h, w, 3): where both, only A, or only B found outliers; of a pixel's points, what differs wins."""
        a, b = self.a.mask == OUTLIER, self.b.mask == OUTLIER
        small = thinned(self.a.mask, PIXELS)
        picture = np.full((*small.shape, 3), colours.KEPT, np.uint8)
        picture[small == NOT_MEASURED] = colours.NOT_MEASURED
        for where, colour in ((a & b, colours.BOTH), (a & ~b, colours.ONLY_A), (b & ~a, colours.ONLY_B)):
            picture[any_in_tile(where, PIXELS)] = colour
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
        a: name and values of the one setting, of every parameter.
        b: the same of the other.
        depth_of_field: of the stack that the cloud was.

    Raises:
        SocialCircleError: a setting cannot be, or the cloud cannot be filtered.
    """
    sides = []
    for name, values in (a, b):
        circle = CircleSettings.from_ros(values).of_a_stack(depth_of_field)
        cleaned = filter_cloud(cloud, circle, OutputSettings(mask=True))
        sides.append(Side(name, cleaned, decode_mono8(cleaned.mask or b'')))
    differing = tuple((key, value, b[1][key]) for key, value in a[1].items() if value != b[1].get(key, value))
    return Comparison(cloud, sides[0], sides[1], differing)
