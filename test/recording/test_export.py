# SPDX-License-Identifier: Apache-2.0
"""Exports, the filter into one file, measurement files in place of recordings, and units."""

import json
import zipfile
from dataclasses import replace

import numpy as np
import pytest
from surfaces import same_bits

from socialcircle_ros.errors import ImportFileError, RecordingError, SettingError, SocialCircleError
from socialcircle_ros.formats import MeasuredSurface, read_file, suffixes, write_cloud_file, write_surface
from socialcircle_ros.messages.point_cloud import PointCloud
from socialcircle_ros.recording import import_cloud, open_recording, read_surface
from socialcircle_ros.recording.create import record_clouds
from socialcircle_ros.recording.export import export_recording, filter_to_file
from socialcircle_ros.recording.offline import filter_recording
from socialcircle_ros.recording.units import unit_of
from socialcircle_ros.settings import CircleSettings, LimitSettings, OutputSettings, PipelineSettings

Image = pytest.importorskip('PIL.Image', reason='needs Pillow: pip install Pillow')

SETTINGS = PipelineSettings(output=OutputSettings(mask=True, repaired=True))
WRITTEN = suffixes(written=True)


def measured_surface(unit='m', dtype=np.float32):
    """A rough plane with a spike at (5, 7) and a point that is not measured."""
    heights = np.random.default_rng(0).normal(0, 1e-8, (20, 30)).astype(dtype)
    heights[5, 7] = 1e-4
    heights[3, 3] = np.nan
    return MeasuredSurface(heights, (4.3e-7, 7.1e-7), unit)


def recorded(tmp_path, surface, suffix='.ply', name='part'):
    write_surface(tmp_path / f'{name}{suffix}', surface)
    record_clouds([tmp_path / f'{name}{suffix}'], tmp_path / f'{name}.mcap')
    return tmp_path / f'{name}.mcap'


def clouds_in(recording, topic='/points'):
    with open_recording(recording) as reader:
        return [PointCloud.decode(message.data).xyz() for message in reader.messages([topic])]


@pytest.mark.parametrize('suffix', WRITTEN)
@pytest.mark.parametrize('dtype', [np.float32, np.float64])
def test_a_recording_exported_and_imported_again_is_the_same(tmp_path, suffix, dtype):
    if suffix in ('.tif', '.tiff') and dtype == np.float64:
        pytest.skip('holds float32')
    first = recorded(tmp_path, measured_surface(dtype=dtype))
    export = export_recording(first, tmp_path / 'out', suffix)
    assert (export.filtered, export.notes, export.refused, export.damage) == (False, {}, {}, None)
    assert [file.name for file in export.files] == [f'points_0000{suffix}']
    record_clouds(export.files, tmp_path / 'again.mcap')
    (one,), (other,) = clouds_in(first), clouds_in(tmp_path / 'again.mcap')
    assert same_bits(one, other)
    with open_recording(tmp_path / 'again.mcap') as reader:
        assert unit_of(reader, '/points') == 'm'


@pytest.mark.parametrize('suffix', WRITTEN)
def test_a_filtered_recording_gives_the_cleaned_and_the_repaired_cloud_and_the_mask(tmp_path, suffix):
    filter_recording(recorded(tmp_path, measured_surface()), tmp_path / 'c.mcap', SETTINGS)
    export = export_recording(tmp_path / 'c.mcap', tmp_path / 'out', suffix)
    names = [file.name for file in export.files]
    beside = ['points_filtered_0000_mask.png'] if suffix in ('.x3p', '.sdf', '.tif', '.tiff') else []
    assert sorted(names) == sorted([f'points_filtered_0000{suffix}', f'points_repaired_0000{suffix}', *beside])
    cleaned = import_cloud(tmp_path / 'out' / f'points_filtered_0000{suffix}')
    (expected,) = clouds_in(tmp_path / 'c.mcap', '/points_filtered')
    assert same_bits(cleaned.points[..., 2], expected[..., 2])
    assert np.isnan(cleaned.points[5, 7, 2])
    mask = np.asarray(Image.open(tmp_path / 'out' / beside[0])) if beside else cleaned.fields['outlier_mask']
    assert (mask[5, 7], mask[3, 3], mask[0, 0]) == (255, 127, 0)
    repaired = import_cloud(tmp_path / 'out' / f'points_repaired_0000{suffix}')
    assert np.isfinite(repaired.points[5, 7, 2])
    assert cleaned.unit == repaired.unit == 'm'


