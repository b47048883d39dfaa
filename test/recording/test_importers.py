# SPDX-License-Identifier: Apache-2.0
import os
import struct
import tracemalloc
import zipfile
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from socialcircle_ros.errors import ImportFileError
from socialcircle_ros.messages.point_cloud import PointCloud
from socialcircle_ros.recording import import_cloud, open_recording
from socialcircle_ros.recording.compression import LIMIT_VARIABLE
from socialcircle_ros.recording.create import record_clouds
from socialcircle_ros.recording.stacks import is_stack

Z = np.array([[1, 2, 3], [4, np.nan, 6]], np.float32)
DATA = os.environ.get('SOCIALCIRCLE_DATA')
PLY = 'ply\nformat ascii 1.0\n{size}element vertex {count}\n{properties}end_header\n'
XYZ = 'property float x\nproperty double y\nproperty float z\n'


def npz(path, **arrays):
    np.savez(path, **{'z': Z, 'dx': 0.5, 'dy': 2.0, **arrays})
    return path


def ply(path, *, size='', count=6, properties=XYZ, line='1 2 3\n'):
    path.write_text(PLY.format(size=size, count=count, properties=properties) + line * count)
    return path


def test_a_height_map_becomes_a_cloud_in_its_unit(tmp_path):
    cloud = import_cloud(npz(tmp_path / 'part.npz'))
    assert (cloud.name, cloud.unit, cloud.fields) == ('part', 'um', {})
    assert cloud.points.dtype == np.float32
    np.testing.assert_array_equal(cloud.points[..., 0], [[0, 0.5, 1]] * 2)
    np.testing.assert_array_equal(cloud.points[..., 1], [[0] * 3, [2] * 3])
    np.testing.assert_array_equal(cloud.points[..., 2], Z)


def test_arrays_of_the_same_size_become_fields(tmp_path):
    planes = np.arange(12, dtype=np.uint8).reshape(2, 2, 3)
    cloud = import_cloud(
        npz(tmp_path / 'a.npz', intensity=planes[0], planes=planes, good=Z > 2, other=np.arange(4), note='x')
    )
    assert sorted(cloud.fields) == ['good', 'intensity', 'planes_0', 'planes_1']
    np.testing.assert_array_equal(cloud.fields['planes_1'], planes[1])
    assert cloud.fields['good'].dtype == np.uint8


@pytest.mark.parametrize(
    ('kind', 'expected'),
    [('<f2', 'f4'), ('>f4', 'f4'), ('>f8', 'f8'), ('i4', 'f8'), ('u2', 'f8')],
)
def test_heights_become_floats_that_hold_them(tmp_path, kind, expected):
    cloud = import_cloud(npz(tmp_path / 'a.npz', z=np.array([[1, 2]], kind)))
    assert cloud.points.dtype == np.dtype(expected)
    assert cloud.points.dtype.isnative
    assert cloud.points[0, :, 2].tolist() == [1, 2]


@pytest.mark.parametrize(
    ('arrays', 'sentence'),
    [
        ({'z': np.arange(5.0)}, r'z with shape \(5,\)'),
        ({'z': np.zeros((0, 3))}, r'z with shape \(0, 3\)'),
        ({'z': np.array([['a', 'b']])}, r'must hold numbers in rows and columns'),
        ({'z': np.zeros((2, 2), complex)}, r'must hold numbers in rows and columns'),
        ({'z': np.full((2, 2), np.nan)}, r'has no measured point'),
        ({'dx': 0.0}, r"no usable 'dx'"),
        ({'dy': np.nan}, r"no usable 'dy'"),
        ({'dx': 'wide'}, r"no usable 'dx'"),
        ({'dy': [1.0, 2.0]}, r"no usable 'dy'"),
        ({'frames': np.zeros((2, 3, 3))}, r'holds a focus stack'),
    ],
)
def test_an_invalid_height_map_is_refused(tmp_path, arrays, sentence):
    with pytest.raises(ImportFileError, match=rf'a\.npz has .*{sentence}|a\.npz {sentence}'):
        import_cloud(npz(tmp_path / 'a.npz', **arrays))


@pytest.mark.parametrize('key', ['z', 'dx', 'dy'])
def test_a_height_map_without_a_required_array_is_refused(tmp_path, key):
    arrays = {'z': Z, 'dx': 1.0, 'dy': 1.0}
    del arrays[key]
    np.savez(tmp_path / 'a.npz', **arrays)
    with pytest.raises(ImportFileError, match=rf"a\.npz has no array '{key}'"):
        import_cloud(tmp_path / 'a.npz')


