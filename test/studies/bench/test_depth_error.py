# SPDX-License-Identifier: Apache-2.0
"""Error of the depth from simulated stacks, on seeds that nothing was fitted on."""

import pytest

from socialcircle_ros.studies.bench.depth_error import depth_errors, quality_shares

SEEDS = (34, 35)


@pytest.fixture(scope='module')
def flat():
    return [row for row in depth_errors(SEEDS, ['flat']) if row.fit == 'gauss']


@pytest.mark.long
def test_the_error_is_within_its_bounds(flat):
    """0.04 steps without noise, 0.08 at 6000 electrons and 8 bits, 0.10 at a quarter of the depth of field."""
    assert [row.scenario.noisy for row in flat] == [False, True, True]
    assert all(row.rms <= bound for row, bound in zip(flat, (0.04, 0.08, 0.10), strict=True))
    assert all(row.good > 0.99 for row in flat)


def test_the_depth_is_not_biased(flat):
    assert all(abs(row.bias) <= 0.01 for row in flat)


def test_the_default_fit_is_better_than_three_frames_where_the_curve_is_wide():
    rows = depth_errors(SEEDS[:1], ['ball'])
    fine = {row.fit: row.rms for row in rows if row.scenario.share_of_depth_of_field < 1}
    assert fine['gauss'] < 0.8 * fine['gauss3']


def test_higher_quality_predicts_more_good_pixels():
    """On specimens with glints and dark walls."""
    shares = quality_shares(SEEDS)
    good = [share for _, share in shares.values()]
    assert good == sorted(good)
    assert shares[0.5][1] > 0.9
    assert shares[0.9][1] > 0.95
    assert shares[0.98][1] > 0.98
    assert shares[0.9][0] > 0.5
