# SPDX-License-Identifier: Apache-2.0
"""The stage jitters, and its reported positions can be interpolated at the stamps of the frames."""

import numpy as np
import pytest

from socialcircle_ros.errors import SettingError
from socialcircle_ros.simulation.stage import Stage, travel


def test_interpolated_joint_states_are_the_positions_of_the_frames():
    moves = travel(Stage(encoder_noise=0.0), -5.0, 1.5, 60, 3)
    at_stamp = np.interp(moves.stamps, moves.joint_stamps, moves.joint_z)
    np.testing.assert_allclose(at_stamp, moves.z_true, atol=0.002)
    assert moves.joint_stamps[0] < moves.stamps[0]
    assert moves.joint_stamps[-1] > moves.stamps[-1]


def test_jitter_and_encoder_noise_have_their_standard_deviations():
    runs = [travel(Stage(jitter=0.2, encoder_noise=0.03), 0.0, 1.0, 100, seed) for seed in range(20)]
    jitter = np.concatenate([run.z_true - run.z_nominal for run in runs])
    assert jitter.std() == pytest.approx(0.2, rel=0.15)
    assert np.concatenate([run.z - run.z_true for run in runs]).std() == pytest.approx(0.03, rel=0.1)


def test_stage_without_errors_is_at_its_nominal_positions():
    moves = travel(Stage(jitter=0.0, encoder_noise=0.0), 2.0, 0.5, 10, 0)
    np.testing.assert_allclose(moves.z, 2.0 + 0.5 * np.arange(10))
    np.testing.assert_array_equal(moves.stamps, np.arange(10) * 20_000_000)


@pytest.mark.parametrize('change', [{'frame_rate': 0.0}, {'jitter': -1.0}])
def test_stage_with_values_out_of_range_is_refused(change):
    with pytest.raises(SettingError, match='stage'):
        Stage(**change)