def test_lengths_of_the_filter_are_in_the_unit_of_the_file(tmp_path):
    one = replace(SETTINGS, circle=CircleSettings(mode='paper', radius=5e-7))
    filter_recording(recorded(tmp_path, measured_surface('um')), tmp_path / 'c.mcap', one)
    export_recording(tmp_path / 'c.mcap', tmp_path / 'out', '.ply')
    header = (tmp_path / 'out/points_filtered_0000.ply').read_bytes().partition(b'end_header')[0].decode()
    metadata = json.loads(header.partition('comment metadata ')[2].partition('\n')[0])
    assert 'comment unit um' in header
    assert float(metadata['radius']) == pytest.approx(0.5)
    assert float(metadata['circle.radius']) == pytest.approx(0.5)


def test_the_reason_of_a_verdict_names_the_unit_of_its_numbers(tmp_path):
    limited = replace(SETTINGS, limits=LimitSettings(sq_max=1e-16))
    filter_recording(recorded(tmp_path, measured_surface('um')), tmp_path / 'c.mcap', limited)
    export_recording(tmp_path / 'c.mcap', tmp_path / 'out', '.ply')
    header = (tmp_path / 'out/points_filtered_0000.ply').read_bytes().partition(b'end_header')[0].decode()
    metadata = json.loads(header.partition('comment metadata ')[2].partition('\n')[0])
    assert metadata['unit of file'].startswith('µm')
    for name in ('verdict_reason', 'result'):
        assert ', above 1 × 10⁻¹⁶, in m.' in metadata[name]


def test_progress_counts_the_clouds_that_are_exported(tmp_path):
    filter_recording(recorded(tmp_path, measured_surface()), tmp_path / 'c.mcap', SETTINGS)
    seen = []
    export_recording(tmp_path / 'c.mcap', tmp_path / 'out', '.npz', progress=lambda *step: seen.append(step))
    assert seen == [(1, 2), (2, 2)]


def test_the_settings_and_counts_of_the_filter_are_in_the_metadata(tmp_path):
    filter_recording(recorded(tmp_path, measured_surface()), tmp_path / 'c.mcap', SETTINGS)
    export_recording(tmp_path / 'c.mcap', tmp_path, '.x3p')
    with zipfile.ZipFile(tmp_path / 'points_filtered_0000.x3p') as archive:
        metadata = json.loads(archive.read('socialcircle.json'))
    assert metadata == read_file(tmp_path / 'points_filtered_0000.x3p').metadata
    assert (metadata['circle.mode'], metadata['outliers'], metadata['topic']) == (
        SETTINGS.circle.mode,
        '1',
        '/points_filtered',
    )
    assert metadata['source'] == 'c.mcap'


def test_a_cloud_that_the_format_cannot_hold_is_refused_and_the_others_are_written(tmp_path):
    good = measured_surface()
    skewed = good.cloud()
    skewed.points[..., 0] += skewed.points[..., 1] * 0.5
    write_surface(tmp_path / 'good.ply', good)
    write_cloud_file(tmp_path / 'skewed.ply', skewed)
    record_clouds([tmp_path / 'skewed.ply', tmp_path / 'good.ply'], tmp_path / 'both.mcap')
    export = export_recording(tmp_path / 'both.mcap', tmp_path / 'out', '.x3p')
    assert [file.name for file in export.files] == ['points_0001.x3p']
    assert list(export.refused.values()) == [1]
    assert 'ply or pcd' in next(iter(export.refused))


def test_an_export_that_writes_nothing_leaves_no_folder(tmp_path):
    cloud = measured_surface().cloud()
    cloud.points[..., 0] += np.random.default_rng(0).normal(0, 1e-7, cloud.points.shape[:2])
    write_cloud_file(tmp_path / 'skewed.ply', cloud)
    record_clouds([tmp_path / 'skewed.ply'], tmp_path / 'a.mcap')
    assert export_recording(tmp_path / 'a.mcap', tmp_path / 'new/out', '.x3p').files == []
    assert not (tmp_path / 'new').exists()
    recording = recorded(tmp_path, measured_surface(unit=None))
    with pytest.raises(SettingError, match='The unit of the coordinates is not named'):
        export_recording(recording, tmp_path / 'new/out', '.x3p')
    assert not (tmp_path / 'new').exists()


def test_nothing_is_created_where_nothing_is_written(tmp_path):
    recording = recorded(tmp_path, measured_surface())
    with pytest.raises(SocialCircleError, match=r'part\.x3p has the name of a file'):
        export_recording(recording, tmp_path / 'new/part.x3p', '.x3p')
    with pytest.raises(SocialCircleError, match='has no topic /nowhere'):
        export_recording(recording, tmp_path / 'new/parts', '.x3p', topics=['/nowhere'])
    assert not (tmp_path / 'new').exists()


def test_an_existing_file_ends_the_export_and_is_kept(tmp_path):
    recording = recorded(tmp_path, measured_surface())
    (tmp_path / 'points_0000.pcd').write_text('precious')
    with pytest.raises(SocialCircleError, match='exists already'):
        export_recording(recording, tmp_path, '.pcd')
    assert (tmp_path / 'points_0000.pcd').read_text() == 'precious'
    export_recording(recording, tmp_path, '.pcd', overwrite=True)


