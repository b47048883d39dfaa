# SPDX-License-Identifier: Apache-2.0
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
from socialcircle_ros.formats import suffixes
from socialcircle_ros.interface import NodeTopic
from socialcircle_ros.messages import image, joint_state
from socialcircle_ros.messages.gray import GrayImage
from socialcircle_ros.messages.header import Header
from socialcircle_ros.settings import RosValue, yaml_text
from socialcircle_ros.storage import Unfinished

from .frame_names import Order, ZFrom, order_frames
from .names import is_mcap_name, parameters_beside
from .npz import open_npz
from .pictures import SUFFIXES, TIFF_SUFFIXES, FramePicture, ImagePage, page_count, read_pictures
from .reader import natural_order
from .tiff import read_tiff_stack
from .topics import Topic, offered_qos, ros_topic
from .writer import RecordingWriter

FRAME_ID = 'microscope'
JOINT = 'stage_z'
FRAMES, JOINT_STATES = interface.STACK_FRAMES.within(''), interface.STACK_JOINT_STATES.within('')

_LEAST = 3  # frames of a stack
_MOST_LISTED = 5  # files in a note


@dataclass(frozen=True, eq=False)
class ImportedStack:
    """A focus stack from a file or a folder.

    Attributes:
        name: of the file or folder.
        z: (N,) position of the stage at each frame: in metres, or in the unit of the file or in steps.
        images: the frames, (N, H, W) uint8 or uint16, or the pages of the files that hold them.
        in_metres: whether z is in metres.
        pitch: distances of two pixels along x and y in metres; None if the file does not say it.
        notes: what was taken and what was passed over, one sentence each.
    """

    name: str
    z: npt.NDArray[np.float64]
    images: Sequence[ImagePage] | GrayImage
    in_metres: bool = False
    pitch: tuple[float, float] | None = None
    notes: tuple[str, ...] = ()

    def pictures(self) -> Iterator[tuple[str, FramePicture]]:
        """Yield the name and the pixels of each frame; frames from files are loaded one at a time.

        Raises:
            ImportFileError: a file cannot be read, or Pillow is not installed.
        """
        if isinstance(self.images, np.ndarray):
            for number, pixels in enumerate(self.images):
                native = pixels.astype(pixels.dtype.newbyteorder('='), copy=False)
                yield f'frame {number}', FramePicture(native, f'gray, {8 * native.itemsize} bits')
        else:
            for page, picture in zip(self.images, read_pictures(self.images), strict=True):
                yield str(page), picture

    def frames(self) -> Iterator[GrayImage]:
        """Yield the pixels of each frame, (H, W), as `pictures`."""
        return (picture.pixels for _, picture in self.pictures())


def is_stack(path: Path) -> bool:
    """Whether a path is a folder, an `.npz` archive with frames, or a TIFF with several pages.

    Raises:
        ImportFileError: the file cannot be read.
    """
    if path.is_dir():
        return True
    if not path.is_file():
        return False
    if path.suffix.lower() in TIFF_SUFFIXES:
        return page_count(path) > 1
    if path.suffix.lower() != '.npz':
        return False
    with open_npz(path) as archive:
        return 'frames' in archive.headers


def import_stack(path: Path, *, z_from: ZFrom = 'auto', order: Order = 'auto') -> ImportedStack:
    """Read a focus stack.

    Args:
        path: an `.npz` archive with `frames` (N, H, W) and `z` (N,), a TIFF with pages, or a folder of images.
        z_from: for a folder or a TIFF, where z comes from.
        order: for a folder, how its images are sorted if z does not come from their names.

    Raises:
        ImportFileError: the path holds no such stack, or z or the order is not certain; the message says what to
            do.
    """
    if path.is_dir():
        return _folder_stack(path, z_from, order)
    if order != 'auto':
        raise ImportFileError(f'--order is for a folder of images, and {path} is a file: leave it out.')
    if path.suffix.lower() in TIFF_SUFFIXES:
        return _tiff_stack(path, z_from)
    if z_from != 'auto':
        raise ImportFileError(f'--z-from is for images, and {path} holds z: leave it out.')
    return _npz_stack(path)


def _npz_stack(path: Path) -> ImportedStack:
    with open_npz(path) as archive:
        frames, z = archive.headers.get('frames'), archive.headers.get('z')
        if frames is None or len(frames.shape) != 3 or frames.dtype.kind != 'u' or frames.dtype.itemsize > 2:
            raise ImportFileError(f'{path} needs an array frames (N, rows, columns) of uint8 or uint16.')
        needed = f'{path} needs an array z: one finite number for each of its {frames.shape[0]} frames.'
        if z is None or z.shape != frames.shape[:1] or z.dtype.kind not in 'fiu':
            raise ImportFileError(needed)
        places = archive.load('z').astype(np.float64)
        if not np.isfinite(places).all():
            raise ImportFileError(needed)
        return ImportedStack(path.stem, places, cast('GrayImage', archive.load('frames')))


