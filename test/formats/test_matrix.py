# SPDX-License-Identifier: Apache-2.0
"""Text with a matrix of heights: labels and words are not taken for heights."""

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from socialcircle_ros.errors import ImportFileError
from socialcircle_ros.formats import read_file
from socialcircle_ros.formats.matrix import check_labels, check_rows

HEIGHTS = np.random.default_rng(0).normal(size=(9, 8)).round(3)
SEPARATORS = {'.csv': ',', '.txt': ' '}


def read(path):
    return read_file(path, pitch=(1.0, 1.0), unit='um').heights


def labelled(heights, columns=None, rows=None):
    """The heights with labels above and before them."""
    if columns is not None:
        heights = np.vstack([columns, heights])
    if rows is not None:
        heights = np.column_stack([[np.nan, *rows] if columns is not None else rows, heights])
    return heights


@pytest.mark.parametrize('suffix', SEPARATORS)
@pytest.mark.parametrize(
    ('columns', 'rows', 'where'),
    [
        (np.arange(8), None, 'row'),
        (None, np.arange(9), 'column'),
        (np.arange(8), np.arange(9), 'row and the first column'),
        (np.arange(8) * 0.5 + 3, np.arange(9) * -0.25, 'row and the first column'),
    ],
)
def test_labels_are_no_heights(tmp_path, suffix, columns, rows, where):
    np.savetxt(tmp_path / f'a{suffix}', labelled(HEIGHTS, columns, rows), '%.9g', SEPARATORS[suffix])
    with pytest.raises(ImportFileError, match=rf'seems to have labels in its first {where}, .* Save it without'):
        read(tmp_path / f'a{suffix}')


@pytest.mark.parametrize(
    ('options', 'labels'),
    [({}, True), ({'index': False}, True), ({'header': False}, True), ({'header': False, 'index': False}, False)],
)
def test_what_pandas_writes_is_refused_or_read(tmp_path, options, labels):
    pandas = pytest.importorskip('pandas', reason='pandas, which writes labels, is not installed')
    pandas.DataFrame(HEIGHTS).to_csv(tmp_path / 'a.csv', **options)
    if labels:
        with pytest.raises(ImportFileError, match='seems to have labels'):
            read(tmp_path / 'a.csv')
    else:
        np.testing.assert_array_equal(read(tmp_path / 'a.csv'), HEIGHTS)


ROW, COLUMN = np.mgrid[:7, :9].astype(float)


@pytest.mark.parametrize(
    'heights',
    [
        COLUMN, ROW, COLUMN + ROW, 3 - 0.5 * COLUMN + 0.25 * ROW, (COLUMN + 1) * (ROW + 1), COLUMN + 9 * ROW,
        np.where(ROW + COLUMN == 8, np.nan, COLUMN + ROW), np.zeros((7, 9)), HEIGHTS, COLUMN[:1], ROW[:, :1],
    ],
)  # fmt: skip
def test_planes_and_measured_heights_have_no_labels(heights):
    check_labels(Path('a.csv'), heights)


Y, X = np.mgrid[:60, :80].astype(float)
BUMP = np.maximum(0, 15**2 - (Y - 30) ** 2 - (X - 40) ** 2) / 100


@pytest.mark.parametrize(
    'heights',
    [
        0.25 * X + 0.5 * Y + BUMP, 0.1 * X + 0.2 * Y + BUMP, np.hypot(X, Y), X + np.hypot(X, Y) / 9, X + X**2 * Y,
        X + X**2 * np.sqrt(Y), X + X * Y**2, np.floor(X + BUMP), X + BUMP.round(), np.floor(X + Y / 3 + BUMP),
        [[0, 1, 2, 3], [4, 4, 6, 6], [1, 5, 2, 2], [9, 9, 9, 8]],
    ],
)  # fmt: skip
@pytest.mark.parametrize('digits', ['%.17g', '%.6g'])
def test_continuous_heights_with_even_edges_have_no_labels(tmp_path, heights, digits):
    np.savetxt(tmp_path / 'a.csv', heights, digits, ',')
    assert read(tmp_path / 'a.csv').shape == np.shape(heights)


ROUGH = np.random.default_rng(1).normal(size=(60, 80))


@pytest.mark.parametrize(
    'heights',
    [
        BUMP, 0.25 * X + BUMP, np.hypot(X, Y) / 9, np.sin(X / 9 + Y / 7), ROUGH, 0.01 * ROUGH, 20 * ROUGH,
        BUMP.round(), 0.3 * X + 0.1 * ROUGH, np.where(ROUGH > 0.5, np.nan, BUMP + ROUGH),
        np.where(Y < 9, np.nan, BUMP + ROUGH),
    ],
)  # fmt: skip
@pytest.mark.parametrize('unit', [1, 0.001, 0.00137])
def test_labels_beside_heights_of_any_form_are_found(heights, unit):
    with pytest.raises(ImportFileError, match=r'row and the first column, .* or as \.npy if they are heights'):
        check_labels(Path('a.csv'), labelled(heights, unit * X[0], unit * Y[:, 0]))


