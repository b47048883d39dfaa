import os
from pathlib import Path

import numpy as np
import pytest

from socialcircle_ros.errors import ImportFileError
from socialcircle_ros.recording import import_cloud

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


def test_an_archive_cut_off_at_any_byte_is_refused(tmp_path):
    content = npz(tmp_path / 'a.npz').read_bytes()
    for length in range(0, len(content), 11):
        (tmp_path / 'cut.npz').write_bytes(content[:length])
        with pytest.raises(ImportFileError, match=r'cut\.npz is not an \.npz archive'):
            import_cloud(tmp_path / 'cut.npz')


def test_pickled_objects_are_refused(tmp_path):
    np.savez(tmp_path / 'a.npz', z=np.array([object()], dtype=object), allow_pickle=True)
    with pytest.raises(ImportFileError, match=r'is not an \.npz archive of numbers'):
        import_cloud(tmp_path / 'a.npz')


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
        ({}, (2, 2), r'has 6 points, which are not 2 × 2'),
        ({'size': 'obj_info num_cols 3\nobj_info num_rows 2\n'}, (3, 2), r'has 2 × 3 points, not 3 × 2'),
        ({'size': 'obj_info num_cols 4\nobj_info num_rows 2\n'}, None, r'which are not 2 × 4'),
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
