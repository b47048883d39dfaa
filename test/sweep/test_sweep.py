# SPDX-License-Identifier: Apache-2.0
"""`run_sweep`, called as from a notebook."""

import json
import signal
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import pytest
import yaml
from clusters import cluster_of_processes
from settings.test_lessons import PLAIN
from sweep.sweep_examples import BASE

import socialcircle_ros
from socialcircle_ros.circle import remove_outliers
from socialcircle_ros.errors import SettingError, SocialCircleError
from socialcircle_ros.metrics.scores import score
from socialcircle_ros.settings import CircleSettings
from socialcircle_ros.sweep.search_space import Choice, Range
from socialcircle_ros.sweep.work import SweptClouds, TrialTask, do_trial

pytest.importorskip('matplotlib')
pytest.importorskip('optuna')

BAGS = Path(__file__).resolve().parents[2] / 'bags'
SPACE = [Choice('circle.radius_scale', [0.5, 1.5])]
PAPER = {'circle.mode': 'paper'}


def test_a_notebook_gets_the_trials_and_the_files(tmp_path):
    result = socialcircle_ros.run_sweep(
        BAGS / 'padded.mcap',
        SPACE,
        tmp_path / 'new/sweep',
        parameters=PAPER | {'circle.window': 5},
        made_by='my notebook',
    )
    assert sorted(trial.values['circle.radius_scale'] for trial in result.trials) == [0.5, 1.0, 1.5]
    assert result.given.values == {'circle.radius_scale': 1.0}
    assert result.best.score == max(trial.score for trial in result.trials)
    assert result.has_truth
    assert [cloud.name for cloud in result.clouds] == ['/points 0', '/points 1']
    assert (result.resumed, result.refused, result.damage) == (0, {}, None)
    candidates = result.decision.candidates
    for number, trial in enumerate(candidates, 1):
        file = tmp_path / f'new/sweep/candidates/{number}.yaml'
        written = yaml.safe_load(file.read_text())['/**']['ros__parameters']
        assert written == {'circle.mode': 'paper', 'circle.window': 5, **trial.values}
    assert result.decision.winner is None  # two clouds show no spread
    assert 'Made by: my notebook' in (tmp_path / 'new/sweep/sweep.html').read_text()
    assert {path.name for path in (tmp_path / 'new/sweep').iterdir()} == {
        'sweep.html', 'sweep.csv', 'candidates', 'trials.log',
    }  # fmt: skip


@pytest.mark.parametrize(
    ('recording', 'caption'),
    [
        ('metal_groove.mcap', 'F1 of each trial.'),
        ('padded.mcap', 'F1 of each trial, with the standard error between the clouds.'),
    ],
)
def test_one_cloud_has_no_standard_error(tmp_path, recording, caption):
    socialcircle_ros.run_sweep(BAGS / recording, SPACE, tmp_path)
    assert f'<figcaption>{caption}</figcaption>' in (tmp_path / 'sweep.html').read_text()


