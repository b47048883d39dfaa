# SPDX-License-Identifier: Apache-2.0
"""`read_surface`, and the pitch and unit that a caller gives."""

import numpy as np
import pytest
from surfaces import same_bits

import socialcircle_ros
from socialcircle_ros.errors import CloudError, ImportFileError, SettingError
from socialcircle_ros.formats import MeasuredSurface, suffixes, write_cloud_file
from socialcircle_ros.panel.recorded import RecordedClouds
from socialcircle_ros.recording import import_cloud
from socialcircle_ros.recording.description import describe

SURFACE = MeasuredSurface(np.array([[1, 2, 3], [4, np.nan, 6]], np.float32), (0.123, 4.56), 'm')


@pytest.mark.parametrize('suffix', suffixes(written=True))
def test_what_is_written_is_read_with_its_pitch_and_unit(tmp_path, suffix):
    assert socialcircle_ros.write_surface(tmp_path / f'a{suffix}', SURFACE) == ()
    read = socialcircle_ros.read_surface(str(tmp_path / f'a{suffix}'))
    assert same_bits(read.heights, SURFACE.heights)
    assert (read.pitch, read.unit) == (SURFACE.pitch, 'm')
    assert (
        repr(read) == 'MeasuredSurface(2 rows × 3 columns, float32, pitch 0.123 × 4.56 m (x × y), 1 not measured)'
    )


@pytest.mark.parametrize('suffix', suffixes(written=True))
def test_a_pitch_or_unit_that_contradicts_the_file_is_refused(tmp_path, suffix):
    socialcircle_ros.write_surface(tmp_path / f'a{suffix}', SURFACE)
    for read in (socialcircle_ros.read_surface, import_cloud):
        with pytest.raises(ImportFileError, match='states its own coordinates'):
            read(tmp_path / f'a{suffix}', pitch=(2.0, 2.0))
        with pytest.raises(ImportFileError, match='is in m, not in µm'):
            read(tmp_path / f'a{suffix}', unit='um')
        read(tmp_path / f'a{suffix}', unit='m')


@pytest.mark.parametrize('suffix', suffixes(written=True))
def test_a_single_row_keeps_its_pitch_and_the_metadata(tmp_path, suffix):
    row = MeasuredSurface(SURFACE.heights[:1], SURFACE.pitch, 'm', metadata={'part': '7'})
    socialcircle_ros.write_surface(tmp_path / f'a{suffix}', row)
    read = socialcircle_ros.read_surface(tmp_path / f'a{suffix}')
    assert same_bits(read.heights, row.heights)
    assert (read.pitch, read.metadata) == (row.pitch, row.metadata)
    assert describe(tmp_path / f'a{suffix}').facts['pitch'] == '0.123 × 4.56 m (x × y)'


@pytest.mark.parametrize('own', [{}, {'x': np.arange(3) * 0.5, 'y': np.arange(2) * 2.0}])
def test_an_archive_with_one_measured_row_has_the_pitch_that_it_states(tmp_path, own):
    heights = np.array([[np.nan] * 3, [1, 2, 3]])
    np.savez(tmp_path / 'a.npz', z=heights, dx=0.5, dy=2.0, unit='um', **own)
    read = socialcircle_ros.read_surface(tmp_path / 'a.npz')
    assert same_bits(read.heights, heights)
    assert read.pitch == (0.5, 2.0)


@pytest.mark.parametrize('suffix', ['.npz', '.csv', '.x3p'])
def test_a_unit_that_is_no_text_is_refused(tmp_path, suffix):
    socialcircle_ros.write_surface(tmp_path / f'a{suffix}', SURFACE)
    for read in (socialcircle_ros.read_surface, import_cloud):
        with pytest.raises(SettingError, match='The unit is 3; give a text'):
            read(tmp_path / f'a{suffix}', unit=3)


@pytest.mark.parametrize('pitch', ['23', {2.0, 3.0}, (np.timedelta64(1), 1), np.eye(2)])
def test_what_is_no_pitch_is_refused_in_one_sentence(tmp_path, pitch):
    np.save(tmp_path / 'a.npy', SURFACE.heights)
    with pytest.raises(ImportFileError, match=r'must be two numbers above 0, not [^\n]*\.$'):
        socialcircle_ros.read_surface(tmp_path / 'a.npy', pitch=pitch)


@pytest.mark.parametrize('pitch', [(0.0, 1.0), (1.0, -1.0), (np.nan, 1.0)])
def test_a_pitch_must_be_above_0(tmp_path, pitch):
    np.save(tmp_path / 'a.npy', SURFACE.heights)
    with pytest.raises(ImportFileError, match='must be two numbers above 0'):
        socialcircle_ros.read_surface(tmp_path / 'a.npy', pitch=pitch)


def test_an_array_takes_its_pitch_and_unit_from_the_caller(tmp_path):
    np.save(tmp_path / 'a.npy', SURFACE.heights)
    read = socialcircle_ros.read_surface(tmp_path / 'a.npy', pitch=(2.0, 3.0), unit='um')
    assert same_bits(read.heights, SURFACE.heights)
    assert (read.pitch, read.unit) == ((2.0, 3.0), 'um')


@pytest.mark.parametrize('suffix', ['.ply', '.csv'])
def test_a_cloud_off_a_grid_is_no_surface(tmp_path, suffix):
    cloud = SURFACE.cloud()
    cloud.points[0, 1, 0] += 0.05
    write_cloud_file(tmp_path / f'a{suffix}', cloud)
    with pytest.raises(CloudError, match='off a regular grid'):
        socialcircle_ros.read_surface(tmp_path / f'a{suffix}')


def test_the_tuning_page_steps_through_a_measurement_file(tmp_path):
    socialcircle_ros.write_surface(tmp_path / 'a.x3p', SURFACE)
    with RecordedClouds(tmp_path / 'a.x3p') as clouds:
        assert len(clouds) == 1
        assert clouds[0].topic == '/points'
