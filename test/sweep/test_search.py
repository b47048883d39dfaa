# SPDX-License-Identifier: Apache-2.0
"""The search for the best setting with Optuna."""

import json
import sys
from dataclasses import replace

import pytest
from sweep.sweep_examples import trial

from socialcircle_ros.errors import SettingError, SocialCircleError
from socialcircle_ros.sweep.search import Search, _rounded
from socialcircle_ros.sweep.search_space import Choice, Range
from socialcircle_ros.sweep.trials import best_of

SPACE = (Range('circle.radius_scale', 0.5, 3), Choice('circle.window', range(3, 32, 2)))


def search(count, done=(), search_space=SPACE):
    """Search where the score falls with the distance of radius_scale from 2; the trials in their order."""
    study, tried = Search(search_space, count, done), []
    for values in study:
        tried.append(replace(trial(0), values=values, score=-abs(values.get('circle.radius_scale', 0) - 2)))
        study.tell(tried[-1])
    return tried


class TestSearch:
    @pytest.fixture(autouse=True)
    def needs_optuna(self):
        pytest.importorskip('optuna')

    def test_it_comes_close_to_the_best_setting(self):
        tried = search(40)
        assert len(tried) == 40
        assert abs(best_of(tried).values['circle.radius_scale'] - 2) < 0.1

    def test_it_continues_from_earlier_trials(self):
        done = search(20)
        more = search(30, done)
        assert len(more) == 10
        assert not {json.dumps(each.values) for each in done} & {json.dumps(each.values) for each in more}

    def test_it_ends_when_every_setting_was_tried(self):
        tried = search(40, search_space=[Choice('circle.window', [3, 5, 7])])
        assert sorted(each.values['circle.window'] for each in tried) == [3, 5, 7]

    def test_earlier_trials_outside_the_search_space_are_ignored(self):
        outside = replace(trial(9.0), values={'circle.radius_scale': 9.0, 'circle.window': 3})
        assert len(search(5, [outside])) == 5

    def test_a_parameter_that_is_given_twice_is_refused(self):
        with pytest.raises(SettingError, match='circle.window is given twice'):
            search(5, search_space=[Choice('circle.window', [3]), Choice('circle.window', [5])])


def test_a_search_without_optuna_says_how_to_install_it(monkeypatch):
    monkeypatch.setitem(sys.modules, 'optuna', None)
    with pytest.raises(SocialCircleError, match='A sweep needs Optuna: pip install '):
        Search(SPACE, 5, ())


@pytest.mark.parametrize(('value', 'rounded'), [(1.23456, 1.235), (0.12344, 0.12344), (1.98765, 1.98765)])
def test_a_value_has_four_significant_digits_and_stays_in_its_range(value, rounded):
    assert _rounded(Range('circle.radius_scale', 0.12344, 1.98765), value) == rounded
