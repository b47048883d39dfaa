"""The expansion of the circle (section 3.2.3)."""

import numpy as np
import pytest
from clouds import LAYOUTS, SURFACES, Recipe, flat, grid, laid_out, measured_points, recipes
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from naive import circle as naive

from socialcircle_ros.circle.expansion import divide

WINDOWS = (3, 5, 7, 9)
FLAT_LIMIT = np.float64(5.0)  # eq. 7 on a flat grid of pitch 1


def expand(xyz, seed, limit, window):
    """The inliers alone."""
    return divide(xyz, seed, limit, window)[0]


def pitch_of(xyz):
    """The usual step along x, or 1."""
    steps = np.abs(np.diff(xyz[..., 0], axis=1))
    steps = steps[np.isfinite(steps) & (steps > 0)]
    return np.median(steps) if steps.size else xyz.dtype.type(1)


@settings(max_examples=900, deadline=None)
@given(
    recipes(),
    st.sampled_from(WINDOWS),
    st.integers(0, 24 * 24),
    st.sampled_from([2.2360679775, 1.0, 1.5, 3.0, 5.0, 20.0, 0.0, np.inf]),
)
def test_members_are_those_of_the_reference(recipe, window, pick, radius):
    xyz = recipe.cloud()
    points = measured_points(xyz)
    assume(points)
    seed = points[pick % len(points)]
    with np.errstate(all='ignore'):
        reach = xyz.dtype.type(radius) * pitch_of(xyz)
        limit = reach * reach
    assume(not np.isnan(limit))
    before = xyz.tobytes()

    joined = expand(xyz, seed, limit, window)

    assert joined.dtype == bool
    np.testing.assert_array_equal(joined, naive.expand(xyz, seed, limit, window))
    assert xyz.tobytes() == before


