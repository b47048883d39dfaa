# SPDX-License-Identifier: Apache-2.0
"""The attack in small, within the process; `make soak` runs it for as long as wanted."""

from random import Random

import pytest
from attack.generators import hostile_cloud
from attack.offline import attack_clouds, attack_recordings, attack_settings, attack_stacks
from attack.tally import Tally

SEEDS = (1, 2)


@pytest.mark.parametrize('seed', SEEDS)
def test_hostile_clouds_are_filtered_or_refused_and_change_no_later_result(seed):
    tally = attack_clouds(Random(seed), 200)
    assert tally.sound(), tally


@pytest.mark.parametrize('seed', SEEDS)
def test_hostile_frames_and_joint_states_leave_no_trace_in_the_next_stack(seed):
    tally = attack_stacks(Random(seed), 200)
    assert tally.sound(), tally


@pytest.mark.parametrize('seed', SEEDS)
def test_parameters_are_taken_or_refused_with_a_sentence(seed):
    tally = attack_settings(Random(seed), 200)
    assert tally.sound(), tally


@pytest.mark.parametrize('seed', SEEDS)
def test_what_a_damaged_recording_still_holds_is_filtered_as_before(seed, tmp_path):
    tally = attack_recordings(Random(seed), 80, tmp_path)
    assert tally.sound(), tally


def test_the_same_seed_gives_the_same_attack():
    one, other = ([hostile_cloud(random) for _ in range(20)] for random in (Random(3), Random(3)))
    assert one == other


def test_a_tally_is_sound_only_if_all_survived_and_nothing_is_wrong_or_lost():
    assert Tally('a', tried=2, survived=2).sound()
    for changes in ({'survived': 1}, {'wrong': 1}, {'lost': 1}):
        assert not Tally('a', **({'tried': 2, 'survived': 2} | changes)).sound()
