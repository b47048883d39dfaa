# SPDX-License-Identifier: Apache-2.0
"""Every format that is written: import → export → import is exact, and what is lost is said."""

import builtins
import codecs
import os
import struct
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from surfaces import same_bits, surfaces

from socialcircle_ros.errors import CloudError, ImportFileError, SettingError, SocialCircleError
from socialcircle_ros.formats import (
    FORMATS,
    MeasuredSurface,
    OrganizedCloud,
    format_of,
    read_file,
    suffixes,
    write_cloud_file,
    write_surface,
)
from socialcircle_ros.recording import import_cloud, read_surface
from socialcircle_ros.recording.create import record_clouds

WRITTEN = suffixes(written=True)
PLANE = MeasuredSurface(np.zeros((3, 4), np.float32), (1.0, 2.0), 'm')


def imported(path):
    return import_cloud(path).organized()


@pytest.mark.parametrize('suffix', WRITTEN)
@settings(max_examples=25)
@given(data=st.data())
def test_import_export_import_is_exact(suffix, data):
    form = format_of(Path(f'a{suffix}'))
    surface = data.draw(surfaces(('f4', 'f8') if form.double else ('f4',), marks=suffix != '.sdf', least=1))
    if form.double and not form.metres:
        surface = MeasuredSurface(
            surface.heights, surface.pitch, data.draw(st.sampled_from(('m', 'um'))), surface.fields
        )
    with tempfile.TemporaryDirectory() as folder:
        first, second = Path(folder) / f'first{suffix}', Path(folder) / f'second{suffix}'
        write_surface(first, surface)
        once = imported(first)
        notes = write_cloud_file(second, once)
        again = imported(second)
    assert same_bits(once.points[..., 2], surface.heights)
    measured = np.isfinite(once.points).all(axis=-1)
    assert same_bits(once.points[measured], again.points[measured])
    assert same_bits(once.points[..., 2], again.points[..., 2])
    assert (once.unit, again.unit) == (surface.unit, surface.unit)
    assert notes == ()
    expected = surface.fields if form.fields else {}
    assert sorted(again.fields) == sorted(expected)
    assert all(same_bits(again.fields[name], expected[name]) for name in expected)


KINDS = ('?', 'i1', 'u1', '>i2', 'u2', 'i4', '>u4', 'i8', 'u8', 'f2', 'f4', '>f8')
NAMES = st.text(max_size=4) | st.sampled_from(('%', 'µ', '#', '_', '__', 'Höhe', 'x', 'z', 'dx', 'unit', 'a_high'))


@st.composite
def any_fields(draw, shape):
    """Fields of any type of number with any names, some masked."""
    fields = {}
    for name, kind in draw(st.dictionaries(NAMES, st.sampled_from(KINDS), max_size=4)).items():
        values = draw(hnp.arrays(kind, shape))
        masked = kind not in ('i8', 'u8') and draw(st.booleans())
        fields[name] = np.ma.masked_array(values, draw(hnp.arrays(bool, shape))) if masked else values
    return fields


def numbers(values):
    """The numbers of a field as Python has them, with None for NaN and what is masked."""
    mask = np.ma.getmaskarray(values) | np.isnan(np.ma.getdata(values))
    return np.where(mask, None, np.ma.getdata(values).astype(object)).tolist()


@pytest.mark.parametrize('suffix', WRITTEN)
@settings(max_examples=60)
@given(data=st.data())
def test_any_heights_and_fields_come_back_or_what_changes_is_told(suffix, data):
    form = format_of(Path(f'a{suffix}'))
    shape = data.draw(st.tuples(st.integers(1, 4), st.integers(1, 4)))
    kind = data.draw(st.sampled_from(('i1', '>u2', 'f2', 'f4', '>f4', *(('i4', 'f8') if form.double else ()))))
    # The largest numbers of float32 mean "not measured" in SDF.
    elements = hnp.from_dtype(np.dtype(kind)).filter(lambda each: abs(float(each)) < 1e30)
    mask = data.draw(hnp.arrays(bool, shape))
    mask[0, 0] = False
    heights = np.ma.masked_array(data.draw(hnp.arrays(kind, shape, elements=elements)), mask)
    fields = data.draw(any_fields(shape))
    surface = MeasuredSurface(heights, [0.1234567890123, 2], 'm', fields, {'a': 'ä'})
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f'a{suffix}'
        notes = write_surface(path, surface)
        found = read_surface(path)
    np.testing.assert_array_equal(found.heights, heights.astype(float).filled(np.nan))
    assert (found.pitch, found.unit, found.metadata) == (surface.pitch, 'm', {'a': 'ä'})
    if not form.fields:
        assert any('holds heights only' in note for note in notes) == bool(fields)
        return
    split = {name for name in fields if any(f'The field {name} has 64-bit' in note for note in notes)}
    told = split | {name for name in fields if any(repr(name) in note for note in notes)}
    for name in fields.keys() - told:
        assert numbers(found.fields[name]) == numbers(fields[name])
    assert len(found.fields) == len(fields) + len(split)
    assert '_' not in found.fields


