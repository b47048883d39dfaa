# SPDX-License-Identifier: Apache-2.0
"""Patches of inserted outliers, how far they stand out, and what could be found of them."""

import numpy as np
import pytest

from socialcircle_ros.simulation.outliers import Contaminated
from socialcircle_ros.studies.adaptive.inserted_outliers import insert_outliers, measured_surface
from socialcircle_ros.studies.comparison.measured import MeasuredCloud
from socialcircle_ros.studies.comparison.study import Plan, Study
from socialcircle_ros.studies.learned.visible import CONTRASTS, SHARES, patches, visible


def surface(heights):
    rows, columns = np.indices(heights.shape)
    return measured_surface(MeasuredCloud('made', np.dstack([columns, 2.0 * rows, heights]), 'm'))


@pytest.fixture
def rough():
    heights = np.random.default_rng(3).normal(size=(150, 210))
    heights[:40, 60:90] = np.nan
    return surface(heights)


def test_every_outlier_that_is_not_alone_is_in_one_patch(rough):
    made = insert_outliers(rough, 0.1, 5, 'irregular')
    count = np.zeros(made.outlier.shape, int)
    for patch in patches(rough, made.inserted):
        count[patch.rows, patch.columns] += 1
        assert len({made.inserted.cluster[place] for place in zip(patch.rows, patch.columns, strict=True)}) == 1
    assert np.array_equal(count, made.outlier & (made.inserted.cluster > 0))


@pytest.mark.parametrize('sign', [-1, 1])
def test_the_contrast_is_the_step_at_the_border_over_the_differences_around_it(sign):
    heights = np.cumsum(np.full((60, 70), 0.5), axis=1)  # neighbours differ by 0.5 along x, and by 0 along y
    displacement, cluster = np.zeros(heights.shape), np.zeros(heights.shape, np.int32)
    displacement[20:28, 30:38] = sign * 6.0
    displacement[24, 34] = sign * 8.0  # inside, a few larger steps do not count
    cluster[displacement != 0] = 1
    made = Contaminated(heights + displacement, displacement != 0, displacement, cluster)
    (patch,) = patches(surface(heights), made)
    assert patch.contrast == 6.0 / 0.5
    assert len(patch.rows) == 64


def test_a_patch_on_a_flat_surface_stands_out_without_end():
    heights = np.zeros((40, 50))
    displacement = np.zeros(heights.shape)
    displacement[0:5, 45:50] = 3.0
    made = Contaminated(displacement, displacement != 0, displacement, (displacement != 0).astype(np.int32))
    (patch,) = patches(surface(np.zeros((40, 50))), made)
    assert patch.contrast == np.inf


def test_a_judge_of_all_that_stands_out_finds_the_less_the_more_contrast_it_needs(rough):
    sections = visible(Study(Plan((1, 2)), lambda _: None), {'some': [rough]}, lambda heights: np.abs(heights) > 6)
    bounds, by_patches = sections[0].tables
    assert [row[:2] for row in bounds.rows] == [['some, 1', share] for share in SHARES]
    for row in bounds.rows:
        shares, scores = row[3::2], row[4::2]
        assert len(shares) == len(scores) == len(CONTRASTS)
        assert sorted(shares, reverse=True) == shares
        assert sorted(scores, reverse=True) == scores
        for share, score in zip(shares, scores, strict=True):
            assert score == pytest.approx(2 * share / (1 + share), abs=0.02)  # nothing else is found
    assert sum(row[3] for row in by_patches.rows) == pytest.approx(1)
    assert by_patches.rows[0][1] == 'isolated'
    assert by_patches.rows[0][4] > 0.9
