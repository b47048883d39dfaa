# SPDX-License-Identifier: Apache-2.0
"""Light that changes from frame to frame moves no peak, and texture is not taken for light."""

import dataclasses

import numpy as np
import pytest
from focus.stacks import errors, make_stack, ruled
from hypothesis import example, given, settings
from hypothesis import strategies as st
from naive import focus as naive

from socialcircle_ros.focus import depth_from_focus
from socialcircle_ros.focus.measure import scale_of
from socialcircle_ros.settings import FocusSettings

TURNS = {
    'upside down': lambda maps: maps[..., ::-1, :],
    'left to right': lambda maps: maps[..., ::-1],
    'transposed': lambda maps: np.swapaxes(maps, -1, -2),
}


def dimmed(stack, shares):
    return np.rint(stack.frames * np.asarray(shares)[:, None, None]).astype(stack.frames.dtype)


@pytest.fixture(scope='module')
def bright():
    return make_stack(seed=3, dtype=np.uint16, width=2.6, margin=10.0)


@pytest.mark.parametrize('change', ['flicker', 'ramp'])
def test_light_of_the_frames_is_divided_out(bright, change):
    count = len(bright.z)
    flicker = 1 + 0.05 * np.random.default_rng(0).standard_normal(count)
    shares = 0.8 * flicker if change == 'flicker' else np.linspace(0.5, 1.0, count)
    frames = dimmed(bright, shares)
    steady = errors(depth_from_focus(bright.frames, bright.z), bright.truth)
    wrong = errors(depth_from_focus(frames, bright.z), bright.truth)
    uncorrected = errors(depth_from_focus(frames, bright.z, FocusSettings(normalize=False)), bright.truth)
    assert np.sqrt(np.mean(wrong**2)) < 1.1 * np.sqrt(np.mean(steady**2)) + 0.003
    assert np.sqrt(np.mean(uncorrected**2)) > 1.5 * np.sqrt(np.mean(steady**2))


def test_flicker_is_measured(bright):
    shares = np.where(np.arange(len(bright.z)) % 2, 0.9, 1.0)
    result = depth_from_focus(dimmed(bright, shares), bright.z)
    assert result.flicker == pytest.approx(np.std(shares) / np.mean(shares), rel=0.05)
    assert depth_from_focus(bright.frames, bright.z).flicker < 0.01


def test_black_frames_are_no_division_by_zero(bright):
    frames = bright.frames.copy()
    frames[::3] = 0
    assert np.isfinite(depth_from_focus(frames, bright.z).quality).all()


@pytest.mark.parametrize('order', [1, -1])
@pytest.mark.parametrize('width', [2, 3])
def test_light_that_follows_the_focus_of_the_part_is_not_divided_out(order, width):
    """As with a mirror or in a confocal microscope: divided out, no frame would be sharper than another."""
    texture = np.random.default_rng(0).integers(0, 200, (30, 40))
    z = np.arange(9.0)[::order]
    frames = [(texture * np.exp(-(((each - 4.2) / width) ** 2))).astype(np.uint8) for each in z]
    result = depth_from_focus(frames, z)
    assert abs(np.nanmedian(result.depth) - 4.2) < 0.2
    assert np.isfinite(result.depth).mean() > 0.9


@settings(max_examples=60, deadline=None)
@given(
    shape=st.tuples(st.integers(1, 40), st.integers(1, 40)),
    dtype=st.sampled_from([np.uint8, np.uint16]),
    most=st.sampled_from([0, 1, 200, None]),
    seed=st.integers(0, 99),
)
def test_light_of_a_frame_is_that_of_the_reference(shape, dtype, most, seed):
    top = np.iinfo(dtype).max if most is None else most
    frame = np.random.default_rng(seed).integers(0, top, shape, dtype, endpoint=True)
    assert scale_of(frame) == naive.scale_of(frame)


@pytest.mark.parametrize('dtype', [np.uint8, np.uint16])
def test_light_of_a_white_frame_of_twelve_megapixels_is_exact(dtype):
    most = np.iinfo(dtype).max
    assert scale_of(np.full((3000, 4000), most, dtype)) == (64 if dtype == np.uint8 else 16384) / most


rulings = given(
    period=st.integers(2, 16), phase=st.integers(0, 15), axis=st.sampled_from([0, 1]), seed=st.integers(0, 9)
)
SEES_ALL = FocusSettings(step=1, half_window=8)
"""A step of 2 is blind to a period of 2; a small window has no texture between the lines."""


def apart(one, other):
    """The largest difference, away from the edge, where whether a slope is known depends on single pixels."""
    difference = (one - other)[20:-20, 20:-20]
    assert np.isfinite(difference).mean() > 0.8
    return np.nanmax(np.abs(difference))


@settings(max_examples=30, deadline=None)
@rulings
@example(period=4, phase=0, axis=0, seed=0)
@example(period=12, phase=4, axis=0, seed=0)
def test_contrast_of_a_ruling_is_no_flicker(period, phase, axis, seed):
    """A ruling is no darker out of focus, so that there is nothing to divide out."""
    frames, _ = ruled(period, phase, axis, seed=seed)
    z = np.arange(17.0)
    result = depth_from_focus(frames, z, SEES_ALL)
    as_it_came = depth_from_focus(frames, z, dataclasses.replace(SEES_ALL, normalize=False))
    assert result.flicker < 0.001
    assert apart(result.depth, as_it_came.depth) < 0.01


@settings(max_examples=30, deadline=None)
@rulings
@example(period=4, phase=0, axis=0, seed=0)
@example(period=16, phase=15, axis=1, seed=0)
def test_turned_frames_give_the_same_heights(period, phase, axis, seed):
    """The light is equal to the last bit. The centroid correction takes its slopes from every fourth row."""
    frames, _ = ruled(period, phase, axis, seed=seed)
    one = depth_from_focus(frames, np.arange(17.0), SEES_ALL)
    for name, turn in TURNS.items():
        other = depth_from_focus(turn(frames), np.arange(17.0), SEES_ALL)
        assert other.flicker == one.flicker, name
        assert apart(turn(other.depth), one.depth) < 0.02, name
