# SPDX-License-Identifier: Apache-2.0
"""Small files of instruments, written by what SurfaceTopography's readers expect.

Each writer takes heights (rows, columns) in whole steps of 0.001 µm, NaN where not measured, and the pitch in µm.
So these files show that the reader's numbers arrive here with their unit, pitch and orientation, not what an
instrument writes.
"""

import io
import struct
import zipfile

import numpy as np

STEP = 1e-3  # µm, of the heights of formats with whole numbers


def sur(path, z, dx, dy):
    """Digital Surf, 32 bits; a point that is not measured is 2 below the least height."""
    steps = np.round(z / STEP)
    low, high = int(np.nanmin(steps)), int(np.nanmax(steps))
    raw = np.where(np.isfinite(z), steps, low - 2).astype('<i4')
    rows, columns = z.shape
    text = lambda words, size: words.encode('latin-1').ljust(size)  # noqa: E731
    header = b'DIGITAL SURF' + struct.pack('<4H', 0, 1, 1, 2) + text('part', 30) + text('instrument', 30)
    header += struct.pack('<5H', 0, 0, 0, 1, 0) + bytes(8) + struct.pack('<H', 32)
    header += struct.pack('<4iI', low, high, columns, rows, rows * columns) + struct.pack('<3f', dx, dy, STEP)
    header += b''.join(text(each, 16) for each in ('X', 'Y', 'Z', *['µm'] * 6))
    header += struct.pack('<3f', 1, 1, 1) + struct.pack('<3H', 0, 0, 0) + bytes(12)
    header += struct.pack('<7H', 1, 2, 3, 4, 5, 2020, 0) + bytes(4 + 10) + struct.pack('<2H', 0, 0) + bytes(128)
    header += struct.pack('<3f', 0, 0, 0)
    path.write_bytes(header.ljust(512, b'\0') + raw.tobytes())


def plux(path, z, dx, dy):
    """Sensofar: a zip archive with an index and float32 in µm."""
    rows, columns = z.shape
    index = (
        f'<xml><GENERAL><DATE>2020-05-04 03:02:01</DATE><IMAGE_SIZE_X>{columns}</IMAGE_SIZE_X><IMAGE_SIZE_Y>{rows}'
        f'</IMAGE_SIZE_Y><FOV_X>{dx}</FOV_X><FOV_Y>{dy}</FOV_Y></GENERAL><LAYER_0><FILENAME_Z>LAYER_0.raw'
        '</FILENAME_Z></LAYER_0><INFO><ITEM_0><NAME>Device</NAME><VALUE>S neox</VALUE></ITEM_0></INFO></xml>'
    )
    with zipfile.ZipFile(path, 'w') as archive:
        archive.writestr('index.xml', index)
        archive.writestr('LAYER_0.raw', z.astype('<f4').tobytes())


def nms(path, z, dx, dy):
    """NanoFocus: 16 bits between two heights; 65535 is not measured."""
    low = float(np.nanmin(z))
    high = low + 65534 * STEP
    raw = np.where(np.isfinite(z), np.round((z - low) / STEP), 65535).astype('<u2')
    header = bytearray(3468)
    struct.pack_into('<2d', header, 16, low, high)
    struct.pack_into('<2I2d', header, 1368, z.shape[1], z.shape[0], dx / 1e3, dy / 1e3)
    path.write_bytes(bytes(header) + raw.tobytes())


def os3d(path, z, dx, dy):
    """OmniSurf3D: float32 in µm; the least float32 is not measured."""
    text = lambda words: struct.pack('<I', len(words)) + words.encode()  # noqa: E731
    header = b'OmniSurf3D' + struct.pack('<2i', 1, 0) + text('part') + text('2020-05-04')
    header += struct.pack('<2i4d', z.shape[1], z.shape[0], dx, dy, 0, 0)
    raw = np.where(np.isfinite(z), z, np.finfo('f4').min).astype('<f4')
    path.write_bytes(header + raw.tobytes())


def datx(path, z, dx, dy):
    """Zygo Mx: HDF5 with converters from pixels to m; one number is not measured."""
    import h5py

    converter = np.dtype([('category', 'S16'), ('unit', 'S16'), ('parameters', 'f8', (4,))])
    with h5py.File(path, 'w') as file:
        rows = [
            (b'Root', b'Measurement', b'{1}'),
            (b'{1}', b'Surface', b'{2}'),
            (b'{2}', b'Path', b'/Data/Surface/{3}'),
        ]
        file['MetaData'] = np.array(rows, [('source', 'S32'), ('link', 'S32'), ('value', 'S64')])
        surface = file.create_dataset('Data/Surface/{3}', data=np.where(np.isfinite(z), z * 1e3, 1e300))
        surface.attrs['No Data'] = np.array([1e300])
        surface.attrs.create('Unit', ['NanoMeters'], dtype=h5py.string_dtype())
        for axis, category, unit, scale in (
            ('X', b'LateralCat', b'Pixels', dx * 1e-6),
            ('Y', b'LateralCat', b'Pixels', dy * 1e-6),
            ('Z', b'HeightCat', b'NanoMeters', 1.0),
        ):
            surface.attrs[f'{axis} Converter'] = np.array([(category, unit, (0, scale, 0, 0))], converter)


def vk4(path, z, dx, dy):
    """Keyence: a table of offsets, lengths in pm, heights of 32 bits; nothing marks a point as not measured."""
    path.write_bytes(_vk4(z, dx, dy))


def vk6(path, z, dx, dy):
    """Keyence: a VK4 file in a zip archive."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, 'w') as archive:
        archive.writestr('Vk4File', _vk4(z, dx, dy))
    path.write_bytes(b'VK6' + bytes(9) + content.getvalue())


def _vk4(z, dx, dy):
    names = 17
    header = np.zeros(82, '<u4')
    header[:8] = (4 * len(header), 2020, 5, 4, 3, 2, 1, 0)
    header[42:45] = (round(dx * 1e6), round(dy * 1e6), round(STEP * 1e6))
    offsets = np.zeros(names + 1, '<u4')
    start = 12 + offsets.nbytes
    offsets[0], offsets[6] = start, start + header.nbytes
    raw = np.round(z / STEP).astype('<u4')
    image = struct.pack('<7I', z.shape[1], z.shape[0], 32, 0, raw.nbytes, 0, 255) + bytes(768)
    return b'VK4_' + bytes(8) + offsets.tobytes() + header.tobytes() + image + raw.tobytes()