@pytest.mark.parametrize('suffix', ['.npz', '.x3p', '.sdf'])
def test_a_format_that_needs_a_unit_takes_none_for_granted(tmp_path, suffix):
    recording = recorded(tmp_path, measured_surface(unit=None))
    with pytest.raises(SettingError, match='The unit of the coordinates is not named'):
        export_recording(recording, tmp_path / 'out', suffix)
    export_recording(recording, tmp_path / 'out', suffix, unit='m')
    assert import_cloud(tmp_path / 'out' / f'points_0000{suffix}').unit == 'm'


@pytest.mark.parametrize(
    ('arguments', 'sentence'),
    [
        ({'suffix': '.al3d'}, 'is not written: choose one of'),
        ({'topics': ('/nowhere',)}, 'has no topic /nowhere of clouds; it has /points'),
    ],
)
def test_an_export_that_makes_no_sense_is_refused(tmp_path, arguments, sentence):
    recording = recorded(tmp_path, measured_surface())
    with pytest.raises(SocialCircleError, match=sentence):
        export_recording(recording, tmp_path / 'out', **({'suffix': '.ply'} | arguments))
    assert not (tmp_path / 'out').exists()


def test_extra_fields_come_through(tmp_path):
    surface = measured_surface()
    fields = {'intensity': np.arange(600, dtype=np.uint16).reshape(20, 30)}
    recording = recorded(tmp_path, MeasuredSurface(surface.heights, surface.pitch, 'm', fields))
    export_recording(recording, tmp_path / 'out', '.csv')
    again = import_cloud(tmp_path / 'out/points_0000.csv')
    assert same_bits(again.fields['intensity'], fields['intensity'])


@pytest.mark.parametrize('suffix', ['.csv', '.ply', '.npz'])
def test_fields_with_any_names_come_through(tmp_path, suffix):
    surface = measured_surface()
    fields = {name: np.full((20, 30), place, np.uint8) for place, name in enumerate(('xy', 'file', 'z_', 'yz'), 1)}
    recording = recorded(tmp_path, MeasuredSurface(surface.heights, surface.pitch, 'm', fields))
    export_recording(recording, tmp_path / 'out', suffix)
    again = import_cloud(tmp_path / f'out/points_0000{suffix}').fields
    assert [int(values[0, 0]) for values in again.values()] == [1, 2, 3, 4]


def test_an_own_text_with_a_column_without_a_name_is_refused(tmp_path):
    surface = MeasuredSurface(np.ones((20, 30)), (1.0, 1.0), 'm', {'q': np.ones((20, 30), np.uint8)})
    write_surface(tmp_path / 'a.csv', surface)
    (tmp_path / 'a.csv').write_text((tmp_path / 'a.csv').read_text().replace('x,y,z,q', 'x,y,z,'))
    with pytest.raises(ImportFileError, match='does not match its header'):
        import_cloud(tmp_path / 'a.csv')


@pytest.mark.parametrize('suffix', WRITTEN)
def test_one_file_is_filtered_into_another(tmp_path, suffix):
    surface = measured_surface()
    write_surface(tmp_path / 'part.x3p', surface)
    summary, notes = filter_to_file(tmp_path / 'part.x3p', tmp_path / f'cleaned{suffix}', PipelineSettings())
    assert (summary.clouds, notes) == (1, ())
    expected = surface.heights.copy()
    expected[5, 7] = np.nan
    assert same_bits(read_surface(tmp_path / f'cleaned{suffix}').heights, expected)
    assert read_surface(tmp_path / f'cleaned{suffix}').pitch == surface.pitch


@pytest.mark.parametrize('suffix', ['.npz', '.x3p', '.ply'])
def test_what_a_mark_calls_not_measured_is_not_measured_in_the_file(tmp_path, suffix):
    z = 100 + np.random.default_rng(0).normal(size=(60, 70)).astype(np.float32)
    z[:, :10] = 0
    write_surface(tmp_path / 'part.npz', MeasuredSurface(z, (1.0, 1.0), 'µm'))
    filter_to_file(tmp_path / 'part.npz', tmp_path / f'clean{suffix}', PipelineSettings())
    points = import_cloud(tmp_path / f'clean{suffix}').points
    assert np.isnan(points[:, :10, 2]).all()
    assert np.isfinite(points[:, 10:, 2]).mean() > 0.9


def test_a_recording_of_several_clouds_does_not_become_one_file(tmp_path):
    write_surface(tmp_path / 'a.ply', measured_surface())
    record_clouds([tmp_path / 'a.ply'] * 2, tmp_path / 'two.mcap')
    with pytest.raises(RecordingError, match=r'has 2 clouds, and a \.x3p file holds one'):
        filter_to_file(tmp_path / 'two.mcap', tmp_path / 'x.x3p', PipelineSettings())
    assert not (tmp_path / 'x.x3p').exists()


