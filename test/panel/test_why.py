# SPDX-License-Identifier: Apache-2.0
"""Why a point was called an outlier."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from panel.test_view import drawing, masked

from socialcircle_ros.panel.why import explanation_of, scores_of
from socialcircle_ros.settings import PARAMETERS

DEFAULTS = {name: row.default for name, row in PARAMETERS.items()}


def tilted(offset=0.0):
    """A tilted rough plane in m with an island of three points and one point that is kept beside it."""
    y, x = np.mgrid[:60, :80].astype(np.float64) * 1e-6
    z = offset + 0.3 * x - 0.1 * y + 2e-8 * np.random.default_rng(0).normal(size=x.shape)
    z[20, 30:32] += 5e-6
    z[21, 32] += 5e-6
    return np.dstack([x, y, z])


ISLAND = [(20, 30), (20, 31), (21, 32)]


@pytest.mark.parametrize('offset', [0.0, -3.0])
def test_an_outlier_is_so_many_spreads_over_its_surroundings_and_of_an_island(offset):
    xyz = tilted(offset)
    reason = explanation_of(drawing(xyz, masked(xyz, ISLAND)), (20, 31), radius=2e-6)
    assert reason.is_outlier
    assert reason.island == 3
    assert reason.above == pytest.approx(5e-6, abs=1e-7)
    assert reason.spread == pytest.approx(2e-8, rel=0.5)
    said = ' '.join(reason.sentences('m'))
    assert said.startswith('Outlier: row 20, column 31, height')
    assert 'above the kept points round it' in said
    assert 'Its island has 3 points.' in said
    assert 'beyond the radius of 2 µm' in said


def test_a_kept_point_and_a_gap_are_named_so():
    xyz = tilted()
    xyz[5, 6] = np.nan
    seen = drawing(xyz, masked(xyz, ISLAND))
    kept = explanation_of(seen, (40, 40), radius=2e-6)
    assert (kept.is_outlier, kept.island) == (False, 0)
    assert abs(kept.in_spreads) < 5
    assert 'within the radius' in ' '.join(kept.sentences('m'))
    assert explanation_of(seen, (5, 6)).sentences('m') == ['Not measured: row 5, column 6.']


def test_without_kept_points_near_it_says_so():
    xyz = tilted()
    everything = [(row, column) for row in range(60) for column in range(80)]
    reason = explanation_of(drawing(xyz, masked(xyz, everything)), (20, 31))
    assert math.isnan(reason.above)
    assert 'Too few kept points' in ' '.join(reason.sentences('m'))
    assert reason.island == 4800


@given(st.data())
def test_the_island_is_what_touches_also_at_corners(data):
    shape = data.draw(st.tuples(st.integers(2, 7), st.integers(2, 7)))
    found = np.array(data.draw(st.lists(st.booleans(), min_size=math.prod(shape), max_size=math.prod(shape))))
    places = [tuple(place) for place in np.argwhere(found.reshape(shape))]
    if not places:
        return
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    xyz = np.dstack([columns, rows, rows * columns]).astype(np.float64)
    start = data.draw(st.sampled_from(places))
    island, before = {start}, set()
    while island != before:
        before = set(island)
        island |= {p for p in places if any(max(abs(p[0] - q[0]), abs(p[1] - q[1])) <= 1 for q in before)}
    assert explanation_of(drawing(xyz, masked(xyz, places)), start).island == len(island)


def test_the_score_is_that_of_the_adaptive_mode():
    xyz = tilted()
    assert scores_of(xyz, {**DEFAULTS, 'circle.mode': 'paper'}, None) is None
    score = scores_of(xyz, {**DEFAULTS, 'circle.mode': 'adaptive'}, None)
    reason = explanation_of(drawing(xyz, masked(xyz, ISLAND)), (20, 31), score=score)
    assert reason.score > 0.5
    assert f'Its score is {reason.score:.2f}' in ' '.join(reason.sentences('m'))
