# SPDX-License-Identifier: Apache-2.0
"""The reference against other formulations: whole-array NumPy, and labels that spread until none changes."""

from dataclasses import replace

import numpy as np
import pytest
from clouds import grid, measured_points, recipes
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from naive import circle as naive


def scores_by_broadcasting(points):
    d = np.linalg.norm(points[:, None] - points[None], axis=2)
    others = ~np.eye(len(points), dtype=bool)
    mu = np.array([np.median(row[other]) for row, other in zip(d, others, strict=True)])
    votes = np.exp(-((d / mu[:, None]) ** 2) / 2) / np.sqrt(2 * np.pi)
    return np.where(others, votes, 0).sum(axis=0)


@settings(max_examples=100, deadline=None)
@given(recipes(10, 10))
def test_scores_agree_with_whole_array_arithmetic(recipe):
    xyz = replace(recipe, unit='ordinary').cloud()
    measured = np.isfinite(xyz).all(axis=2)
    assume(measured.sum() > 1)
    points = xyz[measured].astype(float)
    assume(len(np.unique(points, axis=0)) == len(points))

    scores = naive.vote_scores(xyz)

    np.testing.assert_allclose(scores[measured], scores_by_broadcasting(points), rtol=1e-9)
    assert np.isnan(scores[~measured]).all()


def component_of(seed, xyz, limit):
    """The connected component: the smallest label spreads in all eight directions at once."""
    rows, columns = xyz.shape[:2]
    label = np.arange(rows * columns).reshape(rows, columns)
    while True:
        before = label.copy()
        for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
            upper, lower = slice(0, rows - down), slice(down, rows)
            left, beyond = (
                slice(max(0, -right), columns - max(0, right)),
                slice(max(0, right), columns + min(0, right)),
            )
            one, other = (upper, left), (lower, beyond)
            squares = np.square(xyz[one] - xyz[other])
            linked = (squares[..., 0] + squares[..., 1]) + squares[..., 2] < limit
            smaller = np.minimum(label[one], label[other])
            label[one] = np.where(linked, smaller, label[one])
            label[other] = np.where(linked, np.minimum(smaller, label[other]), label[other])
        if (label == before).all():
            return label == label[seed]


@settings(max_examples=200, deadline=None)
@given(recipes(16, 16), st.integers(0, 256), st.sampled_from([1.1, 1.5, 2.2360679775, 5.0]))
def test_window_3_gives_the_connected_component_of_the_seed(recipe, pick, radius):
    xyz = recipe.cloud()
    points = measured_points(xyz)
    assume(points)
    seed = points[pick % len(points)]
    limit = xyz.dtype.type(radius) * xyz.dtype.type(radius)

    with np.errstate(all='ignore'):
        component = component_of(seed, xyz, limit)

    np.testing.assert_array_equal(naive.expand(xyz, seed, limit, 3), component)


@settings(max_examples=100, deadline=None)
@given(recipes(12, 12))
def test_roughness_agrees_with_whole_array_arithmetic(recipe):
    xyz = replace(recipe, unit='ordinary', offset=0.0).cloud()
    z = np.where(np.isfinite(xyz).all(axis=2), xyz[..., 2].astype(float), np.nan)
    second = np.abs(np.concatenate([np.diff(z, 2, axis=0).ravel(), np.diff(z, 2, axis=1).ravel()]))
    second = second[~np.isnan(second)]

    one_height = len(np.unique(z[~np.isnan(z)])) == 1
    expected = np.quantile(second, 0.5, method='lower') if second.size and not one_height else np.inf

    assert naive.roughness(xyz) == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_candidates_start_at_each_30th_point_and_at_the_last_possible_one():
    assert naive.starts(1, 1) == [0]
    assert naive.starts(60, 60) == [0]
    assert naive.starts(61, 60) == [0, 1]
    assert naive.starts(90, 60) == [0, 30]
    assert naive.starts(100, 60) == [0, 30, 40]


def test_the_paper_s_example_of_a_ring():
    # Eq. 7 on 16 points, n = 0..15, takes index 8.
    assert naive.ring_limit(grid(np.zeros((5, 5))), (2, 2), 3) == 5.0
