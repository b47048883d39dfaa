# SPDX-License-Identifier: Apache-2.0
"""Clouds in metres, and the numbers and the unit of their files back."""

import os
import warnings
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from surfaces import same_bits

from socialcircle_ros.errors import UnitWarning
from socialcircle_ros.formats import MeasuredSurface, write_surface
from socialcircle_ros.lengths import METRES
from socialcircle_ros.messages.point_cloud import PointCloud
from socialcircle_ros.recording import import_cloud, open_recording, read_surface
from socialcircle_ros.recording.create import record_clouds
from socialcircle_ros.recording.description import describe
from socialcircle_ros.recording.export import export_recording, filter_to_file
from socialcircle_ros.recording.importers import ImportedCloud
from socialcircle_ros.recording.offline import filter_recording
from socialcircle_ros.recording.origins import FileOrigin, in_metres, origins_of
from socialcircle_ros.recording.units import unit_of
from socialcircle_ros.settings import PipelineSettings


def clouds(dtype):
    """Clouds (3, 4, 3) with numbers of all sizes that lengths have, both signs, zeros and NaN."""
    width = 8 * np.dtype(dtype).itemsize
    real = st.floats(2.0**-30, 2.0**30, width=width)
    number = st.one_of(real, real.map(lambda value: -value), st.sampled_from([0.0, np.nan]))
    return st.lists(number, min_size=36, max_size=36).map(lambda all_: np.array(all_, dtype).reshape(3, 4, 3))


@pytest.mark.parametrize('dtype', ['f4', 'f8'])
@given(data=st.data(), unit=st.sampled_from(sorted(set(METRES) - {'inch'})))
def test_the_numbers_of_a_file_come_back_bit_for_bit_from_metres(dtype, data, unit):
    points = data.draw(clouds(dtype))
    found, rounding = in_metres(ImportedCloud('a', points, {}, unit))
    assert (found.unit, found.points.dtype, found.notes) == ('m', points.dtype, ())
    # The nearest number of the type to the exact length.
    exact = points.astype(np.longdouble) / round(1 / METRES[unit])
    away = np.abs(found.points.astype(np.longdouble) - exact) / np.spacing(np.abs(found.points))
    assert np.nanmax(away, initial=0) <= 0.5001
    origin = FileOrigin('/points', 1, 'a.npz', unit, 'given', converted=True, rounding=rounding)
    assert same_bits(origin.in_unit_of_file(found.points), points)


def test_points_that_changed_since_the_import_are_converted_as_they_are():
    points = np.random.default_rng(0).normal(0, 50, (30, 40, 3)).astype('f4')
    found, rounding = in_metres(ImportedCloud('a', points, {}, 'um'))
    assert rounding  # some numbers of the file lie between those that metres have
    changed = found.points.copy()
    changed[::2, :, 2] += np.float32(1e-5)
    changed[1, :, :] = np.nan
    back = FileOrigin('/points', 1, 'a.npz', 'um', 'given', converted=True, rounding=rounding).in_unit_of_file(
        changed
    )
    np.testing.assert_allclose(back, changed.astype('f8') * 1e6, rtol=2e-7)
    assert same_bits(back[3::2], points[3::2])


def surface(unit='um', dtype=np.float32):
    heights = np.random.default_rng(1).normal(100, 0.3, (20, 30)).astype(dtype)
    heights[5, 7], heights[3, 3] = 400, np.nan
    return MeasuredSurface(heights, (1.634, 1.907), unit)


@pytest.mark.parametrize('suffix', ['.npz', '.ply', '.pcd', '.csv', '.xyz', '.tiff'])
@pytest.mark.parametrize('unit', ['um', 'mm', 'inch'])
def test_an_exported_file_has_the_unit_and_the_numbers_of_the_imported_file(tmp_path, suffix, unit):
    write_surface(tmp_path / f'part{suffix}', surface(unit))
    record_clouds([tmp_path / f'part{suffix}'], tmp_path / 'part.mcap', topic='/cell/cloud')
    (first,) = export_recording(tmp_path / 'part.mcap', tmp_path / 'out', suffix).files
    record_clouds([first], tmp_path / 'again.mcap', topic='/cell/cloud')
    one, other = import_cloud(tmp_path / f'part{suffix}'), import_cloud(first)
    measured = np.isfinite(one.points).all(axis=-1)
    assert other.unit == unit
    assert same_bits(other.points[measured], one.points[measured])
    messages = []
    for name in ('part.mcap', 'again.mcap'):
        with open_recording(tmp_path / name) as reader:
            messages.append(next(iter(reader.messages())).data)
            assert unit_of(reader, '/cell/cloud') == 'm'
    assert messages[0] == messages[1]


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), dtype=st.sampled_from(['f4', 'f8']))
def test_a_file_in_micrometres_is_filtered_into_another_with_its_own_numbers(tmp_path_factory, seed, dtype):
    folder = tmp_path_factory.mktemp('part')
    heights = np.random.default_rng(seed).normal(0, 1, (12, 15)).astype(dtype)
    heights[5, 7] = 1e3
    write_surface(folder / 'part.npz', MeasuredSurface(heights, (1.634, 1.907), 'um'))
    filter_to_file(folder / 'part.npz', folder / 'cleaned.npz', PipelineSettings())
    cleaned = read_surface(folder / 'cleaned.npz')
    kept = np.isfinite(cleaned.heights)
    assert not kept[5, 7]
    assert (cleaned.unit, cleaned.pitch) == ('um', (1.634, 1.907))
    assert same_bits(cleaned.heights[kept], heights[kept])


