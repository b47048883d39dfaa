"""`socialcircle bench`."""

import json


def test_it_prints_and_writes_figures_for_each_size(run, tmp_path):
    done = run('bench', '--repeats', '1', '--json', 'bench.json')
    assert done.code == 0, done.err
    figures = json.loads((tmp_path / 'bench.json').read_text())['ms']
    assert [(figure['rows'], figure['columns']) for figure in figures] == [
        (240, 320), (480, 640), (960, 1280), (1920, 2560),
    ]  # fmt: skip
    assert '1280×960' in done.out
    assert all(figure['radius_and_expansion'] > 0 for figure in figures)


def test_figures_that_cannot_be_written_are_told(run):
    done = run('bench', '--repeats', '1', '--json', 'no/folder/bench.json')
    assert done.code == 1
    assert 'no/folder/bench.json cannot be written' in done.err


def test_repeats_must_be_at_least_one(run):
    assert 'must be at least 1' in run('bench', '--repeats', '0').err
