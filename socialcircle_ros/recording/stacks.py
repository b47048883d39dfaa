"""Focus stacks into recordings: frames and joint states, with the parameters that measure them."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from socialcircle_ros.errors import ImportFileError
from socialcircle_ros.messages import image, joint_state
from socialcircle_ros.messages.header import Header
from socialcircle_ros.settings import RosValue

from .importers import load_npz
from .reader import natural_order
from .topics import offered_qos, ros_topic
from .writer import RecordingWriter

FRAME_ID = 'microscope'
JOINT = 'stage_z'
FRAMES, JOINT_STATES = '/stack/image', '/stack/joint_states'
FRAME_DEPTH, JOINT_DEPTH = 50, 500
"""Kept by the publisher: of a stack each message counts, not the newest one."""

IMAGES = ('.png', '.tif', '.tiff', '.jpg', '.jpeg', '.bmp')


@dataclass(frozen=True)
class ImportedStack:
    """A focus stack from a file or a folder.

    Attributes:
        name: of the file or folder.
        z: (N,) where the stage was, in steps or whatever unit the file has.
        images: the frames, (H, W) uint8 or uint16 each, or the files that hold them.
    """

    name: str
    z: npt.NDArray[np.float64]
    images: Any

    def frames(self) -> Iterator[npt.NDArray[Any]]:
        """The frames, one in memory at a time where they come from files."""
        for item in self.images:
            yield _read_image(item) if isinstance(item, Path) else item


def is_stack(path: Path) -> bool:
    """Whether a path is a folder of images, or an .npz archive with frames."""
    if path.is_dir():
        return True
    return path.suffix.lower() == '.npz' and path.is_file() and 'frames' in load_npz(path)


def import_stack(path: Path) -> ImportedStack:
    """Read a focus stack: an .npz archive with `frames` (N, H, W) and `z` (N,), or a folder of images.

    The images of a folder are taken in the order of their names (9 before 10), their z being 0, 1, 2 …

    Raises:
        ImportFileError: it is not such a stack; says what to do.
    """
    if path.is_dir():
        files = sorted((file for file in path.iterdir() if file.suffix.lower() in IMAGES), key=natural_order)
        if len(files) < 3:
            raise ImportFileError(
                f'{path} holds {len(files)} images ({", ".join(IMAGES)}); a focus stack needs 3.'
            )
        return ImportedStack(path.name, np.arange(len(files), dtype=np.float64), files)
    arrays = load_npz(path)
    frames, z = arrays.get('frames'), arrays.get('z')
    if frames is None or frames.ndim != 3 or frames.dtype not in (np.uint8, np.uint16):
        raise ImportFileError(f'{path} needs frames of the shape (N, rows, columns), uint8 or uint16.')
    if z is None or z.shape != frames.shape[:1] or z.dtype.kind not in 'fiu' or not np.isfinite(z).all():
        raise ImportFileError(f'{path} needs z: one finite number for each of its {len(frames)} frames.')
    return ImportedStack(path.stem, z.astype(np.float64), frames)


def add_stack_topics(writer: RecordingWriter) -> None:
    """Add the topics of frames and joint states."""
    writer.add_topic(ros_topic(FRAMES, image.TYPE, offered_qos(FRAME_DEPTH)))
    writer.add_topic(ros_topic(JOINT_STATES, joint_state.TYPE, offered_qos(JOINT_DEPTH)))


def write_frame(writer: RecordingWriter, stamp: int, pixels: npt.NDArray[Any]) -> None:
    """Write one frame, (H, W) uint8 or uint16, at a time in ns."""
    writer.write(FRAMES, image.encode_image(Header.at(stamp, FRAME_ID), pixels), stamp)


def write_joint_state(writer: RecordingWriter, stamp: int, z: float) -> None:
    """Write where the stage was, in metres, at a time in ns."""
    state = joint_state.JointState(Header.at(stamp, ''), [JOINT], [z])
    writer.write(JOINT_STATES, state.encode(), stamp)


def node_parameters(frames: int, pitch_x: float, pitch_y: float) -> dict[str, RosValue]:
    """The parameters with which the node measures a stack of these recordings; pitches in metres."""
    return {
        'stack.pitch_x': pitch_x,
        'stack.pitch_y': pitch_y,
        'stack.z_source': 'joint_states',
        'stack.joint': JOINT,
        'stack.frames': frames,
    }


def _read_image(path: Path) -> npt.NDArray[Any]:
    """One image in gray.

    Raises:
        ImportFileError: it cannot be read, or Pillow is not installed.
    """
    try:
        from PIL import Image  # noqa: PLC0415 - an extra, with matplotlib
    except ImportError:
        raise ImportFileError('Images need Pillow: pip install "socialcircle_ros[pictures]".') from None
    try:
        with Image.open(path) as opened:
            if opened.mode.startswith('I;16'):
                return np.asarray(opened).astype(np.uint16)
            return np.asarray(opened.convert('L'))
    except (OSError, ValueError, SyntaxError):
        raise ImportFileError(f'{path} is not an image that can be read; save it as PNG or TIFF.') from None
