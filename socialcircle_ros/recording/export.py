# SPDX-License-Identifier: Apache-2.0
"""The way out: clouds of a recording as files of other programs, and one file filtered into another."""

import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.arguments import OneOrSeveral, several
from socialcircle_ros.cloud import measured_only
from socialcircle_ros.errors import CloudError, MessageError, RecordingError, SocialCircleError, install_command
from socialcircle_ros.formats import Format, OrganizedCloud, format_of, suffixes, write_cloud_file
from socialcircle_ros.interface import FILTERED, MASK, MEASUREMENT, POINTS, REPAIRED, MeasurementValues, NodeTopic
from socialcircle_ros.lengths import from_metres
from socialcircle_ros.messages import diagnostics
from socialcircle_ros.messages.header import stamp_of, stamp_text
from socialcircle_ros.messages.image import NOT_MEASURED, decode_mono8
from socialcircle_ros.messages.point_cloud import DATATYPES, PointCloud
from socialcircle_ros.pipeline.limits import IN_UNIT_OF_CLOUD
from socialcircle_ros.settings import PARAMETERS, PipelineSettings
from socialcircle_ros.storage import check_folder_name, check_place, folder_of_results, kind_of_target, write_file

from .any_file import is_measurement_file, open_recording
from .offline import Filtered, Seen, Summary, clouds_of, filter_recording
from .origins import origins_of
from .reader import RecordingReader
from .topics import Message
from .units import unit_of

if TYPE_CHECKING:
    from socialcircle_ros.cloud import Cloud


_KEYS = MeasurementValues.keys()


@dataclass
class Export:
    """What was exported.

    Attributes:
        files: the written files, in the order of the recording.
        notes: number of clouds by what their files do not hold.
        refused: number of clouds that a file cannot hold, by reason.
        filtered: whether cleaned clouds were exported; False: the recording holds none, so its clouds were.
        damage: where the recording breaks off; None: it is sound.
    """

    files: list[Path] = field(default_factory=list)
    notes: dict[str, int] = field(default_factory=dict)
    refused: dict[str, int] = field(default_factory=dict)
    filtered: bool = True
    damage: str | None = None


