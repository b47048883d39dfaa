# SPDX-License-Identifier: Apache-2.0
"""The candidates of the benchmark."""

from socialcircle_ros.circle.seed import elect_seed
from socialcircle_ros.kernels import bands
from socialcircle_ros.simulation import make_scene
from socialcircle_ros.studies.bench.candidates import all_candidates, numpy_vote
from socialcircle_ros.studies.bench.ratios import GOALS


def test_every_goal_names_candidates_and_threads_are_limited_during_a_run_only():
    with all_candidates() as candidates:
        names = {candidate.name for candidate in candidates}
        before = bands.limit
        candidates[0].run()
        assert bands.limit == before
    for goal in GOALS:
        for name in (goal.numerator, goal.denominator):
            assert name in names or name == '' or name.split()[0] in {'PCL', 'Open3D', 'OpenCV'}


def test_the_vote_in_numpy_elects_the_same_seed():
    xyz = make_scene('metal_groove', 60, 60).points

    assert divmod(numpy_vote(xyz.reshape(-1, 3).astype(float)), 60) == elect_seed(xyz, (0, 0, 60, 60))