@pytest.mark.parametrize('suffix', ['.npz', '.ply', '.pcd', '.csv', '.xyz'])
def test_names_that_a_format_does_not_hold_are_told_and_their_fields_stay(tmp_path, suffix):
    names = ['Höhe', 'H_he', '%', '_', 'x', 'a b']
    fields = {name: np.full((3, 4), place) for place, name in enumerate(names)}
    notes = write_surface(tmp_path / f'a{suffix}', replace(PLANE, fields=fields))
    found = read_surface(tmp_path / f'a{suffix}').fields
    assert [int(values[0, 0]) for values in found.values()] == list(range(6))
    if suffix == '.npz':
        assert list(found) == ['Höhe', 'H_he', '%', 'field', 'x_2', 'a b']
        assert notes == ("The field '_' is named field in the file.", "The field 'x' is named x_2 in the file.")
    else:
        assert list(found) == ['H_he_2', 'H_he', 'field', 'field_2', 'x_2', 'a_b']
        assert "The field 'Höhe' is named H_he_2 in the file." in notes
        assert len(notes) == 5


def test_labels_stay_whole_numbers_and_those_of_64_bits_are_split(tmp_path):
    fields = {'label': np.arange(12).reshape(3, 4), 'id': np.full((3, 4), 2**60 + 1), 'id_low': PLANE.heights}
    notes = write_surface(tmp_path / 'a.ply', replace(PLANE, fields=fields))
    found = read_surface(tmp_path / 'a.ply').fields
    assert found['label'].dtype == np.int32
    assert int(found['id_high'][0, 0]) * 2**32 + int(found['id_low_2'][0, 0]) == 2**60 + 1
    assert notes == (
        'The field id has 64-bit whole numbers, which no field holds: it becomes id_high · 2³² + id_low.',
        'The field id_low becomes id_low_2, because there is one with its name.',
    )


def test_what_is_no_surface_or_cloud_is_not_written(tmp_path):
    with pytest.raises(CloudError, match=r'A surface is MeasuredSurface\(heights, pitch, unit\), not ndarray'):
        write_surface(tmp_path / 'a.csv', PLANE.heights)
    with pytest.raises(CloudError, match=r'is OrganizedCloud\(points, unit\), not MeasuredSurface'):
        write_cloud_file(tmp_path / 'a.csv', PLANE)


@pytest.mark.parametrize('suffix', ['.csv', '.ply', '.pcd'])
def test_long_metadata_come_back(tmp_path, suffix):
    metadata = {'settings': 'ä' * 100_000}
    write_surface(tmp_path / f'a{suffix}', replace(PLANE, metadata=metadata))
    assert read_surface(tmp_path / f'a{suffix}').metadata == metadata


@pytest.mark.parametrize('suffix', WRITTEN)
def test_metadata_with_the_name_of_a_file_that_is_no_utf_8_come_back(tmp_path, suffix):
    metadata = {'source': os.fsdecode(b'part\xff.x3p')}
    write_surface(tmp_path / f'a{suffix}', replace(PLANE, metadata=metadata))
    assert read_surface(tmp_path / f'a{suffix}').metadata == metadata


@pytest.mark.parametrize('kind', ['U4', 'M8', 'what'])
def test_an_own_text_with_other_types_than_numbers_is_refused(tmp_path, kind):
    path = tmp_path / 'a.csv'
    write_surface(path, PLANE)
    path.write_text(path.read_text().replace('# types f4', f'# types {kind}'))
    with pytest.raises(ImportFileError, match='does not match its header'):
        import_cloud(path)


def test_an_own_text_with_a_type_that_a_message_does_not_hold_is_imported(tmp_path):
    path = tmp_path / 'a.csv'
    write_surface(path, replace(PLANE, fields={'n': np.ones((3, 4), np.int32)}))
    path.write_text(path.read_text().replace('f4 i4', 'f4 i8'))
    record_clouds([path], tmp_path / 'a.mcap')
    assert import_cloud(path).fields['n'].dtype == np.float64