def _tiff_stack(path: Path, z_from: ZFrom) -> ImportedStack:
    if z_from == 'name':
        raise ImportFileError(f'--z-from name is for a folder of images, and {path} is a file.')
    stack = read_tiff_stack(path)
    if len(stack.pages) < _LEAST:
        raise ImportFileError(f'{path} holds {len(stack.pages)} pages; a focus stack needs {_LEAST}.')
    pages = [ImagePage(path, number) for number in stack.pages]
    if z_from == 'file' and stack.z is None:
        raise ImportFileError(f'{path} does not say the z of its pages: give --z-step.')
    if stack.z is not None and z_from != 'order':
        return ImportedStack(path.stem, np.array(stack.z), pages, True, stack.pitch, stack.notes)
    notes = (*stack.notes, 'the pages are taken in their order, one z-step apart')
    return ImportedStack(path.stem, np.arange(len(pages), dtype=np.float64), pages, False, stack.pitch, notes)


def _folder_stack(folder: Path, z_from: ZFrom, order: Order) -> ImportedStack:
    if z_from == 'file':
        raise ImportFileError(f'--z-from file is for a TIFF with pages, and {folder} is a folder.')
    entries = sorted(folder.iterdir(), key=natural_order)
    images = [entry for entry in entries if entry.suffix.lower() in SUFFIXES and entry.is_file()]
    files = [file for file in images if not file.name.startswith('.')]
    notes = []
    if len(files) < len(images):
        notes.append(f'hidden files are passed over: {len(images) - len(files)}, such as {images[0].name}')
    others = [entry.name for entry in entries if entry not in images]
    if others:
        listed = ', '.join(others[:_MOST_LISTED]) + (', …' if len(others) > _MOST_LISTED else '')
        notes.append(f'what is no image is passed over: {listed}')
    with_pages = [file for file in files if file.suffix.lower() in TIFF_SUFFIXES and page_count(file) > 1]
    if with_pages and len(files) == 1:
        return _tiff_stack(files[0], z_from)
    if with_pages:
        raise ImportFileError(
            f'{folder} has {with_pages[0].name} with several pages beside other images: import it by itself, or'
            ' split it.'
        )
    if len(files) < _LEAST:
        raise ImportFileError(
            f'{folder} holds {len(files)} image{"" if len(files) == 1 else "s"} ({", ".join(SUFFIXES)}); a focus'
            f' stack needs {_LEAST}.{_measurements_among(entries)}'
        )
    named = order_frames(folder, files, z_from, order)
    pages = [ImagePage(file) for file in named.files]
    return ImportedStack(folder.name, np.array(named.z), pages, named.in_metres, None, (*notes, *named.notes))


def _measurements_among(entries: Sequence[Path]) -> str:
    """A sentence on the measurement files in a folder, with what reads them; '' without any."""
    known = set(suffixes(written=False)) - set(SUFFIXES)
    count = sum(entry.suffix.lower() in known for entry in entries)
    advice = 'name each of them, or give the folder to `socialcircle batch`'
    return f' Its measurement files ({count}) are no frames: {advice}.' if count else ''


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
        recording: of the stack; `parameters_beside` names the file.
        values: as from `node_parameters`.
        overwrite: whether to replace a file that is there.

    Yields:
        The path of the file.

    Raises:
        RecordingError: the file exists already or cannot be written, or the recording has no name of one.
    """
    is_mcap_name(recording)  # a wrong name is told before anything else
    path = parameters_beside(recording)
    what = f'{path}, where the parameters of the stack in {recording.name} are written,'
    exists = RecordingError(f'{what} exists already: give another name, or overwrite both with --overwrite.')
    if os.path.lexists(path) and not overwrite:
        raise exists
    try:
        file = Unfinished(path)
        file.write(yaml_text(values, whole=False))
    except OSError as error:
        raise RecordingError(f'{what} cannot be written: {error.strerror}.') from None
    with file:
        yield path
        try:
            file.complete(replace=overwrite)
        except FileExistsError:
            raise exists from None
        except OSError as error:
            raise RecordingError(f'{what} cannot be written: {error.strerror}.') from None


def _topic(topic: NodeTopic) -> Topic:
    """The topic with the depth of the node: a stack needs every message, not only the newest one."""
    return ros_topic(topic.within(''), topic.type, offered_qos(topic.depth))
