# SPDX-License-Identifier: Apache-2.0
"""`socialcircle teach`."""

import numpy as np
import pytest

pytest.importorskip('matplotlib')


@pytest.fixture
def good(tmp_path):
    """A file of a good part: noise with round pits of many depths."""
    generator = np.random.default_rng(1)
    heights = generator.normal(size=(200, 260))
    y, x = np.mgrid[:200, :260]
    for row, column, depth in generator.uniform((0, 0, 9), (200, 260, 24), (50, 3)):
        heights -= depth * (np.hypot(y - row, x - column) < 2.6)
    np.savez(tmp_path / 'good.npz', z=heights.astype(np.float32), dx=1.0, dy=2.0)
    return 'good.npz'


def test_a_lesson_is_written_with_a_page_and_used(run, tmp_path, good):
    done = run('teach', good, '-o', 'part.teach', timeout=300)
    assert done.code == 0, done.err
    assert 'F1 of the outliers put in' in done.out
    assert 'Next: open part.html, then set circle.lesson to part.teach' in done.out
    assert '<img' in (tmp_path / 'part.html').read_text()
    assert 'is no' not in run('teach', 'nowhere.npz', '-o', 'part.teach').err  # an earlier one may be replaced
    removed = []
    for lesson in ((), ('-p', 'circle.lesson:=part.teach')):
        filtered = run(
            'filter', good, '-o', 'clean.mcap', '--overwrite', '-p', 'circle.mode:=adaptive', *lesson, timeout=300
        )
        assert filtered.code == 0, filtered.err
        removed.append(int(filtered.out.split('cloud filtered, ')[1].split()[0]))
    assert removed[0] > 500
    assert removed[1] < 30


def test_a_lesson_that_does_not_help_is_not_written(run, tmp_path):
    np.savez(tmp_path / 'good.npz', z=np.random.default_rng(1).normal(size=(110, 120)), dx=1.0, dy=1.0)
    done = run('teach', 'good.npz', '-o', 'part.teach', '-p', 'circle.judge:=rules', timeout=300)
    assert done.code == 1
    assert 'No lesson was written; part.html shows what was found.' in done.err
    assert not (tmp_path / 'part.teach').exists()


@pytest.mark.parametrize(
    ('words', 'sentence'),
    [
        (['good.npz', '-o', 'good.npz'], 'good.npz would be written into good.npz, which is read'),
        (['bag', '-o', 'bag/part.teach'], 'would be written into bag, which is read'),
        (['good.npz', '-o', 'notes.teach'], 'notes.teach is no lesson, and is not replaced'),
        (['good.npz', '-o', 'mine.teach'], 'mine.html is no page about a lesson, and is not replaced'),
    ],
)
def test_nothing_but_an_earlier_lesson_is_replaced(run, tmp_path, words, sentence):
    np.savez(tmp_path / 'good.npz', z=np.zeros((110, 120)), dx=1.0, dy=1.0)
    (tmp_path / 'bag').mkdir()
    (tmp_path / 'notes.teach').write_text('Remember the milk.')
    (tmp_path / 'mine.html').write_text('<p>Remember the milk.</p>')
    before = {path: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()}
    done = run('teach', *words)
    assert done.code == 1
    assert sentence in done.err
    assert {path: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()} == before


def test_bad_arguments_are_told(run):
    assert 'choose a name such as part.teach' in run('teach', 'good.npz', '-o', 'part.html').err
    assert 'missing.mcap' in run('teach', 'missing.mcap').err
    assert 'cannot be written' in run('teach', 'missing.mcap', '-o', '/proc/x/part.teach').err  # found first
    assert 'does not exist' in run('teach', 'missing.mcap', '-o', 'new/folder/part.teach').err
    refused = run('filter', 'a.mcap', '-o', 'b.mcap', '-p', 'circle.lesson:=none.teach')
    assert 'circle.lesson: none.teach cannot be used (No such file or directory)' in refused.err
