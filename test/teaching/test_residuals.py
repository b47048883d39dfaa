# SPDX-License-Identifier: Apache-2.0
"""Residuals and edges that a tilt does not change."""

import numpy as np
import pytest

from socialcircle_ros.teaching.residuals import beside_edges, residuals

ROWS, COLUMNS = 200, 300
Y, X = np.mgrid[:ROWS, :COLUMNS].astype(float)
NOISE = np.random.default_rng(1).normal(size=(ROWS, COLUMNS))

FORMS = {
    'level': 0 * X,
    'thread': 5 * np.abs(X % 48 - 24),
    'dome': -((Y - 100) ** 2 + (X - 150) ** 2) / 40,
    'shaft': 20 * np.sqrt(160**2 - (X - 150) ** 2),
    'terraces': 300.0 * (X // 50),
}


def noise(heights):
    """Robust standard deviation of the residuals."""
    return 1.4826 * np.nanmedian(residuals(heights.astype(np.float32), 5))


@pytest.mark.parametrize('tilt', [0, 1, 3, 5, 8, 12])
@pytest.mark.parametrize('form', FORMS)
def test_the_noise_is_free_of_tilt_and_form(form, tilt):
    assert noise(FORMS[form] + tilt * (X + 0.63 * Y) + NOISE) == pytest.approx(0.95, abs=0.15)


def test_a_spike_on_a_slope_stands_out_by_its_height():
    heights = 9 * X + NOISE
    heights[90, 140] += 70
    far = residuals(heights.astype(np.float32), 13, 2)
    assert np.argmax(far) == 90 * COLUMNS + 140
    assert far.max() == pytest.approx(70, abs=5)


def test_windows_hold_measured_points_only():
    heights = NOISE.astype(np.float32)
    heights[::2, :] = np.nan
    far = residuals(heights, 5)
    np.testing.assert_array_equal(np.isnan(far), np.isnan(heights))
    alone = np.full((9, 9), np.nan, np.float32)
    alone[4, 4] = 3
    assert residuals(alone, 5)[4, 4] == 0
    assert np.isnan(residuals(np.full((9, 9), np.nan, np.float32), 5)).all()


@pytest.mark.parametrize('tilt', [0.0, 12.0])
def test_edges_are_steps_and_holes_but_no_slope(tilt):
    heights = (0.01 * NOISE + tilt * (X + 0.63 * Y) + 30 * (X >= 150)).astype(np.float32)
    heights[50:60, 40:50] = np.nan
    edges = beside_edges(heights)
    assert edges[:, 148:152].all()
    assert edges[48:50, 40:50].all()
    assert edges[50:60, 50:52].all()
    assert not edges[50:60, 40:50].any()
    assert edges.mean() < 0.6


def test_nothing_is_beside_an_edge_where_nothing_is_measured():
    assert not beside_edges(np.full((9, 9), np.nan, np.float32)).any()


def test_points_at_most_two_away_from_the_highest_steps_are_beside_an_edge():
    heights = 30.0 * (X >= 150)
    for column in range(20, 120, 11):  # so many lower steps that one point in twenty is at a step
        heights += column <= X
    edges = beside_edges(heights.astype(np.float32))
    assert np.flatnonzero(edges.any(axis=0)).tolist() == list(range(147, 153))
    assert (edges == edges[0]).all()