@settings(max_examples=300, deadline=None)
@given(
    st.integers(0, 2**16),
    st.sampled_from(['float64', 'float32']),
    st.sampled_from(WINDOWS),
    st.sampled_from([0.2, 0.5, 0.7]),
    st.sampled_from([1.2, 1.6, 2.3, 3.0, 4.5]),
)
@example(3, 'float64', 5, 0.5, 3.0)
def test_members_of_a_community_full_of_gaps_are_those_of_the_reference(random, dtype, window, missing, radius):
    # Gaps of this kind make windows above 3 depend on the order in which points join.
    recipe = Recipe(
        24, 19, dtype, 'noise', amplitude=0.8, jitter=0.3, missing=missing, layout='padded', random=random
    )
    xyz = recipe.cloud()
    points = measured_points(xyz)
    seed = points[len(points) // 2]
    limit = xyz.dtype.type(radius) * xyz.dtype.type(radius)

    np.testing.assert_array_equal(expand(xyz, seed, limit, window), naive.expand(xyz, seed, limit, window))


# Window 3 works on words of 64 points: what is wider than a word, and what turns often.


@settings(max_examples=150, deadline=None)
@given(
    recipes(6, 300, least_columns=60),
    st.integers(0, 6 * 300),
    st.sampled_from([1.2, 2.2360679775, 3.0, 20.0]),
)
def test_members_of_clouds_wider_than_a_word_are_those_of_the_reference(recipe, pick, radius):
    xyz = recipe.cloud()
    points = measured_points(xyz)
    assume(points)
    seed = points[pick % len(points)]
    with np.errstate(all='ignore'):
        reach = xyz.dtype.type(radius) * pitch_of(xyz)
        limit = reach * reach
    assume(not np.isnan(limit))

    np.testing.assert_array_equal(expand(xyz, seed, limit, 3), naive.expand(xyz, seed, limit, 3))


@settings(max_examples=60, deadline=None)
@given(
    st.integers(0, 2**16),
    st.sampled_from([0.3, 0.45, 0.55, 0.6]),
    st.sampled_from([63, 64, 65, 127, 128, 129, 200]),
    st.booleans(),
)
def test_members_of_a_maze_of_chance_are_those_of_the_reference(random, missing, columns, on_its_side):
    generator = np.random.default_rng(random)
    heights = np.where(generator.random((40, columns)) < missing, np.nan, 0.0)
    xyz = grid(heights.T if on_its_side else heights, dtype='float32')
    points = measured_points(xyz)
    seed = points[len(points) // 2]
    limit = np.float32(generator.choice([1.5, 2.5]))  # with and without diagonal links

    np.testing.assert_array_equal(expand(xyz, seed, limit, 3), naive.expand(xyz, seed, limit, 3))


# Windows 5 and 7 work on tiles of 8×8 points, and set aside who has no link to the 3×3 community.


@settings(max_examples=60, deadline=None)
@given(
    recipes(30, 80, least_columns=20),
    st.sampled_from([5, 7]),
    st.integers(0, 30 * 80),
    st.sampled_from([1.2, 2.2360679775, 4.5, 6.7]),
)
def test_members_of_clouds_of_many_tiles_are_those_of_the_reference(recipe, window, pick, radius):
    xyz = recipe.cloud()
    points = measured_points(xyz)
    assume(points)
    seed = points[pick % len(points)]
    with np.errstate(all='ignore'):
        reach = xyz.dtype.type(radius) * pitch_of(xyz)
        limit = reach * reach
    assume(not np.isnan(limit))

    np.testing.assert_array_equal(expand(xyz, seed, limit, window), naive.expand(xyz, seed, limit, window))


@settings(max_examples=80, deadline=None)
@given(st.integers(0, 2**16), st.sampled_from([5, 7]), st.floats(0.05, 0.5), st.floats(1.5, 12.0))
def test_members_of_floors_that_only_wide_windows_join_are_those_of_the_reference(random, window, share, height):
    # Points on other floors are no members of the 3×3 community, but some of them join, and lead to others.
    generator = np.random.default_rng(random)
    floors = generator.choice(4, (26, 35), p=[1 - share, *[share / 3] * 3])
    xyz = grid(floors * height + generator.normal(0, 0.3, floors.shape), dtype='float32')
    seed = measured_points(xyz)[450]
    limit = np.float32(20.0)

    np.testing.assert_array_equal(expand(xyz, seed, limit, window), naive.expand(xyz, seed, limit, window))


@pytest.mark.parametrize('window', [3, 5, 7])
def test_members_do_not_depend_on_the_number_of_threads(window, monkeypatch):
    generator = np.random.default_rng(1)
    heights = np.where(generator.random((90, 150)) < 0.2, generator.uniform(-9, 9, (90, 150)), 0.0)
    heights[generator.random(heights.shape) < 0.2] = np.nan
    heights[40, 70] = 0.0
    xyz = grid(heights, dtype='float32')
    monkeypatch.setattr('socialcircle_ros.kernels.bands._LEAST', 1)
    monkeypatch.setattr('socialcircle_ros.circle.wide_windows._LEAST_TILES_PER_BAND', 1)

    masks = []
    for threads in (1, 2, 7):
        monkeypatch.setattr('socialcircle_ros.kernels.bands.limit', threads)
        masks.append(expand(xyz, (40, 70), np.float32(20.0), window))

    assert masks[0].sum() > 90 * 150 / 2
    np.testing.assert_array_equal(masks[0], masks[1])
    np.testing.assert_array_equal(masks[0], masks[2])


def spiral(side):
    """A corridor one point wide that winds from a corner to the middle; NaN is wall."""
    heights = np.full((side, side), np.nan)
    row, column, way = 0, 0, (0, 1)
    heights[0, 0] = 0.0
    for length in [side - 1, *[reach for reach in range(side - 1, 1, -2) for _ in range(2)]]:
        for _ in range(length):
            row, column = row + way[0], column + way[1]
            heights[row, column] = 0.0
        way = (way[1], -way[0])
    return heights, (row, column)


@pytest.mark.parametrize('side', [31, 131])
@pytest.mark.parametrize('mirrored', [False, True])
def test_a_spiral_is_followed_from_its_middle_to_its_end(side, mirrored):
    heights, middle = spiral(side)
    xyz = grid(heights)
    if mirrored:
        xyz, middle = xyz[:, ::-1], (middle[0], side - 1 - middle[1])

    joined = expand(xyz, middle, np.float64(1.5), 3)

    np.testing.assert_array_equal(joined, np.isfinite(xyz[..., 2]))
    assert joined.sum() > side


@pytest.mark.parametrize('upright', [False, True])
@pytest.mark.parametrize('end', [(0, 0), (130, 192)])
def test_a_corridor_that_turns_at_every_wall_is_followed_to_its_end(upright, end):
    heights = np.zeros((131, 193))
    if upright:
        heights[1:, 1::4], heights[:-1, 3::4] = np.nan, np.nan
    else:
        heights[1::4, 1:], heights[3::4, :-1] = np.nan, np.nan

    joined = expand(grid(heights), end, np.float64(1.5), 3)

    np.testing.assert_array_equal(joined, heights == 0.0)


@pytest.mark.parametrize('layout', LAYOUTS)
@pytest.mark.parametrize('dtype', ['float32', 'float64'])
def test_members_do_not_depend_on_the_layout_in_memory(layout, dtype):
    contiguous = Recipe(7, 133, dtype, 'noise', missing=0.2, random=3).cloud()
    limit = contiguous.dtype.type(6.0)
    seed = measured_points(contiguous)[400]

    joined = expand(laid_out(contiguous, layout), seed, limit, 3)

    np.testing.assert_array_equal(joined, naive.expand(contiguous, seed, limit, 3))


def test_nothing_behind_the_last_point_is_read():
    # A view that ends with the z of its last point, as x, y and z of the end of a message do.
    values = np.zeros(4 * 6 - 1, np.float32)
    values[::4] = np.arange(6)
    xyz = np.lib.stride_tricks.as_strided(values, (2, 3, 3), (48, 16, 4))

    assert expand(xyz, (0, 0), np.float32(100.0), 3).all()


def test_members_and_outliers_are_all_measured_points():
    xyz = Recipe(30, 150, 'float32', 'noise', spikes=0.2, missing=0.2, random=1).cloud()
    for window in (3, 5):
        members, outliers = divide(xyz, measured_points(xyz)[900], np.float32(5.0), window)

        assert not (members & outliers).any()
        np.testing.assert_array_equal(members | outliers, np.isfinite(xyz).all(axis=2))


# All windows


@pytest.mark.parametrize('surface', SURFACES)
@pytest.mark.parametrize('window', WINDOWS)
def test_seed_itself_is_always_a_member(surface, window):
    xyz = Recipe(6, 5, surface=surface).cloud()

    joined = expand(xyz, (3, 2), np.float64(0.0), window)

    assert joined[3, 2]
    assert joined.sum() == 1


def test_all_zero_heights_end_and_all_join():
    assert expand(flat(30, 40), (3, 4), FLAT_LIMIT, 3).all()


@pytest.mark.parametrize('height', [0.0, -0.0, -1.0, -1e9])
def test_points_at_or_below_height_zero_join(height):
    assert expand(grid(np.full((5, 6), height)), (2, 2), FLAT_LIMIT, 3).all()


def test_a_distance_equal_to_the_radius_is_outside():
    # Two pitches up and one along: exactly √5.
    heights = np.zeros((6, 8))
    heights[:, 4:] = 2.0

    joined = expand(grid(heights), (2, 1), FLAT_LIMIT, 3)

    assert joined[:, :4].all()
    assert not joined[:, 4:].any()


def test_a_distance_just_below_the_radius_is_inside():
    heights = np.zeros((6, 8))
    heights[:, 4:] = np.nextafter(2.0, 0.0)

    assert expand(grid(heights), (2, 1), FLAT_LIMIT, 3).all()


def test_members_chain_up_a_slope_far_beyond_the_radius():
    heights = np.tile(np.arange(50) * 1.9, (3, 1))

    assert expand(grid(heights), (1, 0), FLAT_LIMIT, 3).all()


def test_a_point_joins_over_a_diagonal():
    heights = np.full((4, 4), np.nan)
    heights[[0, 1, 2, 3], [3, 2, 1, 0]] = 0.0

    np.testing.assert_array_equal(expand(grid(heights), (3, 0), FLAT_LIMIT, 3), heights == 0.0)


def test_a_gap_wider_than_the_window_divides():
    xyz = flat(5, 9)
    xyz[:, 4] = np.nan

    joined = expand(xyz, (2, 2), np.float64(100.0), 3)

    assert joined[:, :4].all()
    assert not joined[:, 4:].any()


@pytest.mark.parametrize(('window', 'gap'), [(5, 1), (7, 2), (9, 3)])
def test_a_gap_within_the_window_does_not_divide(window, gap):
    xyz = flat(1, 21)
    xyz[0, 11 : 11 + gap] = np.nan

    joined = expand(xyz, (0, 10 - (window // 2) * 2), np.float64(100.0), window)

    assert joined[0, 11 + gap]
    assert not joined[0, 11 : 11 + gap].any()


def test_points_not_measured_never_join_even_in_an_infinite_circle():
    xyz = flat(4, 4)
    xyz[1, 1, 0], xyz[1, 2, 1], xyz[2, 1, 2] = np.nan, np.inf, -np.inf

    joined = expand(xyz, (0, 0), np.float64(np.inf), 3)

    np.testing.assert_array_equal(joined, np.isfinite(xyz).all(axis=2))


def test_window_does_not_wrap_round_the_border():
    xyz = flat(4, 6)
    xyz[:, 0] = np.nan
    xyz[:, 1] += 1e6  # reached from column 5 only if rows ran on

    joined = expand(xyz, (0, 5), FLAT_LIMIT, 3)

    assert joined[:, 2:].all()
    assert not joined[:, :2].any()


def test_window_5_joins_inside_the_window_lead_no_further():
    # The edge of the seed's window is lost on the right; the point before it is in, but is no initial point.
    xyz = flat(1, 9)
    xyz[0, 6] = np.nan

    joined = expand(xyz, (0, 4), np.float64(9.0), 5)

    np.testing.assert_array_equal(joined[0], [1, 1, 1, 1, 1, 1, 0, 0, 0])


def test_window_5_depends_on_the_order_in_which_points_join():
    # `first` and `second` are on the edge of the seed's window. Both see `shared`: inside the window of the
    # one, on the edge of the other's. Only from there `beyond` is seen.
    heights = np.full((13, 13), np.nan)
    seed, first, second, shared, beyond = (6, 6), (4, 6), (5, 8), (3, 7), (1, 7)
    for place in (seed, first, second, shared, beyond):
        heights[place] = 0.0
    xyz = grid(heights)
    limit = np.float64(1e3)

    joined = expand(xyz, seed, limit, 5)
    joined_upside_down = expand(xyz[::-1], seed, limit, 5)[::-1]

    assert joined[shared]
    assert not joined[beyond]
    assert joined_upside_down[beyond]


def test_distance_is_measured_in_the_cloud_s_own_dtype():
    # At 2^24 the next float32 is 2 away: an offset cloud is coarse, and so are its distances.
    xyz = flat(1, 4, 1.0, 'float32')
    xyz[..., 0] += np.float32(2**24)

    joined = expand(xyz, (0, 0), np.float32(4.0), 3)

    # 0, 1, 2, 3 became 0, 0, 2, 4.
    np.testing.assert_array_equal(joined[0], [True, True, False, False])
