# SPDX-License-Identifier: Apache-2.0
"""`socialcircle sweep`."""

import csv
import html
import json
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from clusters import cluster_in_this_process

pytest.importorskip('matplotlib')
pytest.importorskip('optuna')

from examples import cloud

from socialcircle_ros.messages import point_cloud
from socialcircle_ros.recording import RecordingWriter, ros_topic
from socialcircle_ros.sweep.journal import TrialJournal

BAGS = Path(__file__).resolve().parents[2] / 'bags'
PAPER = ('-p', 'circle.mode:=paper')
GRID = ('sweep', BAGS / 'parts.mcap', '--param', 'circle.radius_scale=0.5:1.5:0.5', '--clouds', '3', *PAPER)


def page_of(folder):
    page = (folder / 'sweep.html').read_text()
    assert all(source.startswith('data:') for source in re.findall(r'src="([^"]*)"', page))
    return html.unescape(re.sub(r'<style>.*?</style>|<[^>]+>', ' ', page, flags=re.DOTALL))


def rows_of(folder):
    with (folder / 'sweep.csv').open() as file:
        return list(csv.DictReader(file))


@pytest.fixture
def without_truth(tmp_path):
    """A recording without a truth."""
    with RecordingWriter(tmp_path / 'night.mcap') as writer:
        writer.add_topic(ros_topic('/points', point_cloud.TYPE))
        for number in range(3):
            writer.write('/points', cloud(seed=number, stamp=number), number)
        writer.write('/points', cloud(1, 9), 9)
    return tmp_path / 'night.mcap'


def test_a_grid_is_scored_against_the_truth_and_its_candidates_can_be_loaded(run, tmp_path):
    done = run(*GRID)
    assert done.code == 0, done.err
    assert '3 trials on 3 clouds, scored against the truth.' in done.out
    assert 'Candidate 1, as given: circle.radius_scale 1.0: F1 1.0' in done.out
    assert 'No verdict. No setting scores higher than the parameters as given.' in done.out
    folder = tmp_path / 'out/sweep'
    rows = rows_of(folder)
    assert {row['circle.radius_scale'] for row in rows} == {'0.5', '1.0', '1.5'}
    scores = [float(row['F1']) for row in rows]
    assert scores == sorted(scores, reverse=True)
    assert float(rows[-1]['F1']) < 0.9
    text = page_of(folder)
    assert 'the harmonic mean of precision' in text
    assert 'No verdict.' in text
    assert not (folder / 'best.yaml').exists()
    filtered = run('filter', BAGS / 'padded.mcap', '-o', 'x.mcap', '--params-file', folder / 'candidates/2.yaml')
    assert filtered.code == 0, filtered.err


def test_a_setting_that_is_better_beyond_the_spread_is_written_and_forgotten_by_the_next_sweep(run, tmp_path):
    best = tmp_path / 'out/sweep/best.yaml'
    done = run(*GRID, '-p', 'circle.radius_scale:=0.5')
    assert done.code == 0, done.err
    assert 'Better than as given: circle.radius_scale ' in done.out
    assert 'is better beyond the spread' in page_of(best.parent)
    assert 'circle.radius_scale: 1.' in best.read_text()
    assert 'No verdict' in run(*GRID).out
    assert not best.exists()


def test_without_a_truth_there_is_no_verdict_and_the_page_shows_candidates(run, tmp_path, without_truth):
    done = run('sweep', without_truth, '--param', 'circle.radius_scale=0.01,100', '-p', 'circle.window:=5')
    assert done.code == 0, done.err
    assert '3 trials on 3 clouds, without a truth.' in done.out
    note = 'The setting as given has circle.mode adaptive; all others have circle.mode paper, which'
    assert f'{note} circle.radius_scale needs.' in done.out
    assert 'Candidate 1, as given: circle.mode adaptive: ' in done.out
    assert 'Look at the candidates: a person decides.' in done.out
    assert 'Refused: The cloud is not organized' in done.err
    text = page_of(tmp_path / 'out/sweep')
    assert 'by more than 5 robust standard deviations' in text
    assert 'and not which is right' in text
    assert 'Agreement of each trial, with the standard error' in text
    assert not (tmp_path / 'out/sweep/best.yaml').exists()
    first = (tmp_path / 'out/sweep/candidates/1.yaml').read_text()
    assert 'circle.mode: "adaptive"' in first
    assert 'circle.window: 5' in first


def test_a_best_setting_at_the_end_of_its_range_is_a_warning(run, tmp_path):
    done = run(
        'sweep',
        BAGS / 'padded.mcap',
        '--param',
        'circle.radius_scale=0.2:0.6:0.2',
        '-p',
        'circle.radius_scale:=0.4',
    )
    assert done.code == 0, done.err
    assert 'is at the end of its range, 0.6' in page_of(tmp_path / 'out/sweep')


