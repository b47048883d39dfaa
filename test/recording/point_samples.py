# SPDX-License-Identifier: Apache-2.0
"""PLY and PCD files for the tests of this folder."""

import struct

import numpy as np

ROWS, COLUMNS = 3, 4
RECORD = np.dtype([('x', '<f4'), ('y', '<f4'), ('z', '<f4'), ('intensity', '<u2')])
POINTS = np.zeros(ROWS * COLUMNS, RECORD)
for _place, _name in enumerate(RECORD.names):
    POINTS[_name] = np.arange(POINTS.size) + 100 * _place
POINTS['z'][5] = np.nan


def lines(points):
    return '\n'.join(' '.join(str(value) for value in point) for point in points.tolist()).encode() + b'\n'


def lzf_literals(data):
    return b''.join(bytes([len(data[i : i + 32]) - 1]) + data[i : i + 32] for i in range(0, len(data), 32))


def pcd_header(kind, height=ROWS, width=COLUMNS):
    return (
        '# .PCD v0.7\nVERSION 0.7\nFIELDS x y z intensity\nSIZE 4 4 4 2\nTYPE F F F U\nCOUNT 1 1 1 1\n'
        f'WIDTH {width}\nHEIGHT {height}\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {ROWS * COLUMNS}\nDATA {kind}\n'
    ).encode()


def pcd(kind):
    if kind == 'ascii':
        return pcd_header(kind) + lines(POINTS)
    if kind == 'binary':
        return pcd_header(kind) + POINTS.tobytes()
    columns = b''.join(POINTS[name].tobytes() for name in RECORD.names)
    packed = lzf_literals(columns)
    return pcd_header(kind) + struct.pack('<II', len(packed), len(columns)) + packed


def ply_header(kind, *, info=True, count=ROWS * COLUMNS, extra=''):
    size = f'obj_info num_cols {COLUMNS}\nobj_info num_rows {ROWS}\n' if info else ''
    return (
        f'ply\nformat {kind} 1.0\n{size}element vertex {count}\nproperty float x\nproperty float32 y\n'
        f'property float z\nproperty ushort intensity\n{extra}end_header\n'
    ).encode()


def ply(kind):
    if kind == 'ascii':
        return ply_header(kind) + lines(POINTS)
    order = '<' if kind == 'binary_little_endian' else '>'
    return ply_header(kind) + POINTS.astype(RECORD.newbyteorder(order)).tobytes()