def test_a_pitch_is_taken_only_by_heights_that_have_no_place(tmp_path):
    np.savez(tmp_path / 'a.npz', z=Z)
    with pytest.raises(ImportFileError, match=r'a\.npz does not state its pitch: give it'):
        import_cloud(tmp_path / 'a.npz')
    cloud = import_cloud(tmp_path / 'a.npz', pitch=[0.5, 2], unit='mm')
    assert (cloud.pitch, cloud.unit) == ((0.5, 2.0), 'mm')
    assert cloud.points[1, 2].tolist() == [1.0, 2.0, 6.0]
    for stated in ({'dx': 1.0}, {'x': np.arange(3.0), 'y': np.arange(2.0)}, {'dx': 1.0, 'dy': 1.0}):
        np.savez(tmp_path / 'b.npz', z=Z, **stated)
        with pytest.raises(ImportFileError, match=r"b\.npz (states its own coordinates|has no array 'dy')"):
            import_cloud(tmp_path / 'b.npz', pitch=(0.5, 2))
    with pytest.raises(ImportFileError, match=r'c\.ply states its own coordinates: leave the pitch out'):
        import_cloud(ply(tmp_path / 'c.ply', size='obj_info num_cols 3\nobj_info num_rows 2\n'), pitch=(0.5, 2))


def test_an_archive_cut_off_at_any_byte_is_refused(tmp_path):
    content = npz(tmp_path / 'a.npz').read_bytes()
    for length in range(0, len(content), 11):
        (tmp_path / 'cut.npz').write_bytes(content[:length])
        with pytest.raises(ImportFileError, match=r'cut\.npz is not an \.npz archive'):
            import_cloud(tmp_path / 'cut.npz')


def test_a_damaged_place_of_the_directory_of_an_archive_is_told_as_damage(tmp_path):
    """Such an offset leads before the beginning of the file, which the system calls an invalid argument."""
    content = bytearray(npz(tmp_path / 'a.npz').read_bytes())
    content[-6:-2] = struct.pack('<I', 0x7F000000)
    (tmp_path / 'a.npz').write_bytes(content)
    for read in (import_cloud, is_stack):
        with pytest.raises(ImportFileError, match=r'a\.npz is not an \.npz archive'):
            read(tmp_path / 'a.npz')


@pytest.mark.parametrize('method', [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA, zipfile.ZIP_DEFLATED])
def test_damaged_compressed_data_are_told_as_damage(tmp_path, method):
    with zipfile.ZipFile(npz(tmp_path / 'plain.npz')) as plain, zipfile.ZipFile(tmp_path / 'a.npz', 'w') as packed:
        for name in plain.namelist():
            packed.writestr(name, plain.read(name), method)
    content = (tmp_path / 'a.npz').read_bytes()
    assert import_cloud(tmp_path / 'a.npz').points.shape == (2, 3, 3)
    for place in range(35, len(content), 3):
        damaged = bytearray(content)
        damaged[place] ^= 0xFF
        (tmp_path / 'a.npz').write_bytes(damaged)
        with suppress(ImportFileError):  # not every byte counts
            import_cloud(tmp_path / 'a.npz')


@pytest.mark.parametrize('suffix', ['.npz', '.ply', '.x3p', '.tif'])
def test_what_the_system_does_not_read_is_no_damage(tmp_path, suffix):
    (tmp_path / f'a{suffix}').mkdir()
    with pytest.raises(ImportFileError, match=rf'a{suffix} cannot be read \(Is a directory\)\.'):
        import_cloud(tmp_path / f'a{suffix}')


def test_objects_are_never_loaded_and_refused_only_where_numbers_are_needed(tmp_path):
    objects = np.array([[object()] * 3] * 2, dtype=object)
    cloud = import_cloud(npz(tmp_path / 'a.npz', meta=objects, note='x', other=np.arange(4)))
    assert cloud.fields == {}
    assert [note.split()[2] for note in cloud.notes] == ['meta', 'note', 'other']
    np.testing.assert_array_equal(cloud.points[..., 2], Z)
    with pytest.raises(ImportFileError, match=r'must hold numbers'):
        import_cloud(npz(tmp_path / 'a.npz', z=objects))
    with pytest.raises(ImportFileError, match=r"has Python objects in 'dx'"):
        import_cloud(npz(tmp_path / 'a.npz', dx=objects))


OWN_X, OWN_Y = np.array([0.5, 1.0, 2.0]), np.array([3.0, 1.0])