def test_an_interrupted_sweep_continues_with_the_trials_that_are_left(run, tmp_path):
    assert run(*GRID).code == 0
    folder = tmp_path / 'out/sweep'
    complete = rows_of(folder)
    lines = (folder / 'trials.log').read_text().splitlines(keepends=True)
    (folder / 'trials.log').write_text(''.join(lines[:3]) + lines[3][:10])
    done = run(*GRID)
    assert done.code == 0, done.err
    assert f'2 trials of an earlier run taken from {Path("out/sweep/trials.log")}' in done.err
    timeless = [{name: value for name, value in row.items() if name != 'time [ms]'} for row in complete]
    assert [{name: row[name] for name in row if name != 'time [ms]'} for row in rows_of(folder)] == timeless
    assert (folder / 'trials.log').read_text().splitlines(keepends=True)[:3] == lines[:3]


def test_ctrl_c_keeps_the_finished_trials(tmp_path):
    command = [sys.executable, '-m', 'socialcircle_ros.commands.main', *map(str, GRID[:3])]
    command.append('circle.radius_scale=0.5:3:0.001')
    trials = tmp_path / 'out/sweep/trials.log'
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as process:
        for _ in range(10_000):
            if trials.exists() and trials.read_text().count('\n') > 3:
                break
            try:
                process.wait(0.02)
            except subprocess.TimeoutExpired:
                continue
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=300)
    assert process.returncode == 130, err
    assert 'the same command continues from there' in err
    assert 'Traceback' not in err
    finished = [json.loads(line) for line in trials.read_text().splitlines()]
    assert 3 <= len(finished) - 1 < 2501
    assert not trials.with_name('trials.log.lock').is_symlink()


def test_a_search_needs_no_step(run, tmp_path):
    search = (
        'sweep',
        BAGS / 'padded.mcap',
        '--param',
        'circle.radius_scale=0.5:3',
        '--param',
        'circle.window=3,5',
    )
    done = run(*search, '--search', '6')
    assert done.code == 0, done.err
    assert '6 trials on 2 clouds' in done.out
    more = run(*search, '--search', '8')
    assert '6 trials of an earlier run' in more.err
    assert len(rows_of(tmp_path / 'out/sweep')) == 8


def test_a_search_runs_on_a_cluster_as_well(run, tmp_path):
    pytest.importorskip('distributed')
    search = ('--param', 'circle.radius_scale=0.5:3', '--param', 'circle.window=3,5', '--search', '5')
    with cluster_in_this_process() as scheduler:
        done = run('sweep', BAGS / 'padded.mcap', *search, '--scheduler', scheduler)
    assert done.code == 0, done.err
    assert '5 trials on 2 clouds' in done.out
    assert len(rows_of(tmp_path / 'out/sweep')) == 5


def test_a_focus_parameter_makes_the_cloud_of_a_stack_anew(run, tmp_path):
    done = run(
        'sweep', BAGS / 'stack.mcap', '--params-file', BAGS / 'stack.yaml', '--param', 'focus.half_window=1,4'
    )  # fmt: skip
    assert done.code == 0, done.err
    assert '2 trials on 1 cloud, scored against the truth' in done.out
    one, other = rows_of(tmp_path / 'out/sweep')
    assert one['Sq after [µm]'] != other['Sq after [µm]']
    assert 'No verdict.' in done.out
    first = (tmp_path / 'out/sweep/candidates/1.yaml').read_text()
    assert 'stack.pitch_x: 1.0e-06' in first
    assert 'focus.half_window: ' in first


@pytest.mark.parametrize(
    ('arguments', 'sentence'),
    [
        (['nowhere.mcap', '--param', 'circle.window=3'], 'nowhere.mcap'),
        ([BAGS / 'parts.mcap', '--param', 'circle.window=4'], 'circle.window must be odd'),
        ([BAGS / 'parts.mcap', '--param', 'circle.radius_scale=1:2'], 'or search with --search 50'),
        ([BAGS / 'parts.mcap', '--param', 'circle.window=3', '-o', '/proc/x'], '/proc/x cannot be written'),
        ([BAGS / 'parts.mcap', '--param', 'circle.window=3', '-o', 'out/a.png'], 'a.png has the name of a file'),
        ([BAGS / 'parts.mcap', '--param', 'circle.window=3', '-p', 'circle.radius:=-1'], 'circle.radius'),
        ([BAGS / 'stack.mcap', '--param', 'circle.window=3'], 'stack.pitch_x is not set'),
        ([BAGS / 'parts.mcap', '--param', 'circle.window=3', '-o', 'other'], 'holds trials on other clouds'),
        (
            [BAGS / 'padded.mcap', '--param', 'circle.window=3', '--scheduler', 'none.json'],
            'No Dask scheduler answers',
        ),
    ],
)
def test_an_error_is_one_sentence(run, tmp_path, arguments, sentence):
    (tmp_path / 'other').mkdir()
    TrialJournal(tmp_path / 'other/trials.log', 'of something else')
    done = run('sweep', *arguments)
    assert done.code == 1, done.err
    assert sentence in done.err
    assert 'Traceback' not in done.err
    assert not (tmp_path / 'out').exists()
