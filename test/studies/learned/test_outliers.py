# SPDX-License-Identifier: Apache-2.0
"""Generators of outliers for the training: their truth is what they displaced."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip('scipy')
from socialcircle_ros.studies.learned.outliers import (
    GENERATORS,
    GOOD_BELOW,
    OUTLIER_FROM,
    place_outliers,
    streaks,
)

NOISE = 0.02


def surface(height=60, width=90):
    heights = NOISE * np.random.default_rng(2).normal(size=(height, width))
    heights[5:9, 40:70] = np.nan
    return heights


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.01, 0.1, 0.3]), st.integers(20, 90), st.integers(20, 90))
def test_the_truth_is_what_was_displaced(seed, share, height, width):
    heights = surface(height, width)
    placed = place_outliers(heights, NOISE, share, np.random.default_rng(seed))
    moved = np.abs(placed.heights - heights) / NOISE
    assert np.array_equal(np.isfinite(placed.heights), np.isfinite(heights))
    assert (moved[placed.outlier] > OUTLIER_FROM - 1e-6).all()
    assert (moved[placed.certain & ~placed.outlier] < GOOD_BELOW + 1e-6).all()
    assert not placed.outlier[np.isnan(heights)].any()
    assert placed.outlier.any() <= (share > 0)


def test_the_same_seed_places_the_same():
    first, second = (place_outliers(surface(), NOISE, 0.1, np.random.default_rng(8)) for _ in range(2))
    assert np.array_equal(first.heights, second.heights, equal_nan=True)


@pytest.mark.parametrize('generator', GENERATORS)
def test_each_generator_makes_about_the_share(generator):
    shares = [
        (np.abs(generator(surface(120, 160) / NOISE, 0.1, np.random.default_rng(seed))) >= OUTLIER_FROM).mean()
        for seed in range(12)
    ]
    assert 0.04 < np.mean(shares) < 0.2


@pytest.mark.parametrize('size', [(30, 40), (200, 260)])
def test_few_streaks_are_short(size):
    random = np.random.default_rng(4)
    placed = [np.count_nonzero(streaks(np.zeros(size), 0.01, random)) / (size[0] * size[1]) for _ in range(40)]
    assert max(placed) <= 0.03
    assert min(placed) > 0
