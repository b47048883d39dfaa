# SPDX-License-Identifier: Apache-2.0
"""TIFF files with heights, as other programs write them."""

import struct
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from socialcircle_ros.errors import ImportFileError
from socialcircle_ros.formats import read_file

pytest.importorskip('PIL.Image', reason='Pillow, which reads TIFF files, is not installed')

NUMBERS = {'u2': 1, 'i2': 2, 'u4': 1, 'i4': 2, 'f4': 3}  # the sample format of a type


def tiff(heights, order='<', sample_format=None):
    """The bytes of a TIFF with one page of numbers, by the description of the format."""
    rows, columns = heights.shape
    data = heights.astype(heights.dtype.newbyteorder(order)).tobytes()
    entries = [(256, columns), (257, rows), (258, heights.dtype.itemsize * 8), (259, 1), (262, 1), (273, 0)]
    entries += [(277, 1), (278, rows), (279, len(data))]
    if sample_format is not None:
        entries.append((339, sample_format))
    start = 8 + 2 + 12 * len(entries) + 4
    packed = b''.join(
        struct.pack(f'{order}HHII', tag, 4, 1, start if tag == 273 else value)
        for tag, value in entries
        if tag not in (258, 339)
    )
    short = {tag: struct.pack(f'{order}HHIHH', tag, 3, 1, value, 0) for tag, value in entries if tag in (258, 339)}
    packed = packed[:24] + short[258] + packed[24:] + short.get(339, b'')
    mark = b'II*\0' if order == '<' else b'MM\0*'
    return mark + struct.pack(f'{order}IH', 8, len(entries)) + packed + bytes(4) + data


# Pillow does not open 32 bits without a sign in the order of bytes '>'.
@pytest.mark.parametrize(
    ('kind', 'order'), [(kind, order) for kind in NUMBERS for order in '<>' if kind + order != 'u4>']
)
@settings(max_examples=25)
@given(data=st.data())
def test_every_number_of_a_type_is_read(kind, order, data):
    heights = data.draw(hnp.arrays(np.dtype(kind), st.tuples(st.integers(2, 6), st.integers(2, 6))))
    stated = None if NUMBERS[kind] == 1 and data.draw(st.booleans()) else NUMBERS[kind]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'a.tif'
        path.write_bytes(tiff(heights, order, stated))
        found = read_file(path, pitch=(1.0, 1.0), unit='um').heights
    np.testing.assert_array_equal(found, heights.astype(np.float64))


@pytest.mark.parametrize(
    ('kind', 'order', 'sentence'),
    [
        ('u4', '>', 'has whole numbers without a sign of 32 bits in big-endian order, which Pillow does not read'),
        ('f8', '<', 'has floats of 64 bits in little-endian order, which Pillow does not read: save heights as'),
    ],
)
def test_a_type_that_is_not_read_is_not_taken_for_damage(tmp_path, kind, order, sentence):
    (tmp_path / 'a.tif').write_bytes(tiff(np.ones((2, 3), kind), order, NUMBERS.get(kind, 3)))
    with pytest.raises(ImportFileError, match=sentence):
        read_file(tmp_path / 'a.tif', pitch=(1.0, 1.0), unit='um')


@pytest.mark.parametrize('kind', NUMBERS)
def test_what_tifffile_writes_is_read(tmp_path, kind):
    tifffile = pytest.importorskip('tifffile', reason='tifffile, which writes TIFF files, is not installed')
    limits = np.finfo(kind) if kind == 'f4' else np.iinfo(kind)
    heights = np.array([[limits.min, limits.max, 0], [1, 2, limits.max // 2 + 1]], kind)
    tifffile.imwrite(tmp_path / 'a.tif', heights)
    found = read_file(tmp_path / 'a.tif', pitch=(1.0, 1.0), unit='um').heights
    np.testing.assert_array_equal(found, heights.astype(np.float64))
