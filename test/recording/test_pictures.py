# SPDX-License-Identifier: Apache-2.0
"""Frames from image files: without loss, or refused."""

import struct
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from socialcircle_ros.errors import ImportFileError
from socialcircle_ros.recording.pictures import ImagePage, page_count, read_pictures

pillow = pytest.importorskip('PIL.Image')

GRAY = np.arange(256, dtype=np.uint8).reshape(16, 16)
DEEP = GRAY.astype(np.uint16) * 257


def saved(path, pixels, mode=None, **options):
    image = pillow.fromarray(pixels)
    (image if mode is None else image.convert(mode)).save(path, **options)
    return path


def read(path):
    (picture,) = read_pictures([ImagePage(path)])
    return picture


@pytest.mark.parametrize('suffix', ['png', 'tif', 'bmp'])
def test_8_bits_stay_as_they_are(tmp_path, suffix):
    picture = read(saved(tmp_path / f'a.{suffix}', GRAY))
    np.testing.assert_array_equal(picture.pixels, GRAY)
    assert (picture.pixels.dtype, picture.mode) == (np.uint8, 'gray, 8 bits')


@pytest.mark.parametrize('suffix', ['png', 'tif'])
def test_16_bits_stay_as_they_are(tmp_path, suffix):
    picture = read(saved(tmp_path / f'a.{suffix}', DEEP))
    np.testing.assert_array_equal(picture.pixels, DEEP)
    assert (picture.pixels.dtype, picture.mode) == (np.uint16, 'gray, 16 bits')


@pytest.mark.parametrize('kind', ['f4', 'i4'])
def test_whole_numbers_of_32_bits_become_16_bits(tmp_path, kind):
    picture = read(saved(tmp_path / 'a.tif', DEEP.astype(kind)))
    np.testing.assert_array_equal(picture.pixels, DEEP)
    assert (picture.pixels.dtype, picture.mode) == (
        np.uint16,
        'gray, 32 bits float' if kind == 'f4' else 'gray, 32 bits',
    )


@given(
    values=st.sampled_from(['f4', 'i4']).flatmap(
        lambda kind: arrays.arrays(
            kind, (2, 3), elements=None if kind == 'f4' else st.integers(-(2**31), 2**31 - 1)
        )
    )
)
def test_numbers_of_32_bits_are_kept_exactly_or_refused(values, tmp_path_factory):
    path = saved(tmp_path_factory.getbasetemp() / 'numbers.tif', values)
    fits = bool(((values >= 0) & (values <= 65535) & (values == np.trunc(values))).all())
    if fits:
        np.testing.assert_array_equal(read(path).pixels, values)
    else:
        with pytest.raises(ImportFileError, match=r'(real|whole) numbers of 32 bits, .* scale all frames alike'):
            read(path)


def test_colours_are_weighted_and_gray_colours_stay_as_they_are(tmp_path):
    picture = read(saved(tmp_path / 'a.png', np.dstack([GRAY] * 3)))
    np.testing.assert_array_equal(picture.pixels, GRAY)
    assert picture.mode == 'RGB'
    assert read(saved(tmp_path / 'a.png', GRAY, 'P')).mode == 'palette'
    np.testing.assert_array_equal(read(saved(tmp_path / 'a.png', GRAY, 'P')).pixels, GRAY)
    black_and_white = read(saved(tmp_path / 'a.png', (GRAY > 99).astype(np.uint8) * 255, '1'))
    assert (black_and_white.mode, np.unique(black_and_white.pixels).tolist()) == ('gray, 1 bits', [0, 255])


@pytest.mark.parametrize('mode', ['LA', 'RGBA'])
def test_transparency_is_refused_and_an_opaque_alpha_is_left_out(tmp_path, mode):
    image = pillow.fromarray(GRAY).convert(mode)
    image.save(tmp_path / 'a.png')
    np.testing.assert_array_equal(read(tmp_path / 'a.png').pixels, GRAY)
    image.putpixel((3, 3), (*image.getpixel((3, 3))[:-1], 254))
    image.save(tmp_path / 'a.png')
    with pytest.raises(ImportFileError, match=r'a\.png has transparent pixels'):
        read(tmp_path / 'a.png')


def png(path, bits, kind, body):
    """A PNG that Pillow does not write."""

    def chunk(name, data):
        return struct.pack('>I', len(data)) + name + data + struct.pack('>I', zlib.crc32(name + data))

    header = struct.pack('>IIBBBBB', 2, 2, bits, kind, 0, 0, 0)
    path.write_bytes(
        b'\x89PNG\r\n\x1a\n' + chunk(b'IHDR', header) + chunk(b'IDAT', zlib.compress(body)) + chunk(b'IEND', b'')
    )
    return path


