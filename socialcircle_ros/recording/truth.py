"""What a recording knows of the truth: masks beside clouds, or the surface that a stack was made from."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from socialcircle_ros.messages.diagnostics import Status
from socialcircle_ros.messages.header import stamp_of
from socialcircle_ros.messages.image import NOT_MEASURED, OUTLIER, decode_mono8
from socialcircle_ros.messages.point_cloud import PointCloud
from socialcircle_ros.simulation import Truth as TrueSurface

from .reader import RecordingReader
from .simulated import DESCRIPTION, SURFACE

MASK = '/truth/outlier_mask'


@dataclass(frozen=True)
class RecordedTruth:
    """Which points of a cloud are outliers.

    Attributes:
        outlier: (H, W) bool.
        counted: (H, W) bool: the points whose truth is certain.
    """

    outlier: npt.NDArray[np.bool_]
    counted: npt.NDArray[np.bool_]


Truths = Callable[[str, bytes], RecordedTruth | None]
"""From a namespace and a serialized cloud in it to the truth; None where nothing is known."""


def truths_of(reader: RecordingReader) -> Truths:
    """Read what the recording says of the truth.

    A mask on `truth/outlier_mask` (0 surface, 255 outlier, 127 not measured or too close to call) belongs to the
    cloud of the same namespace, stamp and size. `/truth/surface` and `/truth/description`, which `socialcircle
    simulate` writes, judge each cloud of the stack by its distance to the true surface.
    """
    names = [name for name in reader.topics if name.endswith(MASK)]
    masks = {
        (message.topic.removesuffix(MASK), stamp_of(message.data)): message.data
        for message in reader.messages(names)
    }
    surface = next((message.data for message in reader.messages([SURFACE])), None)
    description = next((message.data for message in reader.messages([DESCRIPTION])), None)

    def of_cloud(namespace: str, cloud: bytes) -> RecordedTruth | None:
        shape = PointCloud.decode(cloud)
        beside = masks.get((namespace, shape.header.stamp))
        if beside is not None:
            mask = decode_mono8(beside)
            if mask.shape == (shape.height, shape.width):
                return RecordedTruth(mask == OUTLIER, mask != NOT_MEASURED)
        if surface is None or description is None:
            return None
        values = Status.decode(description).values
        true = PointCloud.decode(surface).xyz()[..., 2]
        if true.shape != (shape.height, shape.width):
            return None
        good, bad = (float(values[f'{name}_bound_m']) for name in ('good', 'bad'))
        # The cause plays no part in what is bad.
        verdict = TrueSurface(true * 1e6, true.astype('u1'), good * 1e6, bad * 1e6).classify(
            shape.xyz()[..., 2] * 1e6
        )
        return RecordedTruth(verdict.bad, verdict.good | verdict.bad)

    return of_cloud
