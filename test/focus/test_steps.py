# SPDX-License-Identifier: Apache-2.0
"""The quality where the frames of a stack are too few, or too far apart, for the focus curves."""

import numpy as np
import pytest
from focus.stacks import INNER, make_stack, same

from socialcircle_ros.focus import depth_from_focus
from socialcircle_ros.focus.fit import _SAMPLES, TILE, _spread_columns
from socialcircle_ros.focus.steps import _gap_factors, lower_where_steps_are_wide

DEPTHS_OF_FIELD = 1.1
"""Depth of field of the stacks of `make_stack`, in their widths."""


def broken_promises(result, truth, depth_of_field, least_share=0.01):
    """The qualities that are not held, by the share of good pixels; of a few pixels none is asked."""
    good = np.abs(result.depth - truth)[INNER] < depth_of_field / 4
    above = {least: result.quality[INNER] >= least for least in (0.3, 0.5, 0.7, 0.9)}
    return {q: good[at].mean() for q, at in above.items() if at.mean() > least_share and good[at].mean() < q}


@pytest.mark.parametrize('depths_of_field', [0.5, 1, 1.5, 2, 2.3, 3, 4])
@pytest.mark.parametrize('electrons', [None, 6000])
def test_the_quality_is_held_whatever_the_step(depths_of_field, electrons):
    width = 1 / depths_of_field / DEPTHS_OF_FIELD
    stack = make_stack(width=width, electrons=electrons, shape=(64, 80), tilt=0.07)
    result = depth_from_focus(stack.frames, stack.z)
    assert broken_promises(result, stack.truth, 1 / depths_of_field) == {}
    if depths_of_field <= 1:
        assert not result.wide_steps
        assert np.mean(result.quality[INNER] >= 0.5) > 0.9
    if depths_of_field >= 3:
        assert result.wide_steps
        assert result.depth_of_field is None


def test_nothing_tests_a_curve_of_three_frames():
    stack = make_stack(width=1.3, shape=(64, 80), margin=1.5)
    middle = len(stack.z) // 2
    result = depth_from_focus(stack.frames[middle - 1 : middle + 2], stack.z[middle - 1 : middle + 2])
    assert result.wide_steps
    assert np.isfinite(result.depth).mean() > 0.1
    assert not result.quality.any()


@pytest.mark.parametrize('lost', [1, 2, 3, 4])
def test_the_quality_is_held_in_a_gap_and_unchanged_far_from_it(lost):
    stack = make_stack(electrons=6000, shape=(64, 96), tilt=0.25)
    first = len(stack.z) // 2 - 1
    kept = [k for k in range(len(stack.z)) if not first < k <= first + lost]
    whole, result = (depth_from_focus(stack.frames[part], stack.z[part]) for part in (slice(None), kept))
    assert broken_promises(result, stack.truth, 1.3 * DEPTHS_OF_FIELD) == {}
    assert not result.wide_steps
    far = (stack.truth < stack.z[first] - 9) | (stack.truth > stack.z[first + lost + 1] + 9)
    assert far.any()
    np.testing.assert_allclose(result.quality[far], whole.quality[far], atol=1e-5)  # z are rounded otherwise


def test_narrow_steps_leave_the_quality_alone():
    rng = np.random.default_rng(0)
    depth, quality = rng.uniform(0, 9, (8, 9)), rng.random((8, 9)).astype(np.float32)
    depth[0, 0] = np.nan
    found = quality.copy()
    assert not lower_where_steps_are_wide(depth, found, np.arange(10.0), 1.0)
    assert not lower_where_steps_are_wide(depth, found, np.arange(10.0), None)
    assert np.array_equal(found, quality)


@pytest.mark.parametrize(('width', 'expected'), [(0.78, 1), (0.715, 0.5), (0.65, 0), (0.3, 0)])
def test_wide_steps_lower_the_quality_of_all_pixels(width, expected):
    depth, quality = np.full((5, 6), 3.2), np.full((5, 6), 0.9, np.float32)
    wide = lower_where_steps_are_wide(depth, quality, 2e-6 * np.arange(7), 2e-6 * width)
    assert wide == (expected < 1)
    np.testing.assert_allclose(quality, 0.9 * expected, atol=1e-5)


@pytest.mark.parametrize('seed', range(20))
def test_the_factor_at_each_depth_is_that_of_the_worst_gap_near(seed):
    rng = np.random.default_rng(seed)
    z = np.sort(rng.uniform(-5, 5, rng.integers(2, 9)))
    in_gap, beside = rng.choice([0.0, 0.25, 0.75, 1.0, 1.0], z.size - 1), float(rng.uniform(0, 1))
    edges, factors = _gap_factors(z, in_gap, beside)
    for depth in rng.uniform(-7, 7, 50):
        near = (z[:-1] - beside < depth) & (depth <= z[1:] + beside)
        assert factors[np.searchsorted(edges, depth)] == min(in_gap[near], default=1)
    assert factors[np.searchsorted(edges, np.nan)] == 1


@pytest.mark.parametrize('shape', [(1, 1), (40, 50), (7, TILE), (33, 2 * TILE + 3)])
def test_the_pixels_whose_widths_count_are_spread_over_their_tiles(shape):
    height, width = shape
    columns = _spread_columns(*shape)
    tiles = -(-width // TILE)
    assert columns.shape == (height, tiles * _SAMPLES)
    assert np.array_equal(columns // TILE, np.repeat(np.arange(tiles), _SAMPLES) * np.ones((height, 1)))
    assert columns.max() < width


@pytest.mark.parametrize('period', [2, 3, 4, 5, 8])
def test_they_are_spread_over_the_phases_of_a_ruling(period):
    columns = _spread_columns(200, TILE)
    counts = np.bincount(columns.ravel() % period)
    assert counts.min() > 0.8 * columns.size / period


def test_the_result_is_the_same_in_both_directions_where_steps_are_wide():
    stack = make_stack(width=0.4, electrons=6000, shape=(40, 50))
    upward = depth_from_focus(stack.frames, stack.z)
    assert upward.wide_steps
    assert same(upward, depth_from_focus(stack.frames[::-1], stack.z[::-1]))
