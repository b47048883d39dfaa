# SPDX-License-Identifier: Apache-2.0
"""What ImageJ and OME say in a TIFF."""

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.errors import ImportFileError
from socialcircle_ros.recording.pictures import ImagePage, read_pictures
from socialcircle_ros.recording.tiff import read_tiff_stack

pillow = pytest.importorskip('PIL.Image')

IMAGEJ = 'ImageJ=1.54f\nimages=3\nslices=3\nunit={unit}\nspacing={spacing}\nloop=false\nmin=0.0\nmax=255.0\n'
OME = (
    '<?xml version="1.0" encoding="UTF-8"?><OME xmlns="http://www.openmicroscopy.org/Schemas/OME/2016-06">'
    '<Image ID="Image:0"><Pixels DimensionOrder="XYZCT" Type="uint8" SizeX="5" SizeY="4" {sizes} {physical}>'
    '<Channel ID="Channel:0:0" SamplesPerPixel="1"/>{inside}</Pixels></Image></OME>'
)
PHYSICAL = (
    'PhysicalSizeX="0.5" PhysicalSizeY="500" PhysicalSizeYUnit="nm" PhysicalSizeZ="2" PhysicalSizeZUnit="µm"'
)


def tiff(path, description, pages=3, resolution=None, encoding='utf-8'):
    first, *others = [pillow.fromarray(np.full((4, 5), page, np.uint8)) for page in range(pages)]
    from PIL.TiffImagePlugin import ImageFileDirectory_v2

    tags = ImageFileDirectory_v2()
    tags[270] = description.encode(encoding)
    if resolution is not None:
        tags[282], tags[283] = resolution if isinstance(resolution, tuple) else (resolution, resolution)
        tags[296] = 1
    first.save(path, save_all=True, append_images=others, tiffinfo=tags)
    return path


def ome(path, *, sizes='SizeZ="3" SizeC="1" SizeT="1"', physical=PHYSICAL, inside='<TiffData/>', pages=3):
    return tiff(path, OME.format(sizes=sizes, physical=physical, inside=inside), pages)


@pytest.mark.parametrize(
    ('unit', 'metres'),
    [('micron', 1e-6), ('µm', 1e-6), ('\\u00B5m', 1e-6), ('um', 1e-6), ('nm', 1e-9), ('mm', 1e-3)],
)
@pytest.mark.parametrize('encoding', ['utf-8', 'latin-1'])
def test_imagej_gives_pitch_and_z(tmp_path, unit, metres, encoding):
    text = IMAGEJ.format(unit=unit, spacing=2.5)
    stack = read_tiff_stack(tiff(tmp_path / 'a.tif', text, resolution=4.0, encoding=encoding))
    assert stack.pages == [0, 1, 2]
    assert stack.pitch == pytest.approx((0.25 * metres, 0.25 * metres))
    assert stack.z == pytest.approx([0, 2.5 * metres, 5 * metres])


@pytest.mark.parametrize('axis', 'yz')
@pytest.mark.parametrize(('unit', 'metres'), [('nm', 1e-9), ('mm', 1e-3), ('um', 1e-6), ('', 1e-6)])
def test_imagej_may_have_a_unit_for_each_axis(tmp_path, axis, unit, metres):
    text = IMAGEJ.format(unit='um', spacing=2.5) + f'{axis}unit={unit}\n'
    stack = read_tiff_stack(tiff(tmp_path / 'a.tif', text, resolution=(2.0, 4.0)))
    y, z = (metres if axis == each else 1e-6 for each in 'yz')
    assert stack.pitch == pytest.approx((0.5e-6, 0.25 * y))
    assert stack.z == pytest.approx([0, 2.5 * z, 5 * z])
    assert stack.notes == ('ImageJ says unit um' + f', {axis} in {unit}' * (unit in ('nm', 'mm')),)


def test_a_unit_of_imagej_that_is_no_length_gives_no_pitch(tmp_path):
    text = IMAGEJ.format(unit='um', spacing=2.5) + 'yunit=sec\n'
    stack = read_tiff_stack(tiff(tmp_path / 'a.tif', text, resolution=2.0))
    assert stack.pitch is None
    assert stack.z == pytest.approx([0, 2.5e-6, 5e-6])


