# SPDX-License-Identifier: Apache-2.0
"""Traits of communities."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import adaptive as naive

from socialcircle_ros.circle.adaptive.communities import communities_of
from socialcircle_ros.settings.lessons import TRAITS


def connected(found):
    """The connected sets of points, each sorted, in the order of their first points."""
    left = set(map(tuple, np.argwhere(found)))
    sets = []
    for first in sorted(left):
        if first not in left:
            continue
        left.discard(first)
        reached, waiting = [first], [first]
        while waiting:
            for other in naive.neighbours(*waiting.pop(), found.shape):
                if other in left:
                    left.discard(other)
                    reached.append(other)
                    waiting.append(other)
        sets.append(sorted(reached))
    return sets


def traits_of(points, heights, found, steepness, spread):
    """The traits of one community by their definition; the plane by NumPy's least squares."""
    rows, columns = np.array(points).T
    top, bottom, left, right = rows.min(), rows.max(), columns.min(), columns.max()
    frame = itertools.product(
        range(max(0, top - 6), min(len(heights) - 1, bottom + 6) + 1),
        range(max(0, left - 6), min(heights.shape[1] - 1, right + 6) + 1),
    )
    around = [place for place in frame if not found[place] and not np.isnan(heights[place])]
    wide = heights.astype(np.float64)
    plane, rough = np.zeros(3), 0.0
    if around:
        y, x = np.array(around).T
        z = wide[y, x] - wide[points[0]]
        matrix = np.stack([np.ones(len(z)), x, y], axis=1)
        spans = len(z) >= 6 and np.linalg.matrix_rank(matrix) == 3
        plane = np.linalg.lstsq(matrix, z, rcond=None)[0] if spans else np.array([z.mean(), 0, 0])
        rough = np.sqrt(((z - matrix @ plane) ** 2).mean())
    rise = (wide[rows, columns] - wide[points[0]] - plane[0] - plane[1] * columns - plane[2] * rows) / spread
    steps, missing = [], 0
    for place in points:
        for other in naive.neighbours(*place, found.shape):
            if not found[other] and np.isnan(heights[other]):
                missing += 1
            elif not found[other]:
                steps.append(min(abs(wide[place] - wide[other]) / spread, 50))
    extent = max(bottom - top, right - left) + 1
    steep = steepness[rows, columns].astype(np.float64)
    return [
        np.log(len(points)), float(rise.mean() > 0), np.log1p(np.abs(rise).mean()), np.log1p(np.abs(rise).max()),
        np.log1p(rise.std()), steep.mean(), steep.max(), len(points) / extent**2, np.log1p(rough / spread),
        np.log1p(np.hypot(*plane[1:]) / spread), np.log1p(np.mean(steps or [0])),
        missing / max(len(steps) + missing, 1),
    ]  # fmt: skip


def cloud(rows, columns, random, share, missing):
    """Heights on a tilted plane, some of them not measured, the found points, and their steepness."""
    generator = np.random.default_rng(random)
    y, x = np.mgrid[:rows, :columns]
    heights = (generator.normal(size=(rows, columns)) + 0.5 * x - 0.25 * y).astype(np.float32)
    heights[generator.random(heights.shape) < missing] = np.nan
    found = (generator.random(heights.shape) < share) & np.isfinite(heights)
    heights[found] += generator.choice([-20, 30], np.count_nonzero(found)).astype(np.float32)
    return heights, found, generator.random(heights.shape).astype(np.float32)


CLOUDS = st.builds(
    cloud,
    st.integers(1, 24),
    st.integers(1, 30),
    st.integers(0, 2**32),
    st.sampled_from([0.0, 0.02, 0.2, 0.5, 1.0]),
    st.sampled_from([0.0, 0.1, 0.6]),
)


@settings(max_examples=100)
@given(CLOUDS)
def test_traits_equal_their_definition(given_cloud):
    heights, found, steepness = given_cloud
    measured = communities_of(heights, found, steepness, 0.7)
    sets = connected(found)
    assert len(measured.traits) == len(sets)
    places = dict(zip(map(tuple, np.argwhere(found)), measured.labels.tolist(), strict=True))
    for number, points in enumerate(sets):
        assert {places[point] for point in points} == {number}
        wanted = traits_of(points, heights, found, steepness, 0.7)
        # A mean rise of 0 within rounding has no sign.
        compared = [column for column in range(len(TRAITS)) if column != 1 or wanted[2] > 1e-6]
        np.testing.assert_allclose(measured.traits[number, compared], np.take(wanted, compared), atol=1e-6)


@settings(max_examples=30)
@given(CLOUDS, st.sampled_from([-40, -3, 10, 60]))
def test_another_unit_changes_no_digit(given_cloud, power):
    heights, found, steepness = given_cloud
    one = communities_of(heights, found, steepness, 0.7)
    factor = 2.0**power
    other = communities_of(heights * np.float32(factor), found, steepness, 0.7 * factor)
    np.testing.assert_array_equal(one.traits, other.traits)


@pytest.mark.parametrize('change', [lambda y, x: 1000 + 0 * x, lambda y, x: 8 * x - 4 * y])
def test_offset_and_tilt_do_not_matter(change):
    heights, found, steepness = cloud(60, 80, 5, 0.0, 0.05)
    found[10:13, 20:24] = found[40, 50] = True
    found &= np.isfinite(heights)
    heights = np.where(found, heights + 25, heights).astype(np.float64)
    y, x = np.mgrid[:60, :80]
    inner = [name not in ('slope around', 'step at its border') for name in TRAITS]
    one = communities_of(heights.astype(np.float32), found, steepness, 0.7).traits
    other = communities_of((heights + change(y, x)).astype(np.float32), found, steepness, 0.7).traits
    np.testing.assert_allclose(one[:, inner], other[:, inner], atol=1e-3)


def test_a_community_that_fills_a_large_cloud_is_measured():
    heights = np.zeros((300, 500), np.float32)
    found = np.zeros(heights.shape, bool)
    found[5:295, 7:490] = True
    found[6:294, 8:489] = False
    heights[found] = 3
    traits = communities_of(heights, found, np.ones_like(heights), 1.0).traits
    np.testing.assert_allclose(traits[0, [2, 3, 4, 8, 9]], [np.log(4), np.log(4), 0, 0, 0], atol=1e-9)