def test_a_unit_with_control_characters_does_not_make_a_file_unreadable(tmp_path):
    path = tmp_path / 'a.ply'
    write_surface(path, PLANE)
    path.write_bytes(path.read_bytes().replace(b'unit m', b'unit \x07m'))
    assert read_surface(path).unit == 'm'


@pytest.mark.parametrize('suffix', WRITTEN)
@settings(max_examples=25)
@given(data=st.data())
def test_the_metadata_come_back(suffix, data):
    surface = data.draw(surfaces(('f4',)))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f'a{suffix}'
        write_surface(path, surface)
        assert read_surface(path).metadata == surface.metadata


@pytest.mark.parametrize('suffix', ['.csv', '.xyz', '.sdf', '.ply', '.pcd'])
def test_a_byte_order_mark_before_a_text_is_no_part_of_it(tmp_path, suffix):
    path = tmp_path / f'a{suffix}'
    write_surface(path, PLANE)
    path.write_bytes(codecs.BOM_UTF8 + path.read_bytes())
    found = imported(path)
    assert (found.points.shape, found.unit) == ((3, 4, 3), 'm')
    assert np.isfinite(found.points).all()


@pytest.mark.parametrize('suffix', ['.x3p', '.sdf'])
def test_a_format_in_metres_converts_and_says_so(tmp_path, suffix):
    heights = np.array([[1, 2.5], [np.nan, 4]], np.float32)
    notes = write_surface(tmp_path / f'a{suffix}', MeasuredSurface(heights, (2.0, 3.0), 'um'))
    assert notes == (f'{suffix} is always in m: the lengths are converted from µm, in float64.',)
    read = read_file(tmp_path / f'a{suffix}')
    np.testing.assert_array_equal(read.heights, heights.astype(float) * 1e-6)
    assert (read.pitch, read.unit) == ((2.0 * 1e-6, 3.0 * 1e-6), 'm')
    with pytest.raises(SettingError, match='The unit of the coordinates is not named'):
        write_surface(tmp_path / f'b{suffix}', MeasuredSurface(heights, (2.0, 3.0)))


def test_heights_that_float32_does_not_hold_are_told(tmp_path):
    heights = np.array([[0.1, 0.5], [0.25, np.nan]])
    assert write_surface(tmp_path / 'a.tif', MeasuredSurface(heights, (1, 1), 'm')) == (
        '.tif holds float32: the heights are rounded from float64.',
    )
    assert write_surface(tmp_path / 'b.tif', MeasuredSurface(np.round(heights), (1, 1), 'm')) == ()


@pytest.mark.parametrize('suffix', ['.x3p', '.sdf', '.tiff'])
def test_fields_that_a_format_does_not_hold_are_told(tmp_path, suffix):
    surface = MeasuredSurface(PLANE.heights, PLANE.pitch, 'm', {'intensity': np.ones((3, 4), np.uint8)})
    (note,) = write_surface(tmp_path / f'a{suffix}', surface)
    assert note.endswith('holds heights only: intensity is left out.')


@pytest.mark.parametrize('suffix', ['.npz', '.x3p', '.sdf', '.tiff'])
def test_points_off_a_grid_are_refused_by_height_maps_and_held_by_clouds(tmp_path, suffix):
    points = PLANE.cloud().points
    points[1, 2, 0] += 0.3
    with pytest.raises(CloudError, match=r'off a regular grid by 0\.\d+ of the pitch in x.*ply or pcd'):
        write_cloud_file(tmp_path / f'a{suffix}', OrganizedCloud(points, 'm'))
    assert not list(tmp_path.iterdir())
    for other in ('.ply', '.pcd', '.csv', '.xyz'):
        write_cloud_file(tmp_path / f'a{other}', OrganizedCloud(points, 'm'))
        assert same_bits(import_cloud(tmp_path / f'a{other}').points, points)


@pytest.mark.parametrize('suffix', WRITTEN)
def test_an_existing_file_is_kept(tmp_path, suffix):
    path = tmp_path / f'a{suffix}'
    path.write_bytes(b'precious')
    with pytest.raises(SocialCircleError, match='exists already: give --overwrite'):
        write_surface(path, PLANE)
    assert path.read_bytes() == b'precious'
    write_surface(path, PLANE, overwrite=True)
    assert same_bits(import_cloud(path).points[..., 2], PLANE.heights)
    assert [each.name for each in tmp_path.iterdir()] == [path.name]