def test_the_unit_along_y_that_tifffile_writes_is_read(tmp_path):
    tifffile = pytest.importorskip('tifffile', reason='tifffile, which writes TIFF files, is not installed')
    frames = np.zeros((3, 4, 5), np.uint16)
    metadata = {'spacing': 2.5, 'unit': 'um', 'yunit': 'nm', 'axes': 'ZYX'}
    tifffile.imwrite(tmp_path / 'a.tif', frames, imagej=True, resolution=(2, 1 / 250), metadata=metadata)
    assert read_tiff_stack(tmp_path / 'a.tif').pitch == pytest.approx((5e-7, 2.5e-7))


@pytest.mark.parametrize(
    'description', [IMAGEJ.format(unit='pixel', spacing=1), 'ImageJ=1.54f\nimages=3\n', 'a part', '']
)
def test_what_is_not_said_is_not_known(tmp_path, description):
    stack = read_tiff_stack(tiff(tmp_path / 'a.tif', description, resolution=4.0))
    assert (stack.pages, stack.z, stack.pitch) == ([0, 1, 2], None, None)


def test_the_dots_per_inch_of_a_picture_are_no_pitch(tmp_path):
    first, *others = [pillow.fromarray(np.zeros((4, 5), np.uint8))] * 3
    first.save(tmp_path / 'a.tif', save_all=True, append_images=others, dpi=(72, 72))
    assert read_tiff_stack(tmp_path / 'a.tif').pitch is None


@pytest.mark.parametrize(
    ('description', 'sentence'),
    [
        ('ImageJ=1.54f\nimages=3\nchannels=3\n', '3 channels, 1 slices and 1 times'),
        ('ImageJ=1.54f\nimages=4\nslices=2\nframes=2\n', '1 channels, 2 slices and 2 times'),
        ('ImageJ=1.54f\nimages=900\nslices=900\n', '900 images in one block, of which 3 can be read'),
    ],
)
def test_an_imagej_file_that_is_no_stack_is_refused(tmp_path, description, sentence):
    with pytest.raises(ImportFileError, match=rf'a\.tif has {sentence}'):
        read_tiff_stack(tiff(tmp_path / 'a.tif', description))


def test_times_of_imagej_are_no_z(tmp_path):
    stack = read_tiff_stack(tiff(tmp_path / 'a.tif', 'ImageJ=1.54f\nimages=3\nframes=3\nunit=um\nspacing=2\n'))
    assert stack.z is None
    assert 'its pages are times, not slices' in stack.notes


def test_ome_gives_pitch_and_z(tmp_path):
    stack = read_tiff_stack(ome(tmp_path / 'a.tif'))
    assert stack.pages == [0, 1, 2]
    assert stack.pitch == pytest.approx((5e-7, 5e-7))
    assert stack.z == pytest.approx([0, 2e-6, 4e-6])


@pytest.mark.parametrize(
    ('unit', 'metres'), [('pm', 1e-12), ('cm', 1e-2), ('µm', 1e-6), ('μm', 1e-6), ('Å', 1e-10), ('pixel', None)]
)
def test_the_units_of_ome_are_read(tmp_path, unit, metres):
    physical = f'PhysicalSizeX="2" PhysicalSizeXUnit="{unit}" PhysicalSizeY="2" PhysicalSizeYUnit="{unit}"'
    pitch = read_tiff_stack(ome(tmp_path / 'a.tif', physical=physical)).pitch
    assert pitch == (metres and pytest.approx((2 * metres, 2 * metres)))


def test_positions_of_planes_come_before_the_step(tmp_path):
    planes = ''.join(
        f'<Plane TheZ="{z}" TheC="0" TheT="0" PositionZ="{position}" PositionZUnit="mm"/>'
        for z, position in enumerate((1, 1.5, 3))
    )
    assert read_tiff_stack(ome(tmp_path / 'a.tif', inside=planes)).z == pytest.approx([1e-3, 1.5e-3, 3e-3])
    without_unit = planes.replace('PositionZUnit="mm"', '')
    assert read_tiff_stack(ome(tmp_path / 'a.tif', inside=without_unit)).z == pytest.approx([0, 2e-6, 4e-6])


