"""Focus stacks from image files, and into recordings: frames and joint states."""

import os
from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np
import numpy.typing as npt

from socialcircle_ros import interface
from socialcircle_ros.errors import ImportFileError, RecordingError
from socialcircle_ros.interface import NodeTopic
from socialcircle_ros.messages import image, joint_state
from socialcircle_ros.messages.gray import GrayImage
from socialcircle_ros.messages.header import Header
from socialcircle_ros.settings import RosValue, yaml_text
from socialcircle_ros.storage import Unfinished

from .importers import load_npz
from .reader import natural_order
from .topics import Topic, offered_qos, ros_topic
from .writer import RecordingWriter

FRAME_ID = 'microscope'
JOINT = 'stage_z'
FRAMES, JOINT_STATES = interface.STACK_FRAMES.within(''), interface.STACK_JOINT_STATES.within('')

IMAGE_SUFFIXES = ('.png', '.tif', '.tiff', '.jpg', '.jpeg', '.bmp')


@dataclass(frozen=True)
class ImportedStack:
    """A focus stack from a file or a folder.

    Attributes:
        name: of the file or folder.
        z: (N,) position of the stage at each frame, in the unit of the file or in steps.
        images: the frames, (H, W) uint8 or uint16 each, or the files that hold them.
    """

    name: str
    z: npt.NDArray[np.float64]
    images: Sequence[Path] | GrayImage

    def frames(self) -> Iterator[GrayImage]:
        """Yield the frames, (H, W) each; frames from files are loaded one at a time.

        Raises:
            ImportFileError: a file cannot be read, or Pillow is not installed.
        """
        for item in self.images:
            yield _read_image(item) if isinstance(item, Path) else item


def is_stack(path: Path) -> bool:
    """Whether a path is a folder, or an `.npz` archive with frames."""
    if path.is_dir():
        return True
    return path.suffix.lower() == '.npz' and path.is_file() and 'frames' in load_npz(path)


def import_stack(path: Path) -> ImportedStack:
    """Read a focus stack: an `.npz` archive with `frames` (N, H, W) and `z` (N,), or a folder of images.

    The images of a folder are read in the natural order of their names (9 before 10), with z = 0, 1, 2, …

    Raises:
        ImportFileError: the path holds no such stack; the message says what to do.
    """
    if path.is_dir():
        files = sorted(
            (file for file in path.iterdir() if file.suffix.lower() in IMAGE_SUFFIXES), key=natural_order
        )
        if len(files) < 3:
            raise ImportFileError(
                f'{path} holds {len(files)} images ({", ".join(IMAGE_SUFFIXES)}); a focus stack needs 3.'
            )
        return ImportedStack(path.name, np.arange(len(files), dtype=np.float64), files)
    arrays = load_npz(path)
    frames, z = arrays.get('frames'), arrays.get('z')
    if frames is None or frames.ndim != 3 or frames.dtype not in (np.uint8, np.uint16):
        raise ImportFileError(f'{path} needs an array frames (N, rows, columns) of uint8 or uint16.')
    if z is None or z.shape != frames.shape[:1] or z.dtype.kind not in 'fiu' or not np.isfinite(z).all():
        raise ImportFileError(f'{path} needs an array z: one finite number for each of its {len(frames)} frames.')
    return ImportedStack(path.stem, z.astype(np.float64), cast('GrayImage', frames))


def add_stack_topics(writer: RecordingWriter) -> None:
    """Add the topics of frames and joint states."""
    writer.add_topic(_topic(interface.STACK_FRAMES))
    writer.add_topic(_topic(interface.STACK_JOINT_STATES))


def write_frame(writer: RecordingWriter, stamp: int, pixels: GrayImage) -> None:
    """Write one frame.

    Args:
        writer: the recording.
        stamp: the time of the frame, ns.
        pixels: (H, W) uint8 or uint16.
    """
    writer.write(FRAMES, image.encode_image(Header.at(stamp, FRAME_ID), pixels), stamp)


def write_joint_state(writer: RecordingWriter, stamp: int, z: float) -> None:
    """Write one position of the stage.

    Args:
        writer: the recording.
        stamp: the time of the position, ns.
        z: the position, m.
    """
    state = joint_state.JointState(Header.at(stamp, ''), [JOINT], [z])
    writer.write(JOINT_STATES, state.encode(), stamp)


def node_parameters(frames: int, pitch_x: float, pitch_y: float) -> dict[str, RosValue]:
    """The parameters for the node to measure the stack of such a recording.

    Args:
        frames: of the stack.
        pitch_x: distance of two pixels along x, m.
        pitch_y: distance of two pixels along y, m.

    Returns:
        Full parameter names to values.
    """
    return {
        'stack.pitch_x': pitch_x,
        'stack.pitch_y': pitch_y,
        'stack.z_source': 'joint_states',
        'stack.joint': JOINT,
        'stack.frames': frames,
    }


@contextmanager
def parameter_file(
    recording: Path, values: Mapping[str, RosValue], *, overwrite: bool = False
) -> Generator[Path, None, None]:
    """Write the parameters that measure a stack beside its recording.

    The file gets its name at the end of the block, so that there are both the recording and the file, or neither.

    Args:
        recording: of the stack; the file has its name, with the suffix `.yaml`.
        values: as from `node_parameters`.
        overwrite: whether to replace a file that is there.

    Yields:
        The path of the file.

    Raises:
        RecordingError: the file exists already, or cannot be written.
    """
    path = recording.with_suffix('.yaml')
    exists = RecordingError(f'{path} exists already: give another name, or overwrite it with --overwrite.')
    if os.path.lexists(path) and not overwrite:
        raise exists
    try:
        file = Unfinished(path)
        file.write(yaml_text(values, whole=False))
    except OSError as error:
        raise RecordingError(f'{path} cannot be written: {error.strerror}.') from None
    with file:
        yield path
        try:
            file.complete(replace=overwrite)
        except FileExistsError:
            raise exists from None
        except OSError as error:
            raise RecordingError(f'{path} cannot be written: {error.strerror}.') from None


def _topic(topic: NodeTopic) -> Topic:
    """The topic with the depth of the node: a stack needs every message, not only the newest one."""
    return ros_topic(topic.within(''), topic.type, offered_qos(topic.depth))


def _read_image(path: Path) -> GrayImage:
    """Read one image in gray.

    Raises:
        ImportFileError: the file cannot be read, or Pillow is not installed.
    """
    try:
        from PIL import Image  # noqa: PLC0415 - an extra
    except ImportError:
        raise ImportFileError('Images need Pillow: pip install "socialcircle_ros[pictures]".') from None
    try:
        with Image.open(path) as opened:
            if opened.mode.startswith('I;16'):
                return np.asarray(opened).astype(np.uint16)
            return np.asarray(opened.convert('L'))
    except (OSError, ValueError, SyntaxError):
        raise ImportFileError(f'{path} is not a readable image; save it as PNG or TIFF.') from None