def test_the_same_surface_gives_the_same_bytes(tmp_path):
    for suffix in WRITTEN:
        for name in 'ab':
            write_surface(tmp_path / f'{name}{suffix}', PLANE)
        one, other = ((tmp_path / f'{name}{suffix}').read_bytes() for name in 'ab')
        assert one == other or suffix == '.npz'  # NumPy writes the time into the archive


def test_an_unknown_suffix_lists_those_that_are_known(tmp_path):
    with pytest.raises(SocialCircleError, match=r'its suffix must be one of \.npz, \.ply'):
        write_surface(tmp_path / 'a.doc', PLANE)
    with pytest.raises(ImportFileError, match=r'unknown file type: give one of \.npz'):
        read_file(tmp_path / 'a.doc')


@pytest.mark.parametrize('suffix', [each for form in FORMATS for each in form.suffixes])
def test_a_file_of_nonsense_is_refused_in_one_sentence(tmp_path, suffix):
    path = tmp_path / f'a{suffix}'
    for content in (b'', b'\0' * 300, b'nonsense\n' * 30, np.random.default_rng(0).bytes(300)):
        path.write_bytes(content)
        with pytest.raises(ImportFileError) as refusal:
            import_cloud(path)
        assert path.name in str(refusal.value)
        assert '\n' not in str(refusal.value)


@pytest.mark.parametrize('suffix', ['.x3p', '.sdf', '.csv', '.tiff'])
@settings(max_examples=25)
@given(data=st.data())
def test_a_file_that_is_cut_off_is_refused(suffix, data):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f'a{suffix}'
        write_surface(path, PLANE)
        whole = path.read_bytes()
        end = whole.rfind(b'\n*\nsocialcircle') if suffix == '.sdf' else len(whole) - 1
        path.write_bytes(whole[: data.draw(st.integers(1, end - 1))])
        if suffix == '.csv' and path.read_bytes().count(b'\n') == whole.count(b'\n') - 1:
            return  # the last digits of the last number
        with pytest.raises(ImportFileError):
            import_cloud(path)


@pytest.mark.parametrize('suffix', WRITTEN)
@settings(max_examples=40)
@given(changes=st.lists(st.tuples(st.integers(0, 400), st.integers(0, 255)), min_size=1, max_size=3))
def test_a_file_with_changed_bytes_is_read_or_refused_in_one_sentence(suffix, changes):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f'a{suffix}'
        write_surface(path, PLANE)
        content = bytearray(path.read_bytes())
        for place, value in changes:
            content[place % len(content)] = value
        path.write_bytes(content)
        try:
            import_cloud(path)
        except ImportFileError as error:
            assert path.name in str(error)
            assert '\n' not in str(error)


@pytest.mark.parametrize('damaged', [(339, 3, 1 << 24, 3), (339, 99, 1, 3), (999, 3, 1, 3)])
def test_a_tiff_whose_type_of_number_is_damaged_is_refused(tmp_path, damaged):
    """Pillow then reads the bits of float32 as whole numbers, and only warns, or not even that."""
    pytest.importorskip('PIL.Image')
    path = tmp_path / 'a.tif'
    write_surface(path, PLANE)
    content, kind = path.read_bytes(), struct.pack('<HHII', 339, 3, 1, 3)
    assert content.count(kind) == 1
    path.write_bytes(content.replace(kind, struct.pack('<HHII', *damaged)))
    with pytest.raises(ImportFileError, match=r'a\.tif is damaged'):
        import_cloud(path)


@pytest.mark.parametrize('suffix', ['.npz', '.tif'])
def test_a_file_whose_pitch_the_type_of_its_heights_does_not_hold_is_refused(tmp_path, suffix):
    path = tmp_path / f'a{suffix}'
    write_surface(path, MeasuredSurface(PLANE.heights, (1e300, 2.0), 'm'))
    with pytest.raises(
        ImportFileError, match=rf'a\{suffix} cannot be used: float32 does not hold the coordinates'
    ):
        import_cloud(path)


@pytest.mark.parametrize('error', ['KeyError', 'TypeError', 'DecompressionBombError'])
def test_whatever_pillow_raises_for_a_damaged_tiff_becomes_one_sentence(tmp_path, monkeypatch, error):
    image = pytest.importorskip('PIL.Image')
    write_surface(tmp_path / 'a.tif', PLANE)
    kind = getattr(image, error, None) or getattr(builtins, error)

    def opened(_):
        raise kind(262)

    monkeypatch.setattr(image, 'open', opened)
    with pytest.raises(ImportFileError, match=r'a\.tif (is damaged, or no TIFF file|states more pixels)'):
        import_cloud(tmp_path / 'a.tif')