def tiff_of_16_bit_colours(path):
    """A TIFF of 2 × 2 pixels that Pillow does not write."""
    entries = [(256, 3, 1, 2), (257, 3, 1, 2), (258, 3, 3, 200), (259, 3, 1, 1), (262, 3, 1, 2), (273, 4, 1, 210),
               (277, 3, 1, 3), (278, 3, 1, 2), (279, 4, 1, 24)]  # fmt: skip
    directory = struct.pack('<H', len(entries)) + b''.join(struct.pack('<HHII', *entry) for entry in entries)
    head = b'II*\0' + struct.pack('<I', 8) + directory + bytes(4)
    path.write_bytes(head.ljust(200, b'\0') + struct.pack('<HHH', 16, 16, 16).ljust(10, b'\0') + bytes(24))
    return path


def test_colours_of_16_bits_are_refused(tmp_path):
    rows = (b'\0' + bytes(range(12))) * 2
    for path in (png(tmp_path / 'a.png', 16, 2, rows), tiff_of_16_bit_colours(tmp_path / 'a.tif')):
        assert pillow.open(path).mode == 'RGB'  # Pillow says nothing of what it leaves out
        with pytest.raises(ImportFileError, match=r'a\.\w+ has 16 bits for each colour, of which 8 would be kept'):
            read(path)


def test_another_kind_of_pixels_is_refused(tmp_path):
    saved(tmp_path / 'a.tif', np.dstack([GRAY] * 3), 'CMYK')
    with pytest.raises(ImportFileError, match='pixels of the kind CMYK'):
        read(tmp_path / 'a.tif')


def test_pages_are_read_in_the_order_asked_for(tmp_path):
    first, *others = [pillow.fromarray(np.full((4, 5), value, np.uint8)) for value in (1, 2, 3)]
    path = tmp_path / 'a.tif'
    first.save(path, save_all=True, append_images=others)
    assert page_count(path) == 3
    pages = [
        ImagePage(path, 2),
        ImagePage(path, 0),
        ImagePage(saved(tmp_path / 'b.png', GRAY)),
        ImagePage(path, 1),
    ]
    assert [picture.pixels[0, 0] for picture in read_pictures(pages)] == [3, 1, 0, 2]
    assert [str(page) for page in pages] == ['a.tif page 3', 'a.tif page 1', 'b.png', 'a.tif page 2']


@pytest.mark.parametrize(
    'content', [b'', b'no image', b'\x89PNG\r\n\x1a\n', b'II*\0\xff\xff\xff\xff', b'BM' + bytes(30)]
)
def test_what_is_no_image_is_named(tmp_path, content):
    for name in ('a.png', 'a.tif'):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(ImportFileError, match=rf'{name} is damaged, or no image'):
            read(tmp_path / name)


def test_a_missing_file_and_a_directory_are_not_called_damaged_images(tmp_path):
    with pytest.raises(ImportFileError, match=r'a\.png does not exist: check the name'):
        read(tmp_path / 'a.png')
    with pytest.raises(ImportFileError, match=r'cannot be read \(Is a directory\)'):
        read(tmp_path)


@pytest.mark.parametrize('suffix', ['png', 'tif', 'bmp', 'jpg'])
def test_a_damaged_image_is_read_or_named(tmp_path, suffix):
    content = saved(tmp_path / f'a.{suffix}', GRAY).read_bytes()
    rng = np.random.default_rng(0)
    for _ in range(150):
        damaged = bytearray(content[: rng.integers(1, len(content) + 1)])
        damaged[rng.integers(len(damaged))] ^= rng.integers(1, 256)
        (tmp_path / f'b.{suffix}').write_bytes(damaged)
        try:
            read(tmp_path / f'b.{suffix}')
        except ImportFileError as error:
            assert f'b.{suffix} ' in str(error)


def test_a_picture_that_states_too_many_pixels_is_refused(tmp_path):
    path = png(tmp_path / 'a.png', 8, 0, b'')
    content = bytearray(path.read_bytes())
    content[16:24] = struct.pack('>II', 60_000, 60_000)
    content[29:33] = struct.pack('>I', zlib.crc32(content[12:29]))
    path.write_bytes(content)
    with pytest.raises(ImportFileError, match='has too many pixels'):
        read(path)
