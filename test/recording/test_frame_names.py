# SPDX-License-Identifier: Apache-2.0
"""The order of frames and their z from names."""

import os
import random
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.errors import ImportFileError
from socialcircle_ros.recording.frame_names import order_frames

FOLDER = Path('stack')


def ordered(names, z_from='auto', order='auto', seed=0):
    files = [FOLDER / (name if name.endswith(('.png', '.tif')) else f'{name}.png') for name in names]
    random.Random(seed).shuffle(files)
    found = order_frames(FOLDER, files, z_from, order)
    return [file.stem for file in found.files], found.z, found


@pytest.mark.parametrize(
    ('names', 'z'),
    [
        (['f9', 'f10', 'f11'], [0, 1, 2]),
        (['f0', 'f1', 'f2', 'f3', 'f5'], [0, 1, 2, 3, 5]),
        (['f001', 'f002', 'f003'], [0, 1, 2]),
        (['10', '20', '30', '50'], [0, 1, 2, 4]),
        (['frame-01', 'frame-02', 'frame-03'], [0, 1, 2]),
        (['a3b07c', 'a3b08c', 'a3b09c'], [0, 1, 2]),
        (['2024-05-03_f1', '2024-05-03_f2', '2024-05-03_f3'], [0, 1, 2]),
        (['t10.31_f1', 't10.44_f2', 't10.52_f3', 't11.90_f4'], [0, 1, 2, 3]),
        (['z-6', 'z-5', 'z-1', 'z0', 'z2'], [-6, -5, -1, 0, 2]),
        (['-2', '-1', '0', '1'], [-2, -1, 0, 1]),
        (['+1', '+2', '+3'], [0, 1, 2]),
        (['z+1', 'z+2', 'z-3'][::-1], [-3, 2, 1][::1]),
        (['z_-3', 'z_-2', 'z_-1'], [-3, -2, -1]),
        (['z−3', 'z0', 'z2'], [-3, 0, 2]),
        (['part_z0.0', 'part_z0.5', 'part_z1.0', 'part_z1.25'], [0, 0.5, 1, 1.25]),
        (['p0,5', 'p1,0', 'p1,5'], [0.5, 1, 1.5]),
        (['Z01_x5', 'Z02_x5', 'Z04_x5'], [1, 2, 4]),
        (['x1_z5', 'x2_z6', 'x3_z9'], [5, 6, 9]),
        (['height=3', 'height=4', 'height=5'], [3, 4, 5]),
    ],
)
def test_names_are_sorted_by_what_their_numbers_are(names, z):
    in_order = sorted(zip(z, names, strict=True))
    for seed in range(3):
        stems, found, _ = ordered(names, seed=seed)
        assert stems == [name for _, name in in_order]
        assert found == [place for place, _ in in_order]


@pytest.mark.parametrize(
    ('names', 'z'),
    [
        (['z0.5um', 'z1.0um', 'z1.5um'], [0.5e-6, 1e-6, 1.5e-6]),
        (['a_-10nm', 'a_0nm', 'a_10nm'], [-1e-8, 0, 1e-8]),
        (['500nm', '1um', '1.5µm', '0.002mm'], [5e-7, 1e-6, 1.5e-6, 2e-6]),
        (['z 0.5 μm a', 'z 1.5 μm a', 'z 2.5 μm a'], [5e-7, 1.5e-6, 2.5e-6]),
        (['z0.001m', 'z0.002m', 'z0.003m'], [1e-3, 2e-3, 3e-3]),
        (['z0.1cm', 'z0.2cm', 'z0.3cm'], [1e-3, 2e-3, 3e-3]),
    ],
)
def test_a_unit_in_the_names_makes_metres(names, z):
    stems, found, frames = ordered(names)
    assert stems == names
    assert found == pytest.approx(z, abs=1e-15)
    assert frames.in_metres


def test_a_letter_that_is_no_unit_is_none():
    _, z, frames = ordered(['f1m', 'f2m', 'f3m'])
    assert (z, frames.in_metres) == ([0, 1, 2], False)


@pytest.mark.parametrize(
    ('names', 'sentence'),
    [
        (['z-1', 'z-2', 'z-3'], r'a minus before every z, such as .*--z-from name .* or --z-from order'),
        (['f1', 'f01', 'f2', 'f3'], r'f0?1\.png and f0?1\.png for the same z'),
        (['f1.png', 'f1.tif', 'f2.png', 'f3.png'], r'f1\.(png|tif) and f1\.(png|tif) for the same z'),
        (['z500nm', 'z0.5um', 'z1um'], r'for the same z'),
        (['near', 'middle', 'far'], r'without a common pattern of numbers, such as .*--order'),
        (['a1', 'a2', 'b1', 'b2', 'a3', 'b3'], 'without a common pattern'),
        (['f1', 'f2', 'f7', 'f20', 'f21'], 'unevenly spaced numbers, .*--z-from order .* or --z-from name'),
        (['f1.9', 'f1.10', 'f1.11'], 'may be decimals or not: give --z-from name or --z-from order'),
        (['z1um', 'z2', 'z3'], 'without a common pattern|with and without a unit'),
        (['a1_b5', 'a2_b9', 'a9_b2'], '2 numbers that differ, .*--z-from order'),
        (['a1_b2', 'a2_b3', 'a3_b4'], '2 numbers that differ'),
        (['z1_height1', 'z2_height2', 'z3_height3'], '2 numbers that differ'),
    ],
)
def test_what_is_not_certain_is_refused_with_the_option_that_settles_it(names, sentence):
    with pytest.raises(ImportFileError, match=sentence):
        ordered(names)


