# SPDX-License-Identifier: Apache-2.0
"""How long the steps of an experiment take, before they run."""

from socialcircle_ros.studies.comparison.study import Plan, Study, quick_plan
from socialcircle_ros.studies.experiments import FIGURES, steps_of
from socialcircle_ros.studies.workload import seconds_per_work


def work(name, plan):
    return sum(step.work for step in steps_of(name, Study(plan, print)))


def test_every_experiment_has_more_work_on_larger_clouds_and_on_more_seeds():
    for name in ('table1', *FIGURES, 'all', 'adaptive'):
        assert 0 < work(name, quick_plan((1,))) < work(name, Plan((1,)))
    for name in ('table1', 'figure10', 'adaptive'):
        assert work(name, Plan((1,))) < work(name, Plan((1, 2, 3)))


def test_a_search_that_several_steps_need_counts_once():
    plan = Plan((1, 2))
    assert work('all', plan) < sum(work(name, plan) for name in ('table1', *FIGURES))


def test_no_two_steps_of_an_experiment_share_a_file():
    for name in ('all', 'adaptive'):
        keys = [step.key for step in steps_of(name, Study(Plan((1,)), print))]
        assert len(set(keys)) == len(keys)


def test_the_speed_of_this_machine_is_measured():
    assert seconds_per_work() > 0
