# SPDX-License-Identifier: Apache-2.0
"""The spread and the grain where their plain definition fails; test_features compares both with a reference."""

import numpy as np
import pytest

from socialcircle_ros.circle.network.scales import scales_of


@pytest.mark.parametrize('noise', [0.35, 0.4, 0.5, 0.7])
@pytest.mark.parametrize(('unit', 'offset'), [(1.0, 0.0), (0.01, 123.0)])
def test_less_noise_than_the_storage_step_leaves_a_spread_of_the_step(noise, unit, offset):
    heights = np.round(np.random.default_rng(2).normal(0, noise, (200, 300)))
    heights[np.random.default_rng(3).random(heights.shape) < 0.002] += 30  # outliers say nothing about the step
    assert scales_of((unit * heights + offset).astype(np.float32)).spread == pytest.approx(0.65 * unit, rel=0.01)


@pytest.mark.parametrize('rise', [30.0, 1000.0])
def test_a_few_high_outliers_do_not_change_the_spread_of_noise(rise):
    heights = np.random.default_rng(0).normal(size=(200, 220))
    heights[np.random.default_rng(1).random(heights.shape) < 0.01] += rise
    assert scales_of(heights.astype(np.float32)).spread == pytest.approx(1.0, rel=0.1)


@pytest.mark.parametrize('noise', [0.0, 0.1, 0.2, 0.25, 0.35, 0.5])
@pytest.mark.parametrize('share', [0.01, 0.02, 0.05])
@pytest.mark.parametrize('sides', [(1000,), (-100, 100)])
def test_outliers_of_one_height_are_no_storage_step(noise, share, sides):
    random = np.random.default_rng(4)
    heights = np.round(random.normal(0, noise, (200, 300)))
    fallen = random.random(heights.shape) < share
    heights[fallen] = random.choice(sides, fallen.sum())
    assert scales_of(heights.astype(np.float32)).spread < abs(sides[0]) / 15


def test_many_outliers_of_one_height_among_few_steps_are_no_storage_step():
    random = np.random.default_rng(4)
    heights = np.round(random.normal(0, 0.2, (200, 300)))
    heights[random.random(heights.shape) < 0.1] = 1000
    assert scales_of(heights.astype(np.float32)).spread < 200


def test_rare_or_unlike_differences_are_no_storage_step():
    flat = np.zeros((100, 100), np.float32)
    flat[:, 50:] = 100
    assert scales_of(flat).spread < 75
    steep = 200.0 * np.arange(100) * np.ones((100, 1)) + np.random.default_rng(1).normal(size=(100, 100))
    assert scales_of(steep.astype(np.float32)).spread == pytest.approx(0.9, abs=0.2)
    spiky = np.where(np.random.default_rng(1).random((100, 100)) < 0.1, np.arange(100.0), 0).astype(np.float32)
    assert scales_of(spiky).spread < 10


@pytest.mark.parametrize('shape', [(40, 40), (24, 32), (300, 400)])
def test_on_a_small_cloud_of_a_steep_form_the_spread_is_not_far_below_the_noise(shape):
    y, x = (np.linspace(-1, 1, size) for size in shape)
    noise = np.random.default_rng(1).normal(size=shape)
    scales = scales_of((30 * (x**2 + y[:, None] ** 2) + noise).astype(np.float32))
    assert 0.35 < scales.spread < 1.1
    assert 0.7 < 2.0**scales.grain * scales.spread / np.median(np.abs(np.diff(noise, 2, 1))) < 1.4


@pytest.mark.parametrize('shape', [(480, 640), (600, 800), (1000, 1000), (1201, 900)])
def test_the_sample_looks_at_every_column(shape):
    spreads = []
    for phase in range(5):
        heights = 30.0 * (((np.arange(shape[1]) + phase) % 5) < 2) * np.ones((shape[0], 1))
        spreads.append(
            scales_of((heights + np.random.default_rng(1).normal(size=shape)).astype(np.float32)).spread
        )
    assert max(spreads) < 1.1 * min(spreads)


@pytest.mark.parametrize('noise', [0.5, 0.6, 0.7])
@pytest.mark.parametrize('form', [lambda y, x: 0.0005 * ((x - 150) / 10) ** 2, lambda y, x: 0 * x])
def test_steps_are_seen_beneath_a_form_that_came_after_them(noise, form):
    heights = np.round(np.random.default_rng(2).normal(0, noise, (200, 300)))
    heights += form(*np.indices(heights.shape))
    assert scales_of(heights.astype(np.float32)).spread > 0.6


@pytest.mark.parametrize('height', [5.0, 1000.0])
def test_a_difference_of_one_rounding_is_no_spread(height):
    heights = np.full((100, 120), height, np.float32)
    heights[np.random.default_rng(1).random(heights.shape) < 0.05] = np.nextafter(
        np.float32(height), np.float32(9e9)
    )
    assert scales_of(heights).spread == np.spacing(np.float32(height))