@pytest.mark.parametrize('full', [True, False])
@pytest.mark.parametrize('kind', ['f8', '>f4', 'i4'])
def test_a_height_map_with_its_own_x_and_y_uses_them(tmp_path, full, kind):
    x, y = np.meshgrid(OWN_X, OWN_Y) if full else (OWN_X, OWN_Y)
    np.savez(tmp_path / 'a.npz', z=Z, x=x.astype(kind), y=y.astype(kind))
    cloud = import_cloud(tmp_path / 'a.npz')
    np.testing.assert_array_equal(cloud.points[..., 0], np.broadcast_to(OWN_X.astype(kind), (2, 3)))
    np.testing.assert_array_equal(cloud.points[..., 1], np.broadcast_to(OWN_Y[:, None], (2, 3)))
    np.testing.assert_array_equal(cloud.points[..., 2], Z)
    assert cloud.fields == {}


@pytest.mark.parametrize(
    ('arrays', 'sentence'),
    [
        ({'x': OWN_X}, r'has x \(3,\), which do not fit z \(2, 3\)'),
        ({'x': OWN_X, 'y': OWN_X}, r'has x \(3,\) and y \(3,\), which do not fit'),
        ({'x': OWN_Y, 'y': OWN_X}, 'do not fit'),
        ({'x': np.zeros((3, 2)), 'y': np.zeros((3, 2))}, 'do not fit'),
        ({'x': OWN_X, 'y': np.array(['a', 'b'])}, 'must hold numbers'),
        ({'x': OWN_X, 'y': OWN_Y, 'dx': 7.0}, 'has dx 7, but its own x is 0.75 apart: remove one'),
    ],
)
def test_own_coordinates_that_do_not_fit_are_refused(tmp_path, arrays, sentence):
    np.savez(tmp_path / 'a.npz', z=Z, **arrays)
    with pytest.raises(ImportFileError, match=sentence):
        import_cloud(tmp_path / 'a.npz')


def test_own_coordinates_may_agree_with_the_pitches(tmp_path):
    cloud = import_cloud(npz(tmp_path / 'a.npz', x=np.arange(3) * 0.5, y=-np.arange(2) * 2.0))
    assert cloud.points[1, 2, :2].tolist() == [1.0, -2.0]


def whole(kind, *values):
    return np.array(values, kind).reshape(2, 3)


@pytest.mark.parametrize('kind', ['<u8', '>u8', '<i8', '>i8'])
def test_64_bit_numbers_keep_every_digit_or_are_split(tmp_path, kind):
    small = whole(kind, 0, 1, 2**53, 3, 4, 5)
    large = whole(kind, 0, 1, 2**53 + 1, 1726578368464684544, 2**63 - 1, 5)
    if kind[1] == 'i':
        large[0, 0] = -1
    cloud = import_cloud(npz(tmp_path / 'a.npz', small=small, large=large))
    assert list(cloud.fields) == ['small', 'large_high', 'large_low']
    np.testing.assert_array_equal(cloud.fields['small'], small.astype('f8'))
    high, low = (cloud.fields[f'large_{part}'].astype(object) for part in ('high', 'low'))
    np.testing.assert_array_equal(high * 2**32 + low, large.astype(object))
    assert cloud.fields['large_high'].dtype == f'{kind[1]}4'
    assert ['64-bit' in note for note in cloud.notes] == [True]


def test_64_bit_heights_that_lose_digits_are_refused(tmp_path):
    with pytest.raises(ImportFileError, match='lose digits as coordinates'):
        import_cloud(npz(tmp_path / 'a.npz', z=whole('u8', 0, 1, 2**53 + 1, 3, 4, 5)))
    assert import_cloud(npz(tmp_path / 'a.npz', z=whole('>u8', 0, 1, 2, 3, 4, 2**53))).points[1, 2, 2] == 2**53


@pytest.mark.skipif(np.dtype(np.longdouble).itemsize == 8, reason='there is no wider float here')
def test_floats_of_more_than_64_bits_are_told_if_they_lose_digits(tmp_path):
    values = whole(np.longdouble, 1, 2, 3, 4, 5, 6)
    assert import_cloud(npz(tmp_path / 'a.npz', a=values)).notes == ()
    values[0, 0] += np.finfo(np.longdouble).eps
    assert 'of which 64 are kept' in import_cloud(npz(tmp_path / 'a.npz', a=values)).notes[0]