def test_a_file_is_not_filtered_into_itself_or_into_an_existing_one(tmp_path):
    write_surface(tmp_path / 'a.ply', measured_surface())
    before = (tmp_path / 'a.ply').read_bytes()
    for overwrite in (False, True):
        with pytest.raises(
            SocialCircleError, match=r'a\.ply is the file that is to be filtered: give another name'
        ):
            filter_to_file(tmp_path / 'a.ply', tmp_path / 'a.ply', PipelineSettings(), overwrite=overwrite)
    assert (tmp_path / 'a.ply').read_bytes() == before
    (tmp_path / 'b.ply').write_text('precious')
    with pytest.raises(SocialCircleError, match='exists already: give another name, or --overwrite'):
        filter_to_file(tmp_path / 'a.ply', tmp_path / 'b.ply', PipelineSettings())
    assert (tmp_path / 'b.ply').read_text() == 'precious'


@pytest.mark.parametrize('overwrite', [False, True])
@pytest.mark.parametrize(('target', 'kind'), [('/dev/null', 'a symbolic link'), (None, 'a directory')])
def test_what_is_no_file_is_not_said_to_be_overwritten(tmp_path, target, kind, overwrite):
    write_surface(tmp_path / 'a.ply', measured_surface())
    place = tmp_path / 'b.npz'
    place.mkdir() if target is None else place.symlink_to(target)
    surface = read_surface(tmp_path / 'a.ply')
    for write in (
        lambda: filter_to_file(tmp_path / 'a.ply', place, PipelineSettings(), overwrite=overwrite),
        lambda: write_surface(place, surface, overwrite=overwrite),
    ):
        with pytest.raises(SocialCircleError, match=f'is {kind}, and is not overwritten: give another name'):
            write()


def test_a_measurement_file_opens_as_a_recording_of_one_cloud(tmp_path):
    write_surface(tmp_path / 'part.sdf', measured_surface())
    with open_recording(tmp_path / 'part.sdf') as reader:
        assert (reader.path, reader.message_count) == (tmp_path / 'part.sdf', 1)
        assert unit_of(reader, '/points') == 'm'
        (message,) = reader.messages()
    assert same_bits(PointCloud.decode(message.data).xyz(), import_cloud(tmp_path / 'part.sdf').points)
    assert [each.name for each in tmp_path.iterdir()] == ['part.sdf']


def test_files_in_different_units_do_not_become_one_topic(tmp_path):
    write_surface(tmp_path / 'a.ply', measured_surface())
    for unit, text in (('um', 'µm'), (None, 'a unit that it does not name')):
        write_surface(tmp_path / 'b.ply', measured_surface(unit=unit), overwrite=True)
        with pytest.raises(ImportFileError, match=rf'b\.ply is in {text}, but the files before it are in m'):
            record_clouds([tmp_path / 'a.ply', tmp_path / 'b.ply'], tmp_path / 'x.mcap', keep_unit=True)
        assert not (tmp_path / 'x.mcap').exists()


def test_the_outputs_of_the_filter_have_the_unit_of_their_clouds(tmp_path):
    write_surface(tmp_path / 'part.ply', measured_surface('mm'))
    record_clouds([tmp_path / 'part.ply'], tmp_path / 'part.mcap', topic='/cloud', keep_unit=True)
    filter_recording(tmp_path / 'part.mcap', tmp_path / 'c.mcap', SETTINGS)
    with open_recording(tmp_path / 'c.mcap') as reader:
        units = {name: unit_of(reader, name) for name in reader.topics if 'points' in name or name == '/cloud'}
    assert units == dict.fromkeys(('/cloud', '/points_filtered', '/points_repaired'), 'mm')


@pytest.mark.parametrize('name', ['al3d-1.al3d', 'opd-1.opd', 'metropro-1.dat', 'plu-1.plu', 'x3p-2.x3p'])
def test_every_vendor_file_is_filtered_into_x3p_in_one_step(real_measurements, tmp_path, name):
    pytest.importorskip('SurfaceTopography')
    source = real_measurements / 'vendor' / name
    summary, _ = filter_to_file(source, tmp_path / 'part.x3p', PipelineSettings())
    assert summary.clouds == 1
    before, after = read_surface(source), read_surface(tmp_path / 'part.x3p')
    factor = {'m': 1.0, 'mm': 1e-3, 'um': 1e-6}[before.unit]
    kept = np.isfinite(after.heights)
    np.testing.assert_array_equal(after.heights[kept], (before.heights.astype(float) * factor)[kept])
    np.testing.assert_allclose(after.pitch, np.array(before.pitch) * factor, rtol=1e-7)
