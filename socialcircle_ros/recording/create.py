# SPDX-License-Identifier: Apache-2.0
"""New recordings from measurement files and from simulated stacks."""

import numbers
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from socialcircle_ros.arguments import Compression, OneOrSeveral, several
from socialcircle_ros.cloud import PitchLike
from socialcircle_ros.errors import ImportFileError, SettingError, shown
from socialcircle_ros.lengths import known_unit, unit_name
from socialcircle_ros.messages import point_cloud
from socialcircle_ros.messages.header import Header
from socialcircle_ros.simulation import Simulation
from socialcircle_ros.storage import folder_of_results

from .frame_checks import FrameChecks
from .frame_names import Order, ZFrom
from .importers import ImportedCloud, import_cloud
from .origins import FileOrigin, in_metres, origin_of
from .pictures import FramePicture
from .simulated import pitch_of, write_simulation
from .stacks import (
    ImportedStack,
    add_stack_topics,
    import_stack,
    node_parameters,
    parameter_file,
    write_frame,
    write_joint_state,
)
from .topics import ros_topic
from .units import with_unit
from .writer import RecordingWriter

_FRAMES_PER_PERIOD = 50
_END_S = 2**31  # a stamp of ROS has seconds in 32 bits with a sign
_TOPIC = re.compile(r'(/[A-Za-z_][A-Za-z0-9_]*)+')


class StackRecording(NamedTuple):
    """A recording of one focus stack that was written.

    Attributes:
        frames: number of frames.
        parameters: the parameter file with which the node measures the stack.
        pitch: distances of two pixels along x and y on the part, in m.
    """

    frames: int
    parameters: Path
    pitch: tuple[float, float]


@dataclass(frozen=True, eq=False)
class ImportedFrame:
    """A frame that was written.

    Attributes:
        number: of the frame, counted from 0.
        name: of its file and page.
        z: in m.
        picture: its pixels, and what the file holds.
    """

    number: int
    name: str
    z: float
    picture: FramePicture


def record_clouds(
    files: OneOrSeveral[str | Path],
    output: str | Path,
    *,
    topic: str = '/points',
    frame_id: str = 'microscope',
    period_s: float = 1.0,
    shape: tuple[int, int] | None = None,
    pitch: PitchLike | None = None,
    unit: str | None = None,
    keep_unit: bool = False,
    keep_changed: bool = True,
    overwrite: bool = False,
    written: Callable[[Path, ImportedCloud, FileOrigin], None] | None = None,
) -> None:
    """Write a recording with one cloud per measurement file, in m, and with the name, unit and time of each file.

    Clouds whose unit is not known keep their numbers.

    Args:
        files: measurement files that `import_cloud` reads, in the order of the recording.
        output: a name that ends in `.mcap`, or a directory; its folder is created.
        topic: topic of the clouds.
        frame_id: frame of the clouds.
        period_s: time between two clouds; the first stamp is one period.
        shape: (rows, columns) of PLY and PCD files that do not state it.
        pitch: dx and dy of files that do not state them.
        unit: of files that do not name it.
        keep_unit: whether clouds keep the unit of their file.
        keep_changed: whether the recording keeps when each file was last changed.
        overwrite: whether to replace an existing recording.
        written: called with each file, its cloud as it is written, and where that comes from.

    Raises:
        SettingError: the period is not above 0 or too long, or ROS allows no such topic.
        ImportFileError: there is no file, or one cannot be used.
        RecordingError: the recording cannot be written.
        SocialCircleError: its folder cannot be created.
    """
    paths = [Path(each) for each in several(files)]
    if not paths:
        raise ImportFileError(f'{output} would be empty: give at least one measurement file.')
    _check_period(period_s, len(paths))
    _check_topic(topic)
    with folder_of_results(Path(output).parent), RecordingWriter(output, overwrite=overwrite) as writer:
        before: str | None = None
        for number, path in enumerate(paths):
            cloud = import_cloud(path, shape=shape, pitch=pitch, unit=unit)
            cloud = replace(cloud, unit=known_unit(cloud.unit) or cloud.unit)
            stamp = round((number + 1) * period_s * 1e9)
            origin = origin_of(cloud, topic, stamp, path.name, given=unit is not None)
            if keep_changed:
                origin = replace(origin, changed_ns=path.stat().st_mtime_ns)
            if not keep_unit:
                cloud, rounding = in_metres(cloud)
                origin = replace(origin, converted=cloud.unit != origin.unit, rounding=rounding)
            if number and cloud.unit != before:
                raise ImportFileError(
                    f'{path} is in {_unit_text(cloud.unit)}, but the files before it are in {_unit_text(before)}:'
                    ' import them into recordings of their own.'
                )
            before = cloud.unit
            write_cloud(writer, topic, cloud, stamp=stamp, frame_id=frame_id)
            for record in origin.records():
                writer.add_metadata(record)
            if written is not None:
                written(path, cloud, origin)


def _check_period(period_s: float, periods: float) -> None:
    """Check that the stamps of a recording are times of ROS.

    Raises:
        SettingError: they are not.
    """
    is_number = isinstance(period_s, numbers.Real) and not isinstance(period_s, bool)
    if not (is_number and period_s > 0 and period_s < _END_S / periods):
        raise SettingError(
            'The period must be above 0 s, and the last stamp below 2³¹ s, as ROS holds it; the period cannot be'
            f' {shown(period_s)}{" s" if is_number else ""}.'
        )


def _check_topic(topic: str) -> None:
    """Check that a topic has a full name.

    Raises:
        SettingError: it has not.
    """
    if not isinstance(topic, str) or not _TOPIC.fullmatch(topic):
        raise SettingError(
            f'{shown(topic)} is not the name of a topic: use letters, digits, _ and /, as in /cell/points; it'
            ' begins with /, no part of it is empty, and none begins with a digit.'
        )


