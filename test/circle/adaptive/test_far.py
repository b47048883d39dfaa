# SPDX-License-Identifier: Apache-2.0
"""Single points far off, and islands that stand far off a plain surface."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import adaptive as naive

from socialcircle_ros.circle.adaptive import find_probable_outliers
from socialcircle_ros.circle.adaptive.differences import normalised_differences
from socialcircle_ros.circle.adaptive.far import far_points
from socialcircle_ros.circle.adaptive.heights import with_holes_filled
from socialcircle_ros.circle.adaptive.islands import find_islands
from socialcircle_ros.circle.adaptive.relief import relief_of
from socialcircle_ros.circle.adaptive.spread import estimate_spread


def noise(height=150, width=210, seed=3):
    return np.random.default_rng(seed).normal(size=(height, width)).astype(np.float32)


def with_patches(side, rise, flat=False):
    """White noise with three square patches, and where they are."""
    heights, patches = noise(), np.zeros((150, 210), bool)
    for top, left in ((20, 30), (60, 150), (100, 40)):
        patches[top : top + side, left : left + side] = True
    heights[patches] = (0 if flat else heights[patches]) + np.float32(rise)
    return heights, patches


def far(heights, outliers=None):
    outliers = np.zeros(heights.shape, bool) if outliers is None else outliers
    suspected = np.zeros(heights.shape, bool)
    return far_points(heights, estimate_spread(heights, 16, may_predict=False), outliers, suspected)


def contaminated(height, width, seed, noise, patches, rise, walls, missing, known, suspected):
    """Noise with patches that rise or sink, walls, points not measured, and known and suspected outliers."""
    random = np.random.default_rng(seed)
    heights = random.normal(0, noise, (height, width))
    for _ in range(patches):
        top, left = random.integers(0, height), random.integers(0, width)
        rows, columns = random.integers(1, 7, 2)
        heights[top : top + rows, left : left + columns] += rise * random.choice([-1, 1])
    for _ in range(walls):
        heights[:, random.integers(0, width) :] += rise
    heights[random.random(heights.shape) < missing] = np.nan
    marked = [(random.random(heights.shape) < share) & np.isfinite(heights) for share in (known, suspected)]
    return heights.astype(np.float32), *marked


CONTAMINATED = st.builds(
    contaminated,
    st.integers(1, 70),
    st.integers(1, 46),
    st.integers(0, 10**6),
    st.sampled_from([0.0, 1e-6, 1.0, 1e6]),
    st.integers(0, 3),
    st.sampled_from([0.0, 7.0, 9.0, 15.0, 1e3, 1e7]),
    st.sampled_from([0, 0, 0, 1]),
    st.sampled_from([0.0, 0.0, 0.1]),
    st.sampled_from([0.0, 0.02, 0.3]),
    st.sampled_from([0.0, 0.1, 0.5]),
)


@settings(max_examples=300)
@given(CONTAMINATED)
def test_far_points_equal_the_reference(cloud):
    heights, outliers, suspected = cloud
    if np.isnan(heights).all():
        return
    spread = estimate_spread(heights, 16, may_predict=False)
    filled = with_holes_filled(heights, outliers)
    differences = normalised_differences(filled, replace(spread, by_direction=2 * spread.by_direction))

    def find(clip, steep, rise):
        relief, measured = relief_of(differences), np.isfinite(filled)
        return find_islands(relief, differences, measured, clip / 2, steep, 1, rise / 2)[0]

    np.testing.assert_array_equal(
        far_points(heights, spread, outliers, suspected),
        naive.far_points(heights, outliers, suspected, differences, find),
    )


def test_a_single_point_that_is_suspected_need_not_be_as_far_off():
    heights = noise()
    spikes = np.zeros(heights.shape, bool)
    spikes[5:145:20, 5:205:20] = True
    heights[spikes] += np.float32(11)
    heights[70, 100] += np.float32(30)  # so that anything is sought
    suspected = spikes.copy()
    suspected[::3] = True
    spread = estimate_spread(heights, 16, may_predict=False)
    lines = 100 * np.float32(np.arange(210) % 10 == 0)  # no plain surface, on which islands would be found
    found = far_points(heights + lines, spread, np.zeros_like(spikes), suspected)
    assert found[spikes].mean() > 0.95
    assert np.count_nonzero(found & ~spikes) <= 5
    for probability, least, most in ((70, 0.95, 1.0), (40, 0.0, 0.0)):  # 51 is suspected
        given = np.where(spikes, probability, 0).astype(np.uint8)
        share = (
            find_probable_outliers(heights + lines, lambda _, given=given: given.copy()).outliers[spikes].mean()
        )
        assert least <= share <= most


def test_where_most_points_stand_out_none_does_for_being_suspected():
    random = np.random.default_rng(1)
    heights = np.zeros((90, 120), np.float32)
    heights += random.normal(0, 1e-3, heights.shape).astype(np.float32)
    heights[::2, ::2] += 1.0
    everywhere = np.ones(heights.shape, bool)
    spread = estimate_spread(heights, 16, may_predict=False)
    assert not far_points(heights, spread, ~everywhere, everywhere).any()


@pytest.mark.parametrize('side', [3, 6, 10, 16])
@pytest.mark.parametrize('rise', [20, 40, 1000, -40])
@pytest.mark.parametrize('flat', [False, True])
def test_patches_far_off_white_noise_are_found_whatever_their_probability(side, rise, flat):
    heights, patches = with_patches(side, rise, flat=flat)
    result = find_probable_outliers(heights, lambda given: np.zeros(given.shape, np.uint8))
    assert result.outliers[patches].all()
    assert np.count_nonzero(result.outliers & ~patches) <= 6
    assert (result.score[patches] > 0.5).all()
    assert 'far_points' in result.times_ms


def test_a_patch_is_found_though_its_rim_is_known():
    heights, patches = with_patches(10, 300)
    rim = patches.copy()
    for top, left in ((20, 30), (60, 150), (100, 40)):
        rim[top + 1 : top + 9, left + 1 : left + 9] = False
    assert (far(heights, rim) | rim)[patches].all()


def test_no_island_is_far_on_a_surface_with_large_steps_of_its_own():
    stepped, patches = with_patches(10, 100)
    stepped[:, ::9] += 100
    assert far(stepped).sum() < 10  # single points where a ridge crosses the edge of a patch
    assert far(with_patches(10, 100)[0])[patches].all()


TEXTURES = {
    'checkered': lambda y, x: 30.0 * ((x // 2 + y // 2) % 2),
    'grating': lambda y, x: 30.0 * (x % 4 < 2),
    'lines': lambda y, x: 40.0 * (x % 5 < 2),
    'wave': lambda y, x: 10 * np.sin(2 * np.pi * x / 3),
    'half measured': lambda y, x: np.where((x + y) % 2, np.nan, 0.0),
}


@pytest.mark.parametrize('texture', TEXTURES)
def test_single_points_far_off_are_found_in_textures_as_fine_as_themselves(texture):
    heights = noise() + TEXTURES[texture](*np.indices((150, 210))).astype(np.float32)
    assert not far(heights).any()
    random = np.random.default_rng(7)
    spikes = (random.random(heights.shape) < 0.003) & np.isfinite(heights)
    heights[spikes] += random.choice([-150, 150], spikes.sum()).astype(np.float32)
    found = far(heights)
    assert found[spikes].mean() > 0.9
    assert not found[~spikes].any()


@pytest.mark.parametrize('after', [lambda y, x: 0.003 * x, lambda y, x: 0.5 * (x / 210) ** 2])
@pytest.mark.parametrize('roughness', [0.8, 1.0, 1.2])
def test_a_plate_in_steps_that_was_levelled_has_no_single_points(after, roughness):
    heights = np.round(roughness * noise()) + after(*np.indices((150, 210)))
    assert not far(heights.astype(np.float32)).any()


def test_two_spikes_that_touch_are_alone_and_the_middle_of_three_is_not():
    heights = noise() / 8
    heights[40, 50:53] += 100
    heights[90, 50:52] += 100
    heights[120, 50] += 100
    lines = 100.0 * (np.arange(210) % 9 == 0)  # no plain surface, on which islands would be found
    found = far((heights + lines).astype(np.float32))
    assert np.argwhere(found).tolist() == [[40, 50], [40, 52], [90, 50], [90, 51], [120, 50]]


def walls():
    """White noise with two walls."""
    heights = noise()
    heights[:, 80:100] += 100
    return heights


def boss():
    """White noise with a round boss that is too large for an island."""
    row, column = np.indices((150, 210))
    return noise() + np.float32(100) * ((row - 75) ** 2 + (column - 105) ** 2 < 50**2)


@pytest.mark.parametrize('surface', [walls, boss])
def test_a_patch_is_found_beside_long_edges_and_these_are_no_islands(surface):
    heights = surface()
    assert not far(heights).any()
    heights[20:30, 20:30] += 100
    islands = far(heights)
    assert islands[20:30, 20:30].all()
    assert np.count_nonzero(islands) <= 102


def with_ridges(heights, length, number):
    """The heights with ridges one point wide: too narrow for islands, too short for edges."""
    for ridge in range(number):
        heights[8 + 30 * ridge, 90 : 90 + length] += 30
    return heights


@pytest.mark.parametrize(('number', 'plain'), [(1, True), (2, False)])
def test_a_surface_is_plain_up_to_a_share_of_steps(number, plain):
    heights, patches = with_patches(10, 100)
    islands = far(with_ridges(heights, 40, number))
    assert islands[patches].all() == islands[patches].any() == plain


@pytest.mark.parametrize(('number', 'plain'), [(0, True), (1, False)])
def test_a_surface_is_very_plain_up_to_a_smaller_share(number, plain):
    heights, patches = with_patches(4, 10, flat=True)
    islands = far(with_ridges(heights, 12, number))
    assert islands[patches].all() == islands[patches].any() == plain


def test_nothing_is_sought_without_a_step():
    assert not far(noise()).any()


@pytest.mark.parametrize('scale', [2.0**-40, 2.0**30])
def test_the_unit_of_the_heights_does_not_matter(scale):
    heights, _ = with_patches(6, 40)
    np.testing.assert_array_equal(far(heights), far(heights * np.float32(scale)))


def test_on_white_noise_lower_islands_count_too():
    heights, patches = with_patches(4, 10, flat=True)
    heights[40, 100] += 12
    patches[40, 100] = True
    assert far(heights)[patches].all()


def test_lower_islands_do_not_widen_what_is_known():
    heights = noise()
    heights[60:66, 60:67] += 30
    heights[59, 60:67] += 8
    heights[20, 20] += 30
    known = np.zeros(heights.shape, bool)
    known[60:66, 60:67] = True
    islands = far(heights, known)
    assert islands[20, 20]
    assert not islands[59, 60:67].any()
