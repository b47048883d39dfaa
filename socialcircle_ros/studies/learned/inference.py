# SPDX-License-Identifier: Apache-2.0
"""The network on a whole height map, with ONNX Runtime."""

from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.cloud import Mask
from socialcircle_ros.errors import SocialCircleError, install_command

from .features import CHANNELS, Features, features_of

if TYPE_CHECKING:
    from collections.abc import Mapping

Logits = NDArray[np.float32]
"""(H, W), above 0 where an outlier is likelier than a good point."""


def packaged_network() -> Path:
    """The file of the network that is part of the package."""
    return Path(str(resources.files('socialcircle_ros.studies.learned') / 'network.onnx'))


class Judge:
    """A network, read from a file.

    Attributes:
        card: the metadata of the file: what the network was trained on, its threshold.
        threshold: probability above which a point is an outlier.
    """

    def __init__(self, path: Path, threads: int = 0) -> None:
        """Read the file.

        Args:
            path: of an ONNX file that `export` wrote.
            threads: to compute with; 0: one for each core.

        Raises:
            SocialCircleError: ONNX Runtime is not installed, or cannot read the file.
        """
        try:
            import onnxruntime  # noqa: PLC0415 an extra
        except ImportError:
            raise SocialCircleError(f'The network needs ONNX Runtime: {install_command("train")}.') from None
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        try:
            self._session = onnxruntime.InferenceSession(str(path), options, providers=['CPUExecutionProvider'])
        except Exception as error:  # noqa: BLE001 the errors of ONNX Runtime share no other base
            raise SocialCircleError(f'{path} cannot be read as a network: {error}') from None
        self.card: Mapping[str, str] = self._session.get_modelmeta().custom_metadata_map
        self.threshold = float(self.card['threshold'])
        self._multiple = int(self.card['multiple'])

    def logits(self, heights: NDArray[np.float32]) -> Logits:
        """Judge each point.

        Args:
            heights: (H, W) float32, NaN where not measured; at least one point is measured.
        """
        planes = as_planes(features_of(heights), self._multiple)
        (squares,) = self._session.run(['logits'], {'features': planes})
        height, width = planes.shape[2:]
        points = squares.reshape(2, 2, height, width).transpose(2, 0, 3, 1).reshape(2 * height, 2 * width)
        found: Logits = points[: heights.shape[0], : heights.shape[1]]
        return found

    def outliers(self, heights: NDArray[np.float32]) -> Mask:
        """(H, W) bool: measured points whose probability is above the threshold."""
        level = float(np.log(self.threshold / (1 - self.threshold)))
        found: Mask = (self.logits(heights) > level) & np.isfinite(heights)
        return found


def as_planes(features: Features, multiple: int) -> NDArray[np.float32]:
    """The input of the network: (1, 25, H/2, W/2) float32, with H and W filled up to a multiple.

    Plane 4c + 2y + x has channel c of the point (y, x) of each 2×2 square; the last plane is the grain.
    """
    height, width = features.channels.shape[1:]
    rows, columns = (-(-size // multiple) * multiple for size in (height, width))
    padded = np.zeros((CHANNELS, rows, columns), np.float32)
    padded[:, :height, :width] = features.channels
    squares = padded.reshape(CHANNELS, rows // 2, 2, columns // 2, 2).transpose(0, 2, 4, 1, 3)
    planes = np.empty((1, 4 * CHANNELS + 1, rows // 2, columns // 2), np.float32)
    planes[0, :-1] = squares.reshape(4 * CHANNELS, rows // 2, columns // 2)
    planes[0, -1] = features.grain
    return planes