def test_the_page_tells_where_the_recording_is_damaged(tmp_path):
    content = (BAGS / 'parts.mcap').read_bytes()
    (tmp_path / 'cut.mcap').write_bytes(content[: len(content) * 2 // 3])
    result = socialcircle_ros.run_sweep(tmp_path / 'cut.mcap', SPACE, tmp_path / 'out', max_clouds=2)
    assert 'cut.mcap is damaged' in result.damage
    assert 'cut.mcap is damaged' in (tmp_path / 'out/sweep.html').read_text()


@pytest.mark.parametrize('varied', [False, True])
def test_trials_with_a_lesson_that_was_taught_again_are_not_taken_over(tmp_path, varied):
    lesson = tmp_path / 'lid.json'
    lesson.write_text(PLAIN.to_text())
    space = [Choice('circle.lesson', ['', str(lesson)])] if varied else [Choice('circle.window', [3, 5])]
    given = {} if varied else {'circle.lesson': str(lesson)}

    def sweep():
        return socialcircle_ros.run_sweep(BAGS / 'padded.mcap', space, tmp_path / 'out', parameters=given)

    assert [sweep().resumed for _ in range(2)][1] > 0
    lesson.write_text(replace(PLAIN, threshold=0.6).to_text())
    with pytest.raises(SocialCircleError, match='another lesson; choose another output'):
        sweep()


def test_the_setting_as_given_is_in_its_own_mode_where_a_parameter_needs_another(tmp_path):
    result = socialcircle_ros.run_sweep(BAGS / 'padded.mcap', SPACE, tmp_path, parameters={'circle.window': 5})
    assert result.given.values == {'circle.mode': 'adaptive'}
    assert [trial.values for trial in result.trials[1:]] == [
        {**PAPER, 'circle.radius_scale': each} for each in (0.5, 1.5)
    ]
    given = remove_outliers(result.clouds[0].xyz, CircleSettings()).outliers
    assert result.given.cloud_scores[0] == score(given, result.clouds[0].outlier, result.clouds[0].counted).f1
    note = result.mode_note
    assert note.startswith('The setting as given has circle.mode adaptive; all others have circle.mode paper,')
    page = (tmp_path / 'sweep.html').read_text()
    assert note in page
    assert 'circle.mode adaptive (as given)' in page
    written = [(tmp_path / f'candidates/{number}.yaml').read_text() for number in (1, 2)]
    assert [yaml.safe_load(each)['/**']['ros__parameters']['circle.mode'] for each in written] == [
        'adaptive',
        'paper',
    ]
    same = socialcircle_ros.run_sweep(BAGS / 'padded.mcap', SPACE, tmp_path / 'paper', parameters=PAPER)
    assert same.mode_note == ''


def test_progress_counts_the_trials_and_an_earlier_run_is_continued(tmp_path):
    seen = []

    def progress(done, total):
        seen.append((done, total))

    socialcircle_ros.run_sweep(BAGS / 'padded.mcap', SPACE, tmp_path, progress=progress)
    assert seen == [(0, 3), (1, 3), (2, 3), (3, 3)]
    seen.clear()
    more = [Choice('circle.radius_scale', [0.5, 1.5, 2.0])]
    result = socialcircle_ros.run_sweep(str(BAGS / 'padded.mcap'), more, str(tmp_path), progress=progress)
    assert seen == [(3, 4), (4, 4)]
    assert (result.resumed, len(result.trials)) == (3, 4)
    seen.clear()
    socialcircle_ros.run_sweep(BAGS / 'padded.mcap', SPACE, tmp_path, progress=progress, restart=True)
    assert seen[0] == (0, 3)


def test_a_search_tries_the_given_number_of_settings(tmp_path):
    space = [Range('circle.radius_scale', 0.5, 3)]
    result = socialcircle_ros.run_sweep(BAGS / 'padded.mcap', space, tmp_path, search=5, max_clouds=1)
    assert len(result.trials) == 5
    assert result.given.values == {'circle.mode': 'adaptive'}
    assert len(result.clouds) == 1


@pytest.mark.parametrize(
    ('space', 'parameters', 'sentence'),
    [
        ([], {}, 'at least one parameter'),
        ([*SPACE, *SPACE], {}, 'circle.radius_scale is given twice'),
        ([Range('circle.radius_scale', 1, 2)], {}, 'has no step'),
        (SPACE, {'circle.window': 4}, 'circle.window must be odd'),
    ],
)
def test_a_bad_setting_is_refused_before_any_work(tmp_path, space, parameters, sentence):
    with pytest.raises(SettingError) as caught:
        socialcircle_ros.run_sweep('nowhere.mcap', space, tmp_path / 'out', parameters=parameters)
    assert sentence in str(caught.value)
    assert not (tmp_path / 'out').exists()


class TestCluster:
    """The same sweep on a scheduler with two workers."""

    SPACE: ClassVar = [Choice('circle.radius_scale', [0.5 + 0.1 * number for number in range(14)])]

    def test_ctrl_c_and_a_killed_worker_lose_nothing_and_the_scores_are_those_of_threads(self, tmp_path):
        pytest.importorskip('distributed')

        def swept(output, **options):
            return socialcircle_ros.run_sweep(BAGS / 'padded.mcap', self.SPACE, tmp_path / output, **options)

        def ctrl_c(done, _):
            if done == 3:
                raise KeyboardInterrupt

        with cluster_of_processes(tmp_path) as (file, workers):

            def kill_one(done, _):
                if done == 6:
                    workers[0].kill()

            with pytest.raises(KeyboardInterrupt):
                swept('out', scheduler=str(file), progress=ctrl_c)
            dashboards = []
            result = swept('out', scheduler=str(file), progress=kill_one, started=dashboards.append)
            assert workers[0].wait(300) == -signal.SIGKILL
        assert result.resumed == 3
        assert len(dashboards) == 1
        alone = swept('alone')
        assert timeless(result) == timeless(alone)
        assert len(result.trials) == 15


def timeless(result):
    return [replace(trial, milliseconds=None) for trial in result.trials]


def test_a_worker_that_sees_another_recording_under_the_name_is_told():
    base = dict(BASE)
    swept = SweptClouds(str(BAGS / 'padded.mcap'), json.dumps(base), ('circle.radius_scale',), (), 2, 'of others')
    with pytest.raises(SocialCircleError, match=r'padded.mcap is another recording on .*: the workers must see'):
        do_trial(TrialTask(swept, {'circle.radius_scale': 1.0}))