def test_a_recording_says_which_files_it_is_from_even_after_the_filter(tmp_path):
    write_surface(tmp_path / 'a.npz', surface('um'))
    write_surface(tmp_path / 'b.ply', surface('mm'))
    np.savez(tmp_path / 'c.npz', z=surface().heights, dx=1.0, dy=1.0)
    record_clouds([tmp_path / name for name in ('a.npz', 'b.ply', 'c.npz')], tmp_path / 'all')
    filter_recording(tmp_path / 'all', tmp_path / 'cleaned.mcap', PipelineSettings())
    found = describe(tmp_path / 'cleaned.mcap')
    assert found.facts['imported'] == (
        'a.npz (µm, stated in the file); b.ply (mm, stated in the file);'
        ' c.npz (µm, taken, because the file does not state it)'
    )
    export = export_recording(tmp_path / 'cleaned.mcap', tmp_path / 'out', '.npz')
    assert [read_surface(each).unit for each in export.files] == ['um', 'mm', 'um']
    assert b'a.npz' in np.load(export.files[0])['metadata'].tobytes().replace(b'\0', b'')


def test_a_recording_keeps_the_times_of_its_files_even_after_the_filter(tmp_path):
    write_surface(tmp_path / 'a.npz', replace(surface(), metadata={'stamp': '1790000000.000000000'}))
    write_surface(tmp_path / 'b.npz', surface())
    for name, time in (('a.npz', 1_800_000_000), ('b.npz', 1_800_000_005)):
        os.utime(tmp_path / name, (time, time))
    record_clouds([tmp_path / 'a.npz', tmp_path / 'b.npz'], tmp_path / 'all')
    filter_recording(tmp_path / 'all', tmp_path / 'cleaned.mcap', PipelineSettings())
    with open_recording(tmp_path / 'cleaned.mcap') as reader:
        one, other = origins_of(reader).values()
    assert (one.measured_ns, one.changed_ns, one.time_ns) == (
        1_790_000_000 * 10**9, 1_800_000_000 * 10**9, 1_790_000_000 * 10**9,
    )  # fmt: skip
    assert (other.measured_ns, other.time_ns) == (None, 1_800_000_005 * 10**9)


def test_what_comes_of_a_measurement_file_does_not_depend_on_the_time_of_its_last_change(tmp_path):
    write_surface(tmp_path / 'a.npz', surface())
    contents = []
    for time in (1_800_000_000, 1_800_000_005):
        os.utime(tmp_path / 'a.npz', (time, time))
        filter_recording(tmp_path / 'a.npz', tmp_path / 'a.mcap', PipelineSettings(), overwrite=True)
        contents.append((tmp_path / 'a.mcap').read_bytes())
    assert contents[0] == contents[1]


def test_a_unit_that_is_not_known_keeps_its_numbers(tmp_path):
    for unit, note in ((None, 'not known'), ('px', 'px')):
        write_surface(tmp_path / 'a.ply', surface(unit), overwrite=True)
        record_clouds([tmp_path / 'a.ply'], tmp_path / 'a.mcap', overwrite=True)
        with open_recording(tmp_path / 'a.mcap') as reader:
            (message,) = reader.messages()
            assert unit_of(reader, '/points') == unit
        assert same_bits(PointCloud.decode(message.data).xyz(), import_cloud(tmp_path / 'a.ply').points)
        assert note in describe(tmp_path / 'a.mcap').facts['imported']


@pytest.mark.parametrize('suffix', ['.npz', '.ply', '.pcd', '.xyz', '.csv', '.tiff', '.npy'])
def test_a_file_that_does_not_state_its_unit_is_told(tmp_path, suffix):
    pytest.importorskip('PIL')
    path = tmp_path / f'a{suffix}'
    pitch = {'pitch': (1.0, 2.0)} if suffix == '.npy' else {}
    if suffix == '.npz':
        np.savez(path, z=surface().heights, dx=1.0, dy=2.0)
    elif suffix == '.npy':
        np.save(path, surface().heights)
    else:
        write_surface(path, surface(None))
    taken = 'taken as µm' if suffix == '.npz' else 'not known'
    with pytest.warns(UnitWarning, match=rf'does not state its unit.*{taken}.*unit='):
        read_surface(path, **pitch)
    if not pitch:
        with pytest.warns(UnitWarning, match='does not state its unit.*import --unit'), open_recording(path):
            pass
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        assert read_surface(path, **pitch, unit='nm').unit == 'nm'
    assert import_cloud(path, **pitch, unit='nm').unit_note == ''