@given(
    values=st.sampled_from(['?', 'i1', '>i2', 'u4', '>i4', 'i8', '>u8', 'f2', '>f4', 'f8']).flatmap(
        lambda kind: arrays.arrays(kind, (2, 3))
    )
)
def test_fields_of_any_type_keep_their_values(values, tmp_path_factory):
    cloud = import_cloud(npz(tmp_path_factory.getbasetemp() / 'fields.npz', a=values))
    assert all(field.dtype.isnative for field in cloud.fields.values())
    if 'a' in cloud.fields:
        assert (cloud.fields['a'].astype(object) == values.astype(object))[~np.isnan(values)].all()
    else:
        high, low = (cloud.fields[f'a_{part}'].astype(object) for part in ('high', 'low'))
        assert (high * 2**32 + low == values.astype(object)).all()


def test_a_field_with_the_name_of_another_gets_its_own(tmp_path):
    cloud = import_cloud(npz(tmp_path / 'a.npz', a_0=Z, a=np.array([Z, Z])))
    assert list(cloud.fields) == ['a_0', 'a_0_2', 'a_1']
    assert 'a_0 becomes a_0_2' in cloud.notes[0]


@pytest.mark.parametrize(('name', 'field'), [('', 'field'), ('a\tb', 'ab'), ('x_', 'x_'), ('dx_\x7f', 'dx_')])
def test_a_field_has_a_name_that_a_message_holds(tmp_path, name, field):
    cloud = import_cloud(npz(tmp_path / 'a.npz', **{name: Z}))
    assert list(cloud.fields) == [field]
    assert bool(cloud.notes) == (name != field)
    record_clouds([tmp_path / 'a.npz'], tmp_path / 'a.mcap')
    with open_recording(tmp_path / 'a.mcap') as recording:
        (message,) = recording.messages(['/points'])
    assert [each.name for each in PointCloud.decode(message.data).fields] == ['x', 'y', 'z', field]


def test_a_small_archive_that_expands_to_much_is_refused(tmp_path, monkeypatch):
    monkeypatch.setenv(LIMIT_VARIABLE, '1')
    big = np.zeros((1000, 1000))
    np.savez_compressed(tmp_path / 'a.npz', z=big, dx=1.0, dy=1.0)
    tracemalloc.start()
    with pytest.raises(ImportFileError, match=r"with 'z' it expands to 8 MB, above the limit of 1 MB"):
        import_cloud(tmp_path / 'a.npz')
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1e6
    monkeypatch.setenv(LIMIT_VARIABLE, '20')
    np.savez_compressed(tmp_path / 'a.npz', z=big, dx=1.0, dy=1.0, a=big, b=big)
    with pytest.raises(ImportFileError, match=r"with 'b' it expands to 24 MB, above the limit of 20 MB"):
        import_cloud(tmp_path / 'a.npz')
    np.savez(tmp_path / 'a.npz', z=big, dx=1.0, dy=1.0, a=big, b=big)
    assert import_cloud(tmp_path / 'a.npz').points.shape == (1000, 1000, 3)