def _unit_text(unit: str | None) -> str:
    return unit_name(unit) if unit else 'a unit that it does not name'


def write_cloud(writer: RecordingWriter, topic: str, cloud: ImportedCloud, *, stamp: int, frame_id: str) -> None:
    """Write an imported cloud as a PointCloud2, with the stamp in ns also as its log time."""
    writer.add_topic(with_unit(ros_topic(topic, point_cloud.TYPE), cloud.unit))
    message = point_cloud.encode_point_cloud(Header.at(stamp, frame_id), cloud.points, cloud.fields)
    writer.write(topic, message, stamp)


def record_stack(
    path: str | Path,
    output: str | Path,
    *,
    pitch: float | None = None,
    z_step: float | None = None,
    z_from: ZFrom = 'auto',
    order: Order = 'auto',
    period_s: float = 1.0,
    overwrite: bool = False,
    written: Callable[[ImportedFrame], None] = lambda frame: None,
    tell: Callable[[str], None] = lambda sentence: None,
) -> StackRecording:
    """Write a recording of one focus stack, and beside it the parameters that measure it.

    Args:
        path: an `.npz` archive with `frames` (N, rows, columns) and `z` (N,), a TIFF with pages, or a folder of
            images.
        output: a name that ends in `.mcap`, or a directory; its folder is created. The parameter file has the same
            name with `.yaml`.
        pitch: distance of two pixels on the part, in m; None: as the file says.
        z_step: length of one unit of the stack's z, in m; negative if z points away from the objective. None: the
            file says z in metres.
        z_from: where z comes from, for images.
        order: how the images of a folder are sorted, if z does not come from their names.
        period_s: time of 50 frames.
        overwrite: whether to replace an existing recording and its parameters.
        written: called with each frame.
        tell: called with each sentence on what was taken and what was passed over.

    Raises:
        SettingError: the period is not above 0 or too long.
        ImportFileError: the stack cannot be used, its order or z is not certain, a frame does not belong to it, or
            its pitch or step is missing.
        RecordingError: the recording or the parameter file cannot be written, or exists already.
        SocialCircleError: their folder cannot be created.
    """
    path = Path(path)
    stack = import_stack(path, z_from=z_from, order=order)
    pitch_x, pitch_y, metres = _lengths(path, stack, pitch, z_step)
    for note in stack.notes:
        tell(note)
    if pitch and stack.pitch:
        tell(f'the file says a pitch of {stack.pitch[0]:g} m; --pitch {pitch:g} is taken')
    _check_period(period_s, len(stack.z) / _FRAMES_PER_PERIOD)
    checks = FrameChecks()
    values = node_parameters(len(stack.z), pitch_x, pitch_y)
    with (
        folder_of_results(Path(output).parent),
        parameter_file(Path(output), values, overwrite=overwrite) as parameters,
        RecordingWriter(output, compression='zstd', overwrite=overwrite) as writer,
    ):
        add_stack_topics(writer)
        for number, (z, (name, picture)) in enumerate(zip(stack.z, stack.pictures(), strict=True)):
            checks.take(name, picture)
            stamp = round((number + 1) * period_s * 1e9 / _FRAMES_PER_PERIOD)
            write_joint_state(writer, stamp, float(z) * metres)
            write_frame(writer, stamp, picture.pixels)
            written(ImportedFrame(number, name, float(z) * metres, picture))
        checks.finish()
    return StackRecording(len(stack.z), parameters, (pitch_x, pitch_y))


def _lengths(
    path: Path, stack: ImportedStack, pitch: float | None, z_step: float | None
) -> tuple[float, float, float]:
    """The pitches along x and y, and the length of one unit of z, all in m.

    Raises:
        ImportFileError: one is missing, or z is given twice.
    """
    missing = [] if pitch or stack.pitch else ['--pitch']
    if not stack.in_metres and not z_step:
        missing.append('--z-step')
    if missing or (pitch or 0) < 0:
        raise ImportFileError(
            f'{path} is a focus stack: give {" and ".join(missing or ["--pitch"])} in metres, such as 1e-6.'
        )
    if stack.in_metres and z_step:
        raise ImportFileError(
            f'{path} says z itself: leave --z-step out, or give --z-from order to take the frames as evenly'
            ' spaced.'
        )
    pitch_x, pitch_y = (pitch, pitch) if pitch else stack.pitch or (0.0, 0.0)
    return pitch_x, pitch_y, 1.0 if stack.in_metres else z_step or 0.0


def record_simulation(
    simulation: Simulation,
    output: str | Path,
    *,
    compression: Compression = 'zstd',
    overwrite: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> StackRecording:
    """Write a recording of a simulated focus stack with its truth, and beside it the parameters that measure it.

    Args:
        simulation: the stack; its frames are rendered while they are written.
        output: a name that ends in `.mcap`, or a directory; its folder is created. The parameter file has the same
            name with `.yaml`.
        compression: compression of the recording's chunks.
        overwrite: whether to replace an existing recording and its parameters.
        progress: called with the number of written frames and the number of all frames.

    Raises:
        RecordingError: the recording or the parameter file cannot be written, or exists already.
        SocialCircleError: their folder cannot be created.
    """
    total, pitch = len(simulation), pitch_of(simulation)

    def done(frames: int) -> None:
        if progress is not None:
            progress(frames, total)

    with (
        folder_of_results(Path(output).parent),
        parameter_file(Path(output), node_parameters(total, *pitch), overwrite=overwrite) as parameters,
        RecordingWriter(output, compression=compression, overwrite=overwrite) as writer,
    ):
        write_simulation(simulation, writer, done)
    return StackRecording(total, parameters, pitch)