def test_ome_says_which_page_is_which_plane(tmp_path):
    data = ''.join(f'<TiffData IFD="{page}" FirstZ="{z}" PlaneCount="1"/>' for page, z in enumerate((2, 0, 1)))
    assert read_tiff_stack(ome(tmp_path / 'a.tif', inside=data)).pages == [1, 2, 0]


@pytest.mark.parametrize(
    ('options', 'sentence'),
    [
        ({'sizes': 'SizeZ="3" SizeC="2" SizeT="1"'}, '2 channels and 1 times'),
        ({'sizes': 'SizeZ="3" SizeC="1" SizeT="5"'}, '1 channels and 5 times'),
        ({'sizes': 'SizeZ="9" SizeC="1" SizeT="1"'}, '3 pages of 9 planes'),
        (
            {'inside': '<TiffData IFD="0" FirstZ="0"/><TiffData IFD="0" FirstZ="1"/>'},
            'pages that OME does not name',
        ),
        ({'inside': '<TiffData IFD="7" FirstZ="0" PlaneCount="3"/>'}, 'pages that OME does not name'),
        ({'inside': '<'}, 'a description by OME that cannot be read'),
        ({'inside': '</Pixels><Pixels SizeZ="3">'}, '2 images: save one'),
    ],
)
def test_an_ome_file_that_is_no_stack_is_refused(tmp_path, options, sentence):
    with pytest.raises(ImportFileError, match=rf'a\.tif has {sentence}'):
        read_tiff_stack(ome(tmp_path / 'a.tif', **options))


def test_entities_that_would_fill_the_memory_are_refused(tmp_path):
    bomb = '<!DOCTYPE a [<!ENTITY a "aaaaaaaaaa">' + ''.join(
        f'<!ENTITY {chr(98 + i)} "{f"&{chr(97 + i)};" * 10}">' for i in range(12)
    )
    text = OME.format(sizes='SizeZ="3"', physical=PHYSICAL, inside='&m;').replace('?><OME', f'?>{bomb}]><OME')
    with pytest.raises(ImportFileError, match='a description by OME that cannot be read'):
        read_tiff_stack(tiff(tmp_path / 'a.tif', text))


def test_a_stack_that_is_cut_off_is_refused(tmp_path):
    whole = tiff(tmp_path / 'a.tif', IMAGEJ.format(unit='um', spacing=1)).read_bytes()
    for length in range(1, len(whole.rstrip(b'\0'))):
        (tmp_path / 'a.tif').write_bytes(whole[:length])
        with pytest.raises(ImportFileError, match=r'a\.tif (is damaged|has 3 images in one block)'):
            list(read_pictures([ImagePage(tmp_path / 'a.tif', page) for page in _pages(tmp_path / 'a.tif')]))


def _pages(path):
    return read_tiff_stack(path).pages


def test_a_tag_with_more_values_than_it_needs_is_no_damage(tmp_path):
    path = tiff(tmp_path / 'a.tif', 'no words of a program', resolution=2.0)
    one, two = (struct.pack('<HHI', 282, 5, count) for count in (1, 2))
    path.write_bytes(path.read_bytes().replace(one, two))
    with pytest.warns(UserWarning, match='Metadata Warning'), pillow.open(path) as image:
        assert image.tag_v2[282] == 2.0
    assert _pages(path) == [0, 1, 2]


@given(text=st.text('ImageJ=\n<OME>abc0.5-e/"', max_size=60))
def test_any_description_is_read_or_refused(text, tmp_path_factory):
    for start in ('ImageJ=1\n', '<OME '):
        try:
            stack = read_tiff_stack(tiff(tmp_path_factory.getbasetemp() / 'any.tif', start + text))
        except ImportFileError:
            continue
        assert len(stack.pages) == 3