def export_recording(
    recording: str | Path,
    folder: str | Path,
    suffix: str,
    *,
    topics: OneOrSeveral[str] = (),
    unit: str | None = None,
    overwrite: bool = False,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Export:
    """Write the clouds of a recording as files, with their unit, and the settings of the filter, as metadata.

    Imported clouds are written in the unit of their file, bit for bit as they were.

    Cleaned clouds have their outlier mask with them: as the field `outlier_mask` where the format has fields, else
    as a PNG beside the file, in both cases 0 kept, 255 outlier, 127 not measured.

    Args:
        recording: an MCAP file, a rosbag2 directory, or a measurement file.
        folder: where the files are written, with a name without a suffix of a file; it is created, and removed
            again if nothing is written.
        suffix: of the format, such as `.ply`.
        topics: topics of clouds; none: cleaned and repaired clouds, or the clouds themselves if there are none.
        unit: of the clouds, where the recording does not say.
        overwrite: whether to replace existing files.
        progress: called with the number of clouds read so far, and of all.

    Raises:
        RecordingError: the recording cannot be read, or holds no clouds.
        SocialCircleError: the format is not written, the folder has the name of a file, or a file exists already
            or cannot be written.
    """
    folder, form = Path(folder), format_of(Path(f'a{suffix}'))
    if form is None or not form.writes:
        raise SocialCircleError(f'{suffix} is not written: choose one of {", ".join(suffixes(written=True))}.')
    check_folder_name(folder)
    export = Export()
    with open_recording(recording) as reader, folder_of_results(folder):
        chosen = _chosen(reader, several(topics), export)
        clouds = _Clouds(reader, unit)
        counts, total = dict.fromkeys(chosen, 0), reader.count(chosen)
        with folder_of_results(folder):
            for done, message in enumerate(reader.messages(chosen), 1):
                stem = f'{message.topic.strip("/").replace("/", "_")}_{counts[message.topic]:04d}'
                counts[message.topic] += 1
                _export_one(clouds, message, folder / f'{stem}{suffix}', export, overwrite=overwrite)
                progress(done, total)
        export.damage = reader.damage
    return export


def filter_to_file(
    source: str | Path,
    target: str | Path,
    settings: PipelineSettings,
    *,
    topics: OneOrSeveral[str] = (),
    overwrite: bool = False,
    seen: Seen = lambda message: None,
    filtered: Filtered | None = None,
) -> tuple[Summary, tuple[str, ...]]:
    """Filter the one cloud of a measurement file, or of a recording, into a measurement file.

    Args:
        source: a measurement file, or a recording with one cloud.
        target: the file with the cleaned cloud, of a format that is written; its folder is created.
        settings: how to filter.
        topics: as in `filter_recording`.
        overwrite: whether to replace an existing file.
        seen: as in `filter_recording`.
        filtered: as in `filter_recording`.

    Returns:
        What was done, and one sentence for each thing that the format cannot hold.

    Raises:
        RecordingError: the source cannot be read, or does not hold one cloud.
        SocialCircleError: the file cannot be written, or cannot hold the cloud.
    """
    source, target = Path(source), Path(target)
    form = format_of(target)
    if form is None or not form.writes:
        raise SocialCircleError(
            f'{target} cannot be written: its suffix must be .mcap or one of {", ".join(suffixes(written=True))}.'
        )
    if target.exists() and source.exists() and target.samefile(source):
        raise SocialCircleError(f'{target} is the file that is to be filtered: give another name.')
    if kind_of_target(target) == 'a file' and not overwrite:
        raise SocialCircleError(f'{target} exists already: give another name, or --overwrite.')
    with folder_of_results(target.parent), TemporaryDirectory(prefix='socialcircle-') as folder:
        check_place(target)
        between = Path(folder) / f'{source.stem}.mcap'
        summary = filter_recording(source, between, settings, topics=topics, seen=seen, filtered=filtered)
        if summary.clouds == 0:
            return summary, ()
        with open_recording(between) as reader:
            names = [name for name in reader.topics if FILTERED.namespace_of(name) is not None]
            messages = list(reader.messages(names))
            if len(messages) != 1:
                raise RecordingError(
                    f'{source} has {len(messages)} clouds, and a {target.suffix} file holds one: write a recording'
                    ' (-o cleaned.mcap), then socialcircle export cleaned.mcap -o FOLDER.'
                )
            cloud, mask = _Clouds(reader, None, source.name).read(messages[0])
            return summary, write_cloud_file(target, _masked(cloud, mask, form), overwrite=overwrite)


def is_file_target(path: Path) -> bool:
    """Whether the name of a result means a measurement file, and not a recording."""
    return is_measurement_file(path)


def _chosen(reader: RecordingReader, topics: tuple[str, ...], export: Export) -> tuple[str, ...]:
    """The topics to export.

    Raises:
        RecordingError: there is none, or one that was asked for holds no clouds.
    """
    clouds = [name for name, topic in reader.topics.items() if topic.type == POINTS.type]
    for name in topics:
        if name not in clouds:
            listed = ', '.join(sorted(clouds)) or 'no topic of clouds'
            raise RecordingError(f'{reader.path} has no topic {name} of clouds; it has {listed}.')
    cleaned = tuple(
        name for name in clouds if any(each.namespace_of(name) is not None for each in (FILTERED, REPAIRED))
    )
    found = topics or cleaned
    if not found:
        export.filtered = False
        found = clouds_of(reader)
    if not found:
        raise RecordingError(
            f'{reader.path} has no clouds to export; the clouds of focus stacks are made by socialcircle filter.'
        )
    return found


class _Clouds:
    """Reads the clouds of a recording with what belongs to them."""

    def __init__(self, reader: RecordingReader, unit: str | None, source: str | None = None) -> None:
        """Read the masks and measurements; they are kept compressed, because there may be many.

        Args:
            reader: the recording.
            unit: of the clouds, where the recording does not say.
            source: the name of the file that the clouds come from; None: that of the recording.
        """
        self._reader, self._unit, self._source = reader, unit, source or reader.path.name
        self._origins = origins_of(reader)
        self._masks = self._companions(MASK, stamp_of)
        self._measurements = self._companions(MEASUREMENT, _stamp_of_status)

    def read(self, message: Message) -> tuple[OrganizedCloud, NDArray[np.uint8] | None]:
        """A cloud with its unit and metadata, and its mask if it is a cleaned one.

        An imported cloud is in the unit of its file, with the numbers of the file.

        Raises:
            MessageError: the message is not an organized cloud.
        """
        cloud = PointCloud.decode(message.data)
        points = cast('Cloud', np.array(cloud.xyz()))
        metadata = {
            'source': self._source,
            'topic': message.topic,
            'stamp': stamp_text(cloud.header.stamp),
            'frame_id': cloud.header.frame_id,
        }
        mask = None
        namespaces = [each.namespace_of(message.topic) for each in (FILTERED, REPAIRED)]
        for namespace in namespaces:
            key = (namespace or '', cloud.header.stamp)
            if namespace is not None and key in self._measurements:
                status = diagnostics.Status.decode(zlib.decompress(self._measurements[key]))
                metadata |= {'result': status.message, **status.values}
        namespace = next((each for each in namespaces if each is not None), None)
        key = (namespace or '', cloud.header.stamp)
        if namespace is not None and key in self._masks:
            pixels = np.array(decode_mono8(zlib.decompress(self._masks[key])))
            if pixels.shape == points.shape[:2]:
                points = measured_only(points, pixels != NOT_MEASURED)
                mask = pixels if namespaces[0] is not None else None
        unit = unit_of(self._reader, message.topic) or self._unit
        origin = self._origins.get((message.topic.rpartition('/')[0], cloud.header.stamp))
        if origin is not None:
            metadata |= {'file': origin.file, 'unit of file': origin.unit_text()}
            if origin.converted and unit == 'm':
                points, unit = origin.in_unit_of_file(points), origin.unit
                metadata = _in_unit(metadata, unit or 'm')
        return OrganizedCloud(points, unit, _fields_of(cloud), metadata), mask

    def _companions(self, topic: NodeTopic, stamp: Callable[[bytes], int]) -> dict[tuple[str, int], bytes]:
        names = [name for name in self._reader.topics if topic.namespace_of(name) is not None]
        return {
            (topic.namespace_of(message.topic) or '', stamp(message.data)): zlib.compress(message.data, 1)
            for message in self._reader.messages(names)
        }


def _in_unit(metadata: Mapping[str, str], unit: str) -> dict[str, str]:
    """Metadata with lengths in m, with those that are in the unit of the cloud in its new one."""
    keys = {key.name for key in _KEYS if key.unit == 'cloud'}
    keys |= {name for name, parameter in PARAMETERS.items() if parameter.unit == 'cloud'}
    # The sentences keep their numbers, which are in m.
    converted = {name: text.replace(IN_UNIT_OF_CLOUD, 'in m') for name, text in metadata.items()}
    for name in keys & metadata.keys():
        length = from_metres(np.array(float(metadata[name])), unit)
        converted[name] = f'{float(length):.9g}'
    return converted


def _export_one(clouds: _Clouds, message: Message, path: Path, export: Export, *, overwrite: bool) -> None:
    form = format_of(path)
    try:
        cloud, mask = clouds.read(message)
        notes = write_cloud_file(path, _masked(cloud, mask, form), overwrite=overwrite)
    except (CloudError, MessageError) as refusal:
        export.refused[str(refusal)] = export.refused.get(str(refusal), 0) + 1
        return
    for note in notes:
        export.notes[note] = export.notes.get(note, 0) + 1
    export.files.append(path)
    if mask is not None and form is not None and not form.fields:
        export.files.append(_write_mask(path.with_name(f'{path.stem}_mask.png'), mask, overwrite=overwrite))


def _masked(cloud: OrganizedCloud, mask: NDArray[np.uint8] | None, form: Format | None) -> OrganizedCloud:
    """The cloud with its mask as a field, if the format holds fields."""
    if mask is None or form is None or not form.fields:
        return cloud
    return replace(cloud, fields={**cloud.fields, MASK.name: mask})


def _stamp_of_status(data: bytes) -> int:
    seconds, _, fraction = diagnostics.Status.decode(data).values.get('stamp', '0').partition('.')
    return int(seconds) * 1_000_000_000 + int(fraction.ljust(9, '0'))


def _fields_of(cloud: PointCloud) -> dict[str, NDArray[np.generic]]:
    """The fields of a cloud beside x, y and z, (rows, columns) each, in native byte order."""
    fields: dict[str, NDArray[np.generic]] = {}
    for each in cloud.fields:
        if each.name in ('x', 'y', 'z') or each.datatype not in DATATYPES:
            continue
        kind = np.dtype(('>' if cloud.is_bigendian else '<') + DATATYPES[each.datatype])
        count = max(each.count, 1)
        if each.offset + count * kind.itemsize > cloud.point_step:
            continue
        for place in range(count):
            values: NDArray[np.generic] = np.ndarray(
                (cloud.height, cloud.width),
                kind,
                cloud.message,
                offset=cloud.data_start + each.offset + place * kind.itemsize,
                strides=(cloud.row_step, cloud.point_step),
            )
            name = each.name if count == 1 else f'{each.name}_{place}'
            while name in fields:
                name += '_'
            fields[name] = values.astype(kind.newbyteorder('='))
    return fields


def _write_mask(path: Path, mask: NDArray[np.uint8], *, overwrite: bool) -> Path:
    try:
        from PIL import Image  # noqa: PLC0415 - an extra
    except ImportError:
        raise SocialCircleError(
            f'Masks beside x3p, sdf and tiff need Pillow: {install_command("pictures")}; ply, pcd, npz and csv'
            ' hold the mask themselves.'
        ) from None
    if kind_of_target(path) == 'a file' and not overwrite:
        raise SocialCircleError(f'{path} exists already: give --overwrite to replace it.')
    content = BytesIO()
    Image.fromarray(mask).save(content, 'PNG')
    write_file(path, content.getvalue())
    return path