@pytest.mark.parametrize(
    ('names', 'z_from', 'stems', 'z'),
    [
        (['z-1', 'z-2', 'z-3'], 'name', ['z-3', 'z-2', 'z-1'], [-3, -2, -1]),
        (['z-1', 'z-2', 'z-3'], 'order', ['z-1', 'z-2', 'z-3'], [0, 1, 2]),
        (['f1', 'f2', 'f7', 'f20'], 'name', ['f1', 'f2', 'f7', 'f20'], [1, 2, 7, 20]),
        (['f1', 'f2', 'f7', 'f20'], 'order', ['f1', 'f2', 'f7', 'f20'], [0, 1, 2, 3]),
        (['f1.9', 'f1.10', 'f1.11'], 'name', ['f1.10', 'f1.11', 'f1.9'], [1.1, 1.11, 1.9]),
        (['f1.9', 'f1.10', 'f1.11'], 'order', ['f1.9', 'f1.10', 'f1.11'], [0, 1, 2]),
        (['a1_b5', 'a2_b9', 'a9_b2'], 'order', ['a1_b5', 'a2_b9', 'a9_b2'], [0, 1, 2]),
    ],
)
def test_options_settle_where_z_comes_from(names, z_from, stems, z):
    assert ordered(names, z_from)[:2] == (stems, z)


def test_options_settle_the_order(tmp_path):
    names = ['f10', 'f9', 'near']
    assert ordered(names, order='name')[0] == ['f10', 'f9', 'near']
    assert ordered(['near', 'far'], order='natural')[0] == ['far', 'near']
    assert ordered(['far', 'near'], order='natural')[1] == [0, 1]
    for place, name in enumerate(names):
        (tmp_path / name).write_bytes(b'')
        os.utime(tmp_path / name, (1000 - place, 1000 - place))
    found = order_frames(tmp_path, [tmp_path / name for name in names], 'auto', 'time')
    assert [file.name for file in found.files] == ['near', 'f9', 'f10']
    os.utime(tmp_path / 'f9', (1000, 1000))
    with pytest.raises(ImportFileError, match='files of the same time'):
        order_frames(tmp_path, found.files, 'order', 'time')
    with pytest.raises(ImportFileError, match='leave --order out'):
        order_frames(tmp_path, found.files, 'name', 'time')


@pytest.mark.parametrize('stray', ['mask', 'all_in_focus', 'depth map 2', 'f1_mask'])
def test_a_name_that_does_not_fit_is_passed_over_and_told(stray):
    names = [f'f{number}' for number in range(8)]
    stems, z, frames = ordered([*names, stray])
    assert (stems, z) == (names, list(range(8)))
    assert f'{stray}.png is passed over, because its name does not fit the others' in frames.notes


def test_gaps_are_told():
    assert ordered(['f0', 'f1', 'f3', 'f4', 'f7'])[2].notes == [
        '1 frame missing between f1.png and f3.png; z leaves the step out',
        '2 frames missing between f4.png and f7.png; z leaves the steps out',
    ]
    assert ordered(['z0', 'z1', 'z2', 'z4'])[2].notes[1:] == [
        '1 frame missing between z2.png and z4.png; z leaves the step out'
    ]
    assert ordered(['z0', 'z1', 'z2', 'z4.4'])[2].notes[1:] == ['the frames are not evenly spaced']


@given(
    z=st.lists(st.integers(-500, 500), min_size=3, max_size=20, unique=True),
    decimals=st.integers(0, 3),
    unit=st.sampled_from(['', 'nm', 'um', 'µm', 'mm']),
    width=st.integers(1, 6),
    seed=st.integers(0, 9),
)
def test_z_that_is_written_into_names_is_read_back(z, decimals, unit, width, seed):
    scale = {'': 1, 'nm': 1e-9, 'um': 1e-6, 'µm': 1e-6, 'mm': 1e-3}[unit]
    names = {
        f'part7_z{"-" * (place < 0)}{abs(place) / 10**decimals:0{width}.{decimals}f}{unit}': place for place in z
    }
    if all(place < 0 for place in z):
        names['part7_z' + f'{1:0{width}.{decimals}f}{unit}'] = 10**decimals
    stems, found, _ = ordered(names, seed=seed)
    assert stems == sorted(names, key=names.get)
    assert found == pytest.approx([names[stem] / 10**decimals * scale for stem in stems])


@given(names=st.lists(st.text('az019.-_ um', min_size=1, max_size=8), min_size=1, max_size=8, unique=True))
def test_any_names_are_sorted_or_refused(names):
    try:
        _, z, _ = ordered(names)
    except ImportFileError as error:
        assert str(error).endswith('.')
        return
    assert z == sorted(set(z))
