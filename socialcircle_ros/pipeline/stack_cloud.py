# SPDX-License-Identifier: Apache-2.0
"""The cloud and the image of a focus stack as messages."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from socialcircle_ros.focus import FocusResult, Frame, Registered
from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel
from socialcircle_ros.messages.header import Header
from socialcircle_ros.messages.image import COLOUR_ENCODINGS, encode_image
from socialcircle_ros.messages.point_cloud import write_float_cloud
from socialcircle_ros.settings import StackSettings

FIELDS = ('x', 'y', 'z', 'intensity', 'quality')
"""Fields of the cloud of a stack, float32 each."""

COLOUR = 'rgb'
"""A further field of stacks in colour: 0x00RRGGBB in the bytes of a float32, the convention of PCL and RViz."""


@dataclass(frozen=True, eq=False)
class StackCloud:
    """The cloud of a stack, or of the part of a running stack that has come.

    Attributes:
        points: serialized PointCloud2 in m: x, y, z, intensity, quality; rgb if the frames have colours.
        image: serialized Image: every pixel from its sharpest frame; in colour if the frames are.
        frames: how many frames were measured.
        preview: whether the stack is still running.
        reasons: (H, W) uint8, the objections to each point: bits of `focus.Reason`.
        depth_of_field: of the optics in m; None: no focus curve is reliable enough.
        warning: why the cloud may be wrong; '': there is no sign of it.
        flicker: standard deviation of the mean light of the frames, as a share.
        speed: of the stage, mean from the first to the last frame, m/s; 0: unknown.
        focus_step: step of the focus measure, pixels: `focus.step`, or what was chosen from the frames.
        drift: how far the frames moved sideways, pixels; None: their texture does not tell.
        registered: what was corrected of drift and magnification; None: nothing was asked for.
    """

    points: bytes
    image: bytes
    frames: int
    preview: bool
    reasons: npt.NDArray[np.uint8]
    depth_of_field: float | None
    warning: str = ''
    flicker: float = 0.0
    speed: float = 0.0
    focus_step: int = 0
    drift: float | None = None
    registered: Registered | None = None


def make_cloud(
    result: FocusResult,
    settings: StackSettings,
    header: Header,
    *,
    frames: int,
    preview: bool,
    warning: str,
    speed: float,
    blue_first: bool = False,
) -> StackCloud:
    """Write the messages of a measured stack.

    Args:
        result: what was measured.
        settings: the pitches are used.
        header: of the messages.
        frames: how many frames were measured.
        preview: whether the stack is still running.
        warning: why the cloud may be wrong.
        speed: of the stage, m/s.
        blue_first: whether the order of the colours is B, G, R.
    """
    height, width = result.depth.shape
    pitch_x = settings.pitch_x
    pitch_y = settings.pitch_y or pitch_x
    x = (np.arange(width) * pitch_x).astype(np.float32)
    y = (np.arange(height) * pitch_y).astype(np.float32)
    colours = result.colours

    def write(points: npt.NDArray[np.float32]) -> bool:
        def write_band(band: slice) -> bool:
            depth, image, quality = result.depth[band], result.image[band], result.quality[band]
            if colours is not None:
                points[band, :, len(FIELDS)].view('<u4')[:] = _packed(colours[band], blue_first)
            return _write_points(x, y[band], depth, image, quality, points[band])

        return all(in_bands(write_band, height, width))

    return StackCloud(
        points=write_float_cloud(header, (height, width), FIELDS if colours is None else (*FIELDS, COLOUR), write),
        image=encode_image(header, result.image if colours is None else colours, blue_first=blue_first),
        frames=frames,
        preview=preview,
        reasons=result.reasons,
        depth_of_field=result.depth_of_field,
        warning=warning,
        flicker=result.flicker,
        speed=speed,
        focus_step=result.step,
        drift=result.drift,
        registered=result.registered,
    )


def fields_of(encoding: str) -> tuple[str, ...]:
    """The fields of the cloud of a stack of images of this encoding."""
    return (*FIELDS, COLOUR) if encoding in COLOUR_ENCODINGS else FIELDS


def _packed(colours: npt.NDArray[np.uint8], blue_first: bool) -> npt.NDArray[np.uint32]:
    """The colours of each point, (H, W, 3), in the bytes of one number."""
    red, green, blue = np.moveaxis(colours[..., ::-1] if blue_first else colours, -1, 0).astype(np.uint32)
    packed: npt.NDArray[np.uint32] = (red << 16) | (green << 8) | blue
    return packed


@kernel
def _write_points(
    x: npt.NDArray[np.float32],
    y: npt.NDArray[np.float32],
    depth: npt.NDArray[np.float64],
    image: Frame,
    quality: npt.NDArray[np.float32],
    points: npt.NDArray[np.float32],
) -> bool:
    """Write x, y, z, intensity and quality of each point, (H, W, 5); returns whether each z is a number."""
    dense = True
    for row in range(points.shape[0]):
        for column in range(points.shape[1]):
            z = np.float32(depth[row, column])
            dense &= not np.isnan(z)
            points[row, column, 0] = x[column]
            points[row, column, 1] = y[row]
            points[row, column, 2] = z
            points[row, column, 3] = np.float32(image[row, column])
            points[row, column, 4] = quality[row, column]
    return dense
