# SPDX-License-Identifier: Apache-2.0
"""The two ISO formats, read value by value as the standards describe them."""

import struct
import zipfile
from xml.etree import ElementTree as ET


def read_x3p(path):
    """Heights (rows of lists), dx and dy, in m; only what a file of floats needs."""
    with zipfile.ZipFile(path) as archive:
        root = ET.fromstring(archive.read('main.xml'))  # noqa: S314 - a file that the test wrote
        increments = [float(each.text) for each in root.iter('Increment')]
        columns, rows = int(next(root.iter('SizeX')).text), int(next(root.iter('SizeY')).text)
        kind = list(root.iter('DataType'))[2].text
        data = archive.read(next(root.iter('PointDataLink')).text)
    code, size = {'F': ('<f', 4), 'D': ('<d', 8)}[kind]
    heights = [
        [struct.unpack_from(code, data, (row * columns + column) * size)[0] for column in range(columns)]
        for row in range(rows)
    ]
    return heights, increments[0], increments[1]


def read_sdf(path):
    """Heights (rows of lists), dx and dy, in m; only text with Zscale 1."""
    lines = path.read_text().splitlines()
    assert lines[0] == 'aISO-1.0'
    header, end = {}, lines.index('*')
    for line in lines[1:end]:
        name, value = line.split('=')
        header[name.strip()] = value.strip()
    words = []
    for line in lines[end + 1 :]:
        if line == '*':
            break
        words += line.split()
    columns, rows = int(header['NumPoints']), int(header['NumProfiles'])
    values = [float('nan') if word == 'BAD' else float(word) for word in words]
    assert len(values) == rows * columns
    heights = [values[row * columns : (row + 1) * columns] for row in range(rows)]
    return heights, float(header['Xscale']), float(header['Yscale'])