TURNED = {'row': 'column', 'column': 'row'}


def told_as_labels(heights):
    """Which of the first row and the first column are refused as labels."""
    try:
        check_labels(Path('a.csv'), heights)
    except ImportFileError as refusal:
        return set(re.search('labels in its first (.*), which', str(refusal))[1].split(' and the first '))
    return set()


@given(
    hnp.arrays(np.float64, st.tuples(st.integers(1, 9), st.integers(1, 9)), elements=st.floats()),
    st.sets(st.sampled_from(['row', 'column'])),
    st.sampled_from([1.0, 0.25]),
)
def test_only_what_is_evenly_spaced_is_told_as_labels_in_whichever_direction_it_lies(heights, labels, step):
    if 'row' in labels:
        heights[0] = step * np.arange(heights.shape[1])
    if 'column' in labels:
        heights[:, 0] = step * np.arange(heights.shape[0])
    told = told_as_labels(heights)
    for name, line in (('row', heights[0, 1:]), ('column', heights[1:, 0])):
        if name in told:
            steps = np.diff(line)
            np.testing.assert_allclose(steps, steps[0], rtol=1e-5)
    assert told_as_labels(heights.T) == {TURNED[name] for name in told}


def test_parts_of_real_measurements_have_no_labels(real_measurements):
    rng = np.random.default_rng(0)
    for path in sorted(real_measurements.glob('*.npz')):
        with np.load(path) as file:
            heights = file['z'] if 'z' in file and file['z'].ndim == 2 else HEIGHTS
        for _ in range(200):
            top, left = (rng.integers(0, size - 8) if size > 8 else 0 for size in heights.shape)
            part = heights[top : top + rng.integers(8, 40), left : left + rng.integers(8, 40)]
            check_labels(path, part)
            check_labels(path, part.round(1))  # as a file with few digits has it


@pytest.mark.parametrize('suffix', SEPARATORS)
def test_a_word_among_the_heights_is_told(tmp_path, suffix):
    lines = [SEPARATORS[suffix].join(map(str, row)) for row in HEIGHTS.tolist()]
    lines[4] = lines[4].replace(lines[4].split(SEPARATORS[suffix])[2], '---')
    (tmp_path / f'a{suffix}').write_text('\n'.join(lines))
    if suffix == '.txt':
        pytest.importorskip('SurfaceTopography', reason='SurfaceTopography, which reads words, is not installed')
    told = 'among the heights of line 5' if suffix == '.txt' else 'is no matrix of numbers'
    with pytest.raises(ImportFileError, match=told):
        read(tmp_path / f'a{suffix}')


ROWS = '\n'.join(' '.join(map(str, row)) for row in HEIGHTS[:, :3].tolist())


@pytest.mark.parametrize(
    'text',
    [
        f'3 5 1\nLength 1.0 um\n{ROWS}', f'Width 3 um\n{ROWS}', f'Size 3 9\n{ROWS}', f'{ROWS}\nRMS = 3\n',
        f'{ROWS}\nSq 0.5 0.7\n', f'{ROWS}\n\n# 1 x 3\n', ROWS.replace('0.126', 'BAD'), '', 'no numbers at all',
    ],
)  # fmt: skip
def test_entries_before_and_behind_a_matrix_are_no_rows(tmp_path, text):
    (tmp_path / 'a.txt').write_text(text)
    check_rows(tmp_path / 'a.txt')


@pytest.mark.parametrize('row', ['1 --- 3', '--- --- 3', 'NA 2 3', 'NA NA 3', '1 1D+3 2D+3', '1,5 2,5 3', '1 - *'])
def test_a_row_with_words_is_told(tmp_path, row):
    (tmp_path / 'a.txt').write_text(f'3 5 1\nLength 1.0 um\n{ROWS}\n{row}\n{ROWS}\n')
    with pytest.raises(ImportFileError, match='among the heights of line 12: write nan'):
        check_rows(tmp_path / 'a.txt')


@pytest.mark.parametrize('place', [0, 9])
def test_a_first_or_last_row_with_a_word_is_told(tmp_path, place):
    lines = ROWS.splitlines()
    lines.insert(place, '1 --- 3')
    (tmp_path / 'a.txt').write_text('\n'.join(lines))
    with pytest.raises(ImportFileError, match=f'line {place + 1}:'):
        check_rows(tmp_path / 'a.txt')


def test_words_before_and_between_matrices_are_no_heights(tmp_path):
    body = '\n'.join(' '.join(map(str, row)) for row in HEIGHTS.tolist()).replace('0.126', 'BAD', 1)
    text = f'# Channel: Main\n# Width: 8 µm\n# Height: 9 µm\n# Value units: µm\n{body}\n# 1 2 3 4 5 6 end\n'
    (tmp_path / 'a.txt').write_text(text, encoding='utf-8')
    pytest.importorskip('SurfaceTopography', reason='SurfaceTopography, which reads text, is not installed')
    surface = read_file(tmp_path / 'a.txt')
    np.testing.assert_array_equal(surface.heights, np.where(HEIGHTS == 0.126, np.nan, HEIGHTS))
