# SPDX-License-Identifier: Apache-2.0
"""The step in which heights are stored."""

import numpy as np
import pytest
from circle.adaptive.surfaces import float32_heights
from clouds import recipes
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import adaptive as naive

from socialcircle_ros.circle.adaptive.quantisation import quantisation_step


@settings(max_examples=100)
@given(recipes(36, 40), st.sampled_from([0.0, 1e-3, 1.0]), st.floats(-3, 3))
def test_the_step_equals_that_of_the_reference(recipe, step, tilt):
    with np.errstate(all='ignore'):
        heights = float32_heights(recipe)
        if step:
            known = heights[np.isfinite(heights)]
            spread = np.std(known) if known.size else 1.0
            heights = step * np.round(heights / (spread or 1.0)) + step * tilt * np.arange(heights.shape[1])
        heights = heights.astype(np.float32)

        assert quantisation_step(heights) == naive.quantisation_step(heights)


FORMS = {
    'none': lambda y, x: 0 * x,
    'a plane': lambda y, x: 0.37 * x - 0.11 * y,
    'a slight plane': lambda y, x: 0.003 * x + 0 * y,
    'a steep plane': lambda y, x: 7.7 * x + 3.2 * y,
    'a bowl': lambda y, x: 1e-3 * (x - 100) ** 2 + 2e-3 * y**2,
}


@pytest.mark.parametrize('noise', [0.3, 0.5, 0.7, 1.0, 2.0])
@pytest.mark.parametrize('form', FORMS)
@given(
    st.sampled_from([1e-6, 0.01, 4.547, 20.0]), st.floats(0, 0.05), st.integers(0, 2**16),
)  # fmt: skip
@settings(max_examples=4)
def test_it_is_found_whatever_plane_or_form_was_subtracted(noise, form, step, share, seed):
    random = np.random.default_rng(seed)
    y, x = np.mgrid[:150, :220].astype(float)
    heights = np.round(10 * np.sin(x / 30) * np.cos(y / 20) + random.normal(0, noise, x.shape))
    heights[random.random(heights.shape) < share] += random.integers(-60, 60)
    heights = step * (heights + FORMS[form](y, x))

    assert quantisation_step(heights.astype(np.float32)) == pytest.approx(step, rel=0.02)
    turned = quantisation_step(np.ascontiguousarray(heights[::-1].T, np.float32))
    assert turned == pytest.approx(step, rel=0.02)


@pytest.mark.parametrize('tilt', [0.0, 0.5, 100.0])
@given(st.integers(0, 2**16))
@settings(max_examples=5)
def test_noise_that_is_not_stored_in_steps_has_none(tilt, seed):
    noise = np.random.default_rng(seed).normal(size=(150, 220))
    plane = tilt * np.arange(220)
    for heights in (noise, noise.cumsum(axis=1), noise.cumsum(axis=0).cumsum(axis=1), noise**3):
        assert quantisation_step((heights + plane).astype(np.float32)) == 0


@pytest.mark.parametrize('period', [3, 8, 10])
@pytest.mark.parametrize('height', [30, 100, 300])
def test_the_lines_of_a_grating_are_no_step(period, height):
    noise = np.random.default_rng(2).normal(size=(150, 220))
    lines = height * (np.arange(220) % period == 0)
    assert quantisation_step((noise + lines).astype(np.float32)) == 0


def test_levelling_in_float32_hides_no_step():
    random = np.random.default_rng(5)
    y, x = np.mgrid[:150, :220].astype(np.float32)
    stored = np.round(8000 + 30 * x - 10 * y + random.normal(0, 0.5, x.shape)).astype(np.float32)
    levelled = stored - (np.float32(8000) + np.float32(30) * x - np.float32(10) * y)
    assert quantisation_step(levelled.astype(np.float32)) == pytest.approx(1, rel=0.02)


def test_spikes_of_one_height_on_a_plane_are_no_step():
    heights = np.zeros((100, 120), np.float32)
    heights[np.random.default_rng(1).random(heights.shape) < 0.05] = 9
    assert quantisation_step(heights) == 0


@pytest.mark.parametrize('shape', [(1, 1), (1, 2), (2, 3), (1, 60), (60, 1)])
def test_a_cloud_of_any_size_has_an_answer(shape):
    heights = np.round(np.random.default_rng(1).normal(size=shape)).astype(np.float32)
    assert quantisation_step(heights) == (1 if max(shape) == 60 else 0)
    assert quantisation_step(np.full(shape, np.nan, np.float32)) == 0