def test_an_array_that_states_more_than_it_holds_is_refused_before_memory_is_allocated(tmp_path):
    path = npz(tmp_path / 'a.npz')
    content = path.read_bytes().replace(b"'shape': (2, 3), }", b"'shape': (9999,9999)}")
    path.write_bytes(content.replace(b"'shape': (9999,9999)}  ", b"'shape': (9999,9999)}"))
    tracemalloc.start()
    with pytest.raises(ImportFileError, match=r'is not an \.npz archive'):
        import_cloud(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1e6


def test_a_single_array_is_refused(tmp_path):
    with (tmp_path / 'a.npz').open('wb') as file:
        np.save(file, Z)
    with pytest.raises(ImportFileError, match=r'is not an \.npz archive'):
        import_cloud(tmp_path / 'a.npz')


def test_a_ply_without_a_size_needs_a_shape(tmp_path):
    path = ply(tmp_path / 'a.ply')
    with pytest.raises(ImportFileError, match=r'is not organized: .* 6 points, so give the shape'):
        import_cloud(path)
    cloud = import_cloud(path, shape=(2, 3))
    assert cloud.points.shape == (2, 3, 3)
    assert cloud.points.dtype == np.float64
    assert cloud.unit is None


@pytest.mark.parametrize(
    ('options', 'shape', 'sentence'),
    [
        ({}, (2, 2), r'has 6 points, which are not 2 rows × 2 columns'),
        (
            {'size': 'obj_info num_cols 3\nobj_info num_rows 2\n'},
            (3, 2),
            r'has 2 rows × 3 columns of points, not 3 rows × 2 columns',
        ),
        ({'size': 'obj_info num_cols 4\nobj_info num_rows 2\n'}, None, r'which are not 2 rows × 4 columns'),
        ({'properties': XYZ.replace(' z', ' depth')}, (2, 3), r"has no coordinate 'z'"),
        ({'line': 'nan nan nan\n'}, (2, 3), r'has no measured point'),
    ],
)
def test_points_without_a_grid_are_refused(tmp_path, options, shape, sentence):
    with pytest.raises(ImportFileError, match=sentence):
        import_cloud(ply(tmp_path / 'a.ply', **options), shape=shape)


def test_places_of_a_range_grid_without_a_vertex_are_not_measured(tmp_path):
    header = PLY.format(
        size='obj_info num_cols 2\nobj_info num_rows 2\n',
        count=2,
        properties=XYZ + 'property uchar red\nelement range_grid 4\nproperty list uchar int vertex_indices\n',
    )
    path = tmp_path / 'a.ply'
    path.write_text(header + '1 2 3 7\n4 5 6 8\n' + '0\n1 1\n1 0\n0\n')
    cloud = import_cloud(path)
    np.testing.assert_array_equal(cloud.points[..., 2], [[np.nan, 6], [3, np.nan]])
    np.testing.assert_array_equal(cloud.fields['red'], [[0, 8], [7, 0]])
    path.write_text(header + '1 2 3 7\n4 5 6 8\n' + '0\n1 1\n1 2\n0\n')
    with pytest.raises(ImportFileError, match='range_grid that names missing points'):
        import_cloud(path)


def test_a_pcd_becomes_a_cloud_with_its_fields(tmp_path):
    record = np.dtype([('x', 'f4'), ('y', 'f4'), ('z', 'f4'), ('normal', 'f4', 3), ('label', 'u8')])
    points = np.zeros(6, record)
    points['normal'] = np.arange(18).reshape(6, 3)
    header = (
        'FIELDS x y z normal label\nSIZE 4 4 4 4 8\nTYPE F F F F U\nCOUNT 1 1 1 3 1\nWIDTH 3\nHEIGHT 2\n'
        'POINTS 6\nDATA binary\n'
    )
    (tmp_path / 'a.pcd').write_bytes(header.encode() + points.tobytes())
    cloud = import_cloud(tmp_path / 'a.pcd')
    assert list(cloud.fields) == ['normal_0', 'normal_1', 'normal_2', 'label']
    np.testing.assert_array_equal(cloud.fields['normal_2'], [[2, 5, 8], [11, 14, 17]])


@pytest.mark.parametrize(
    ('name', 'sentence'), [('a.npz', 'does not exist'), ('a.stl', 'has an unknown file type')]
)
def test_an_unusable_file_is_named(tmp_path, name, sentence):
    with pytest.raises(ImportFileError, match=f'{name} .*{sentence}|{name} {sentence}'):
        import_cloud(tmp_path / name)


@pytest.mark.skipif(DATA is None, reason='SOCIALCIRCLE_DATA, the folder of real measurements, is not set')
@pytest.mark.parametrize(
    ('name', 'shape', 'fields'),
    [
        ('wyko_opd_sz2', (480, 736), 0),
        ('wyko_opd_st1', (480, 640), 0),
        ('alicona_fv_al3d1', (296, 200), 5),
        ('alicona_fv_rubber', (634, 860), 0),
        ('nanofocus_confocal_bullet_bullet1_land1', (1588, 501), 0),
        ('zygo_dat_metropro1', (480, 640), 0),
        ('nanofocus_nms_1', (512, 512), 0),
    ],
)
def test_real_measurements_are_read(name, shape, fields):
    path = Path(str(DATA), f'{name}.npz')
    cloud = import_cloud(path)
    assert cloud.points.shape == (*shape, 3)
    assert len(cloud.fields) == fields
    with np.load(path) as file:
        np.testing.assert_array_equal(cloud.points[..., 2], file['z'])
        assert cloud.points[-1, -1, 0] == np.float32(file['dx'] * (shape[1] - 1))
        assert cloud.points[-1, -1, 1] == np.float32(file['dy'] * (shape[0] - 1))


@pytest.mark.skipif(DATA is None, reason='SOCIALCIRCLE_DATA, the folder of real measurements, is not set')
def test_a_real_focus_stack_is_refused_as_a_height_map():
    with pytest.raises(ImportFileError, match='holds a focus stack'):
        import_cloud(Path(str(DATA), 'stack_tagarno_pcb_bin2.npz'))
