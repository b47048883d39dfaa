# SPDX-License-Identifier: Apache-2.0
"""`make_comparison`: one page that shows what two settings do to the same clouds."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from socialcircle_ros.arguments import OneOrSeveral, settings_of, several
from socialcircle_ros.cloud import Mask, measured_only
from socialcircle_ros.digits import share_text
from socialcircle_ros.errors import RecordingError, SettingError, SocialCircleError
from socialcircle_ros.kernels.ordered import in_order
from socialcircle_ros.messages.image import KEPT, NOT_MEASURED, OUTLIER
from socialcircle_ros.messages.point_cloud import PointCloud
from socialcircle_ros.metrics.areal import Texture, texture
from socialcircle_ros.metrics.scores import Scores, score
from socialcircle_ros.pictures.drawings import CloudPictures
from socialcircle_ros.pictures.style import new_figure
from socialcircle_ros.pipeline.clouds import filter_cloud
from socialcircle_ros.pipeline.stacks import Refusal
from socialcircle_ros.recording import open_recording
from socialcircle_ros.recording.named_clouds import NamedCloud, named_clouds, shown_name
from socialcircle_ros.recording.reader import RecordingReader
from socialcircle_ros.recording.truth import truths_of
from socialcircle_ros.recording.units import unit_of
from socialcircle_ros.settings import PARAMETERS, PipelineSettings
from socialcircle_ros.settings.effects import has_effect
from socialcircle_ros.storage import check_place, folder_of_results, lies_in, write_file

from .content import Cell, Column, Item, Picture, Pictures, Section, Table, refusal_text
from .entry import mask_of, texture_text, value_text
from .page import check_page_name, environment, render

_MAKE_CLOUDS = ('focus.', 'stack.')


@dataclass(frozen=True, eq=False)
class ComparedCloud:
    """What two settings did to one cloud.

    Attributes:
        name: topic and number of the cloud, or the name of its file.
        unit: of its lengths; None: not known.
        removed: number of removed points with the first and with the second setting.
        only: number of points that only the first, and only the second setting removed.
        measured: number of measured points.
        textures: of the kept points with each setting.
        scores: against the truth with each setting; None where the truth is not known.
        pictures: the cloud, what each setting keeps, and where they differ.
        warnings: of the results, with the setting that each is of.
    """

    name: str
    unit: str | None
    removed: tuple[int, int]
    only: tuple[int, int]
    measured: int
    textures: tuple[Texture, Texture]
    scores: tuple[Scores, Scores] | None
    pictures: Sequence[Pictures]
    warnings: Sequence[str]

    def section(self, names: tuple[str, str]) -> Section:
        """The section of the cloud on the page."""
        rows: list[list[Cell]] = [
            ['outliers', *(f'{count:,} ({share_text(count / self.measured)})' for count in self.removed)],
            ['removed by this setting only', *(f'{count:,}' for count in self.only)],
        ]
        for key in ('Sa', 'Sq', 'Sz'):
            values = (float(getattr(each, key.lower())) for each in self.textures)
            rows.append([key, *(texture_text(value, self.unit) for value in values)])
        if self.scores is not None:
            one, other = self.scores
            rows += [
                ['precision', f'{one.precision:.4f}', f'{other.precision:.4f}'],
                ['recall', f'{one.recall:.4f}', f'{other.recall:.4f}'],
                ['F1', f'{one.f1:.4f}', f'{other.f1:.4f}'],
            ]
        columns = [Column(''), *map(Column, names)]
        anchor = f'compared {self.name}'.replace(' ', '-').replace('/', '-')
        items: list[Item] = [*self.pictures, Table('', '', columns, rows)]
        return Section(self.name, items=items, warnings=self.warnings, anchor=anchor)


@dataclass(frozen=True)
class ComparedRecording:
    """What two settings did to the clouds of a recording.

    Attributes:
        clouds: those that both settings could filter.
        refused: number of the others, and of refused frames, by reason.
        damage: where the recording is damaged; None if it is intact.
    """

    clouds: Sequence[ComparedCloud]
    refused: Mapping[str, int]
    damage: str | None

    @property
    def warnings(self) -> Sequence[str]:
        """All that a person should know, one sentence each."""
        return [
            *(refusal_text(reason, count) for reason, count in self.refused.items()),
            *([self.damage] if self.damage else []),
            *(f'{cloud.name}: {warning}' for cloud in self.clouds for warning in cloud.warnings),
        ]


def make_comparison(
    recording: str | Path,
    output: str | Path,
    first: tuple[str, PipelineSettings],
    second: tuple[str, PipelineSettings],
    *,
    topics: OneOrSeveral[str] = (),
    progress: Callable[[int, int], None] | None = None,
) -> ComparedRecording:
    """Filter every cloud of a recording with two settings, and write an HTML page that shows both side by side.

    Args:
        recording: an MCAP file, a rosbag2 directory, or a measurement file.
        output: the page, as in `make_report`.
        first: name of the first setting, for the page, and the setting.
        second: name and setting of the second.
        topics: as in `make_report`.
        progress: as in `make_report`.

    Returns:
        The clouds that both settings could filter, what was refused, and where the recording is damaged.

    Raises:
        SettingError: the settings are equal, or differ in parameters that make other clouds of a stack.
        RecordingError: the recording cannot be read, or no cloud of it can be filtered.
        SocialCircleError: the page has the name of something else or cannot be written, or matplotlib or Jinja2 is
            not installed.
    """
    recording, output = Path(recording), Path(output)
    settings = settings_of(PipelineSettings, first[1]), settings_of(PipelineSettings, second[1])
    differing = _differing(*settings)
    new_figure(1, 1)  # fails now if matplotlib or Jinja2 is missing, and not after minutes
    environment()
    check_page_name(output)
    if lies_in(output, recording):
        raise SocialCircleError(
            f'{output} would be written into the recording that is read, {recording}: give another name.'
        )
    with folder_of_results(output.parent):
        check_place(output)
        clouds, refused = [], Counter[str]()
        with open_recording(recording) as reader:
            for item in _compared(reader, settings, several(topics), progress):
                if isinstance(item, Refusal):
                    refused[item.reason] += 1
                else:
                    clouds.append(item)
            compared = ComparedRecording(clouds, refused, reader.damage)
        if not clouds:
            reasons = ' '.join([*refused, *([compared.damage] if compared.damage else [])])
            raise RecordingError(f'{recording} has no cloud that both settings can filter. {reasons}'.strip())
        write_file(output, _page(recording.name, (first[0], second[0]), differing, settings, compared))
    return compared


def _differing(first: PipelineSettings, second: PipelineSettings) -> list[str]:
    """The parameters in which two settings differ.

    Raises:
        SettingError: in none, or in one that makes other clouds.
    """
    one, other = first.to_ros(), second.to_ros()
    differing = [name for name in one if one[name] != other[name]]
    if not differing:
        raise SettingError('The two settings to compare are equal: give two that differ.')
    for name in differing:
        if name.startswith(_MAKE_CLOUDS):
            raise SettingError(
                f'The two settings differ in {name}, which makes another cloud of a stack; compare settings of the'
                ' filter, with the same clouds.'
            )
    return differing


def _compared(
    reader: RecordingReader,
    settings: tuple[PipelineSettings, PipelineSettings],
    topics: tuple[str, ...],
    progress: Callable[[int, int], None] | None,
) -> Iterator[ComparedCloud | Refusal]:
    truths = truths_of(reader)

    def compare(item: NamedCloud | Refusal) -> ComparedCloud | Refusal:
        if isinstance(item, Refusal):
            return item
        name, cloud = shown_name(reader.path, item.name), item.cloud
        try:
            first, second = (filter_cloud(cloud.points, each, cloud.depth_of_field) for each in settings)
        except SocialCircleError as error:
            return Refusal(f'{name}: {error}')
        truth = truths(cloud.namespace, cloud.points)
        scored = None if truth is None else (truth.outlier, truth.counted)
        unit = 'm' if cloud.image is not None else unit_of(reader, cloud.topic)
        warnings = [cloud.warning] if cloud.warning else []
        for label, result in (('A', first), ('B', second)):
            warnings += [f'{label}: {warning}' for warning in result.measurement.warnings]
        return _compared_cloud(name, cloud.points, unit, (mask_of(first), mask_of(second)), scored, warnings)

    yield from in_order(compare, named_clouds(reader, settings[0], topics=topics, progress=progress))


def _compared_cloud(
    name: str,
    points: bytes,
    unit: str | None,
    masks: tuple[npt.NDArray[np.uint8], npt.NDArray[np.uint8]],
    truth: tuple[Mask, Mask] | None,
    warnings: Sequence[str],
) -> ComparedCloud:
    whole = PointCloud.decode(points).xyz()
    # What one setting alone takes for a mark of what is not measured is no height of that setting.
    clouds = [measured_only(whole, mask != NOT_MEASURED) for mask in masks]
    found: tuple[Mask, Mask] = (masks[0] == OUTLIER, masks[1] == OUTLIER)
    first = CloudPictures(clouds[0], found[0], unit)
    second = CloudPictures(clouds[1], found[1], unit, first.colour_range)
    measured = (masks[0] != NOT_MEASURED) | (masks[1] != NOT_MEASURED)
    both = CloudPictures(measured_only(whole, measured), found[0], unit, first.colour_range)
    rows = [
        Pictures(
            [
                Picture('first', first.after(), 'A', f'{name}: heights that A keeps'),
                Picture('second', second.after(), 'B', f'{name}: heights that B keeps'),
            ]
        ),
        Pictures(
            [
                Picture('before', both.before(), 'before', f'{name}: heights as measured'),
                Picture('differ', both.against(second), '', f'{name}: what A, B or both remove'),
            ]
        ),
    ]
    return ComparedCloud(
        name=name,
        unit=unit,
        removed=(int(found[0].sum()), int(found[1].sum())),
        only=(int((found[0] & ~found[1]).sum()), int((found[1] & ~found[0]).sum())),
        measured=int(measured.sum()),
        textures=(texture(whole, masks[0] == KEPT), texture(whole, masks[1] == KEPT)),
        scores=None if truth is None else (score(found[0], *truth), score(found[1], *truth)),
        pictures=rows,
        warnings=warnings,
    )


def _page(
    name: str,
    names: tuple[str, str],
    differing: Sequence[str],
    settings: tuple[PipelineSettings, PipelineSettings],
    compared: ComparedRecording,
) -> str:
    units = {cloud.unit for cloud in compared.clouds}
    unit = units.pop() if len(units) == 1 else None
    rows: list[list[Cell]] = []
    for parameter in differing:
        texts = []
        for each in settings:
            values = each.to_ros()
            text = value_text(parameter, str(values[parameter]), unit)
            texts.append(text if has_effect(parameter, values) else f'{text}, without effect')
        rows.append([parameter, *texts, value_text(parameter, str(PARAMETERS[parameter].default), unit)])
    labels = (f'A: {names[0]}', f'B: {names[1]}')
    columns = [Column('parameter'), *map(Column, labels), Column('default')]
    clouds: list[list[Cell]] = [
        [cloud.name, *(count / cloud.measured for count in cloud.removed), *cloud.only]
        for cloud in compared.clouds
    ]
    all_columns = [
        Column('measurement'), Column('outliers A', '.2%'), Column('outliers B', '.2%'),
        Column('removed by A only', ',d'), Column('removed by B only', ',d'),
    ]  # fmt: skip
    sections = [
        Section(
            'Summary',
            items=[
                Table('settings', 'Settings that differ', columns, rows),
                Table('all', '', all_columns, clouds),
            ],
            warnings=compared.warnings,
        ),
        *(cloud.section(labels) for cloud in compared.clouds),
    ]
    text = 'The page shows what each setting removes; which one is right, a person decides.'
    return render(f'{names[0]} and {names[1]} on {name}', [text], sections)
