"""The vote (section 3.2.1): the region T, the scores M, the seed."""

import math

import numpy as np
import pytest
from clouds import Recipe, flat, grid, measured_points, recipes
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from naive import circle as naive

from socialcircle_ros.circle import medians, votes
from socialcircle_ros.circle.region import choose_region
from socialcircle_ros.circle.seed import elect_seed
from socialcircle_ros.circle.votes import vote_scores
from socialcircle_ros.errors import NoSeedError

PEAK = 1 / math.sqrt(2 * math.pi)


def on_a_line(*places):
    """A cloud of one row with its points at these x, y = z = 0."""
    return np.array([[[x, 0.0, 0.0] for x in places]])


# Scores


@settings(max_examples=900, deadline=None)
@given(recipes(14, 14))
@example(Recipe(5, 6, surface='coincident', layout='padded'))
@example(Recipe(5, 6, surface='noise', unit='huge'))
@example(Recipe(5, 6, surface='noise', unit='tiny'))
def test_scores_are_those_of_the_reference_bit_for_bit(recipe):
    xyz = recipe.cloud()

    scores = vote_scores(xyz)

    assert scores.dtype == np.float64
    assert scores.shape == xyz.shape[:2]
    np.testing.assert_array_equal(scores, naive.vote_scores(xyz))


@settings(max_examples=10, deadline=None)
@given(recipes(40, 40))
def test_scores_of_larger_regions_are_those_of_the_reference_bit_for_bit(recipe):
    xyz = recipe.cloud()

    np.testing.assert_array_equal(vote_scores(xyz), naive.vote_scores(xyz))


def test_score_is_the_sum_of_received_votes():
    # With two others mu is the mean of both distances: 2 for the point at 0, 1.5 at 1, 2.5 at 3.
    scores = vote_scores(on_a_line(0.0, 1.0, 3.0))

    expected = [
        math.exp(-((1 / 1.5) ** 2) / 2) + math.exp(-((3 / 2.5) ** 2) / 2),
        math.exp(-((1 / 2.0) ** 2) / 2) + math.exp(-((2 / 2.5) ** 2) / 2),
        math.exp(-((3 / 2.0) ** 2) / 2) + math.exp(-((2 / 1.5) ** 2) / 2),
    ]
    np.testing.assert_allclose(scores[0], np.multiply(expected, PEAK), rtol=1e-14)


def test_received_votes_decide_and_not_given_ones():
    # The votes that each point gives sum to 1.207, 1.212, 1.213: they would elect the far point.
    assert elect_seed(on_a_line(0.0, 1.0, 3.0), (0, 0, 1, 3)) == (0, 1)


def test_median_of_an_odd_number_of_distances_is_the_middle_one():
    scores = vote_scores(on_a_line(0.0, 1.0, 3.0, 9.0))

    # Each voter's distances to the others are sorted; the point at 9 hears from 0, 1 and 3.
    mu = {0: sorted([1, 3, 9])[1], 1: sorted([1, 2, 8])[1], 3: sorted([3, 2, 6])[1]}
    expected = sum(math.exp(-(((9 - place) / mu[place]) ** 2) / 2) for place in mu)
    assert scores[0, 3] == pytest.approx(PEAK * expected, rel=1e-14)


def test_median_of_an_even_number_of_distances_is_the_mean_of_both_middle_distances():
    scores = vote_scores(on_a_line(0.0, 1.0, 3.0, 9.0, 27.0))

    mu = {0: (3 + 9) / 2, 1: (2 + 8) / 2, 3: (3 + 6) / 2, 9: (8 + 9) / 2}
    expected = sum(math.exp(-(((27 - place) / mu[place]) ** 2) / 2) for place in mu)
    assert scores[0, 4] == pytest.approx(PEAK * expected, rel=1e-14)


def test_points_not_measured_have_no_score_and_no_vote():
    xyz = on_a_line(0.0, 1.0, 3.0)
    with_gaps = np.full((3, 3, 3), 5.0)
    with_gaps[0], with_gaps[1], with_gaps[2] = xyz[0, 0], xyz[0, 1], xyz[0, 2]
    with_gaps[:, 0, 0], with_gaps[:, 2, 2] = np.nan, -np.inf

    scores = vote_scores(with_gaps)

    np.testing.assert_array_equal(scores[:, 1], vote_scores(xyz)[0])
    assert np.isnan(scores[:, [0, 2]]).all()


def test_region_without_a_measured_point_has_no_scores():
    assert np.isnan(vote_scores(np.full((2, 3, 3), np.nan))).all()


def test_lone_point_has_score_zero():
    np.testing.assert_array_equal(vote_scores(on_a_line(np.nan, 4.0)), [[np.nan, 0.0]])


def test_coincident_points_give_each_other_the_full_vote_and_others_none():
    # Three of four at one place: their mu is 0.
    scores = vote_scores(on_a_line(2.0, 2.0, 7.0, 2.0))[0]

    assert scores[2] == 0.0
    distant = PEAK * math.exp(-1 / 2)
    np.testing.assert_allclose(scores[[0, 1, 3]], 2 * PEAK + distant, rtol=1e-14)


def test_vote_over_an_infinite_distance_is_zero():
    scores = vote_scores(on_a_line(0.0, 1.0, 2.0, 1e200))[0]

    assert scores[3] == 0.0
    assert (scores[:3] > 0).all()


# Seed


@st.composite
def recipe_and_region(draw):
    """A recipe and a vote region wholly inside its cloud."""
    recipe = draw(recipes())
    row, column = draw(st.integers(0, recipe.rows - 1)), draw(st.integers(0, recipe.columns - 1))
    height = draw(st.integers(1, min(12, recipe.rows - row)))
    width = draw(st.integers(1, min(12, recipe.columns - column)))
    return recipe, (row, column, height, width)


@settings(max_examples=500, deadline=None)
@given(recipe_and_region())
def test_seed_is_that_of_the_reference(drawn):
    recipe, region = drawn
    xyz = recipe.cloud()
    try:
        expected = naive.elect_seed(xyz, region)
    except NoSeedError:
        with pytest.raises(NoSeedError, match='measured'):
            elect_seed(xyz, region)
    else:
        assert elect_seed(xyz, region) == expected


def test_seed_is_given_in_the_coordinates_of_the_cloud():
    heights = np.full((9, 11), np.nan)
    heights[6, 7] = 0.0

    assert elect_seed(grid(heights), (4, 5, 3, 4)) == (6, 7)


def test_first_of_equal_scores_in_row_order_wins():
    assert elect_seed(flat(1, 2), (0, 0, 1, 2)) == (0, 0)
    assert elect_seed(flat(2, 1), (0, 0, 2, 1)) == (0, 0)
    assert elect_seed(np.zeros((3, 4, 3)), (1, 1, 2, 3)) == (1, 1)


def test_seed_lies_on_the_surface_under_heavy_contamination():
    generator = np.random.default_rng(4)
    heights = np.zeros((20, 20))
    outlier = generator.random(heights.shape) < 0.4
    heights[outlier] = generator.uniform(15, 60, heights.shape)[outlier]

    seed = elect_seed(grid(heights), (0, 0, 20, 20))

    assert not outlier[seed]


# The shortcuts to the seed: medians without sorting, and few scores.


def sheet(rows, columns, seed=0):
    """x, y and z of a noisy surface, each (n,), and the generator."""
    generator = np.random.default_rng(seed)
    y, x = (axis.ravel() for axis in np.mgrid[:rows, :columns].astype(float))
    return x, y, generator.normal(0, 0.1, x.size), generator


def adversaries():
    """Point sets by name, (3, n): what would break a wrong bound or a rank one off."""
    for rows, columns in ((1, 2), (1, 3), (4, 8), (3, 11), (5, 13), (23, 29), (34, 34)):
        x, y, z, generator = sheet(rows, columns)
        n = x.size
        far = generator.random(n) < 0.1
        named = {
            'flat': (x, y, 0 * z),
            'noisy': (x, y, z),
            'far from the origin': (x + 1e6, y - 1e7, z + 3),
            'lost in the offset': (x + 1e16, y - 1e17, z),
            'heights far above the pitch': (x, y, z * 1e7),
            'heights far below the pitch': (x, y, z * 1e-12),
            'quantized': (x, y, np.round(10 * z)),
            'all at one place': (0 * x, 0 * y, 0 * z),
            'groups at one place': (np.floor(x / 7), np.floor(y / 7), 0 * z),
            'on a line': (generator.random(n), 0 * y, 0 * z),
            'a ball': tuple(generator.normal(0, 1, (3, n))),
            'heavy tails': tuple(generator.standard_cauchy((3, n))),
            'every scale': (2.0 ** np.linspace(-300, 300, n), 2.0 ** np.linspace(300, -300, n), z),
            'two places': (np.where(far, 1e5, 0.0) + 1e-9 * x, y, z),
            'subnormal squares': (x * 1e-161, y * 1e-161, z * 1e-161),
            'infinite distances': (x * 1e153, y * 1e153, z),
            'one infinitely far': (np.where(np.arange(n) == n // 2, 1e200, x), y, z),
        }
        for height in (5.0, 50.0, 1e4, 1e9, 1e15):
            heights = np.where(far, generator.uniform(-height, height, n), z)
            named[f'outliers up to {height:g}'] = (x, y, heights)
        for name, points in named.items():
            yield pytest.param(np.array(points), id=f'{name} {rows}×{columns}')


def sorted_medians(points):
    """mu of each point, by sorting its distances to the others."""
    mu = []
    for p in range(points.shape[1]):
        dx, dy, dz = np.delete(points, p, axis=1) - points[:, p, None]
        distances = np.sort(np.sqrt((dx * dx + dy * dy) + dz * dz))
        middle = len(distances) // 2
        odd = len(distances) % 2
        mu.append(distances[middle] if odd else (distances[middle - 1] + distances[middle]) / 2)
    return np.array(mu)


@pytest.mark.parametrize('points', list(adversaries()))
def test_medians_and_the_winner_are_those_of_brute_force(points):
    with np.errstate(over='ignore', under='ignore'):
        expected = sorted_medians(points)

        np.testing.assert_array_equal(medians.median_distances(points), expected)
        scores = vote_scores(points.T[None])
        assert elect_seed(points.T[None], (0, 0, 1, points.shape[1])) == (0, np.argmax(scores))


def test_medians_among_more_leaves_than_a_word_has_bits_are_those_of_brute_force():
    x, y, z, generator = sheet(50, 61)
    z[generator.random(z.size) < 0.1] += 30

    np.testing.assert_array_equal(
        medians.median_distances(np.array((x, y, z))), sorted_medians(np.array((x, y, z)))
    )


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 200), st.integers(0, 2**16), st.integers(0, 4), st.integers(0, 4))
def test_chosen_leaves_are_all_that_may_reach_between_the_bounds(count, random, low, span):
    generator = np.random.default_rng(random)
    least = generator.integers(0, 6, 264).astype(np.float32)  # what is behind the last leaf is chosen by nobody
    most = least + generator.integers(0, 3, 264).astype(np.float32)
    sizes, chosen = generator.integers(1, 33, 264), np.empty(264, np.int64)
    high = low + span

    below, m = medians._choose(least, most, sizes, count, np.float32(low), np.float32(high), chosen)

    least, most, sizes = least[:count], most[:count], sizes[:count]
    assert below == sizes[most < low].sum()
    assert chosen[:m].tolist() == np.flatnonzero((most >= low) & (least <= high)).tolist()


def test_medians_do_not_depend_on_the_number_of_threads(monkeypatch):
    x, y, z, generator = sheet(50, 60)
    z[generator.random(z.size) < 0.1] += 30
    monkeypatch.setattr(medians, '_LEAST_POINTS_PER_BAND', 1)

    found = []
    for threads in (1, 2, 7):
        monkeypatch.setattr('socialcircle_ros.kernels.bands.limit', threads)
        found.append(medians.median_distances(np.array((x, y, z))))

    np.testing.assert_array_equal(found[0], found[1])
    np.testing.assert_array_equal(found[0], found[2])


@settings(max_examples=40, deadline=None)
@given(recipes(40, 60, least_rows=20, least_columns=30))
def test_seed_of_a_larger_region_has_the_highest_score(recipe):
    xyz = recipe.cloud()
    assume(measured_points(xyz))

    row, column = elect_seed(xyz, (0, 0, *xyz.shape[:2]))

    scores = vote_scores(xyz)
    assert row * xyz.shape[1] + column == np.nanargmax(scores)


@pytest.mark.parametrize('side', [59, 60])
@pytest.mark.parametrize('offset', [0.0, 1e5])
def test_seed_of_a_symmetric_region_is_the_first_highest_to_the_last_bit(side, offset):
    # Four points in the middle have the same score but for rounding.
    xyz = grid(np.zeros((side, side)))
    xyz[..., 0] += offset

    assert elect_seed(xyz, (0, 0, side, side)) == divmod(int(np.argmax(vote_scores(xyz))), side)


def test_estimated_scores_are_right_within_the_margin_and_bound_the_others():
    x, y, z, generator = sheet(40, 40)
    z[generator.random(z.size) < 0.2] += 30
    mu = medians.median_distances(np.array((x, y, z)))
    exact = (
        votes._scores(np.array((x, y, z)), mu, np.arange(x.size)) / PEAK + 1
    )  # with each point's vote for itself

    estimates, margin = votes._estimate_scores(np.array((x, y, z)), mu)

    asked = np.isfinite(estimates)
    assert asked.sum() < x.size / 4
    np.testing.assert_allclose(estimates[asked], exact[asked], rtol=0, atol=1e-7 * x.size)
    assert (exact[~asked] < estimates.max() - margin).all()


# Region


def chosen_by(choose, xyz):
    """The region, or that there is none."""
    try:
        return choose(xyz)
    except NoSeedError:
        return 'no seed'


@settings(max_examples=100, deadline=None)
@given(recipes(150, 150))
def test_chosen_region_is_that_of_the_reference(recipe):
    xyz = recipe.cloud()

    assert chosen_by(choose_region, xyz) == chosen_by(naive.choose_region, xyz)


@settings(max_examples=60, deadline=None)
@given(recipes(150, 150), st.integers(2, 5))
def test_chosen_region_does_not_depend_on_the_number_of_threads(recipe, threads):
    xyz = recipe.cloud()
    expected = chosen_by(choose_region, xyz)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr('socialcircle_ros.kernels.bands._LEAST', 1)
        patch.setattr('socialcircle_ros.kernels.bands.limit', threads)

        assert chosen_by(choose_region, xyz) == expected


@st.composite
def bands(draw):
    """Narrow clouds with more than 64 candidates along columns or along rows, measured well or not."""
    recipe = Recipe(
        rows=draw(st.integers(1, 3)),
        columns=draw(st.integers(1980, 4500)),
        surface='noise',
        missing=draw(st.sampled_from([0.0, 0.02, 0.05, 0.5])),
        random=draw(st.integers(0, 2**16)),
    )
    xyz = recipe.cloud()
    return xyz.transpose(1, 0, 2) if draw(st.booleans()) else xyz


@settings(max_examples=60, deadline=None)
@given(bands())
def test_chosen_region_among_more_than_64_candidates_is_that_of_the_reference(xyz):
    assert choose_region(xyz) == naive.choose_region(xyz)


def test_of_more_than_64_candidates_64_are_looked_at():
    # 100 candidates, each smoother than the one before; the last of the 64 is 63 × 100 // 64 = 98.
    length = 60 + 99 * 30
    heights = -((length - np.arange(float(length))) ** 3)

    assert choose_region(grid([heights])) == (0, 98 * 30, 1, 60)
    assert choose_region(grid(heights[:, None])) == (98 * 30, 0, 60, 1)


def test_the_only_measured_region_is_found_among_many_candidates():
    heights = np.full(60 + 99 * 30, np.nan)
    heights[60:120] = 0.0  # the third of 100 candidates, which is none of the 64 that are looked at first

    assert choose_region(grid([heights])) == (0, 60, 1, 60)
    assert choose_region(grid(heights[:, None])) == (60, 0, 60, 1)


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 4), st.integers(0, 2**16))
def test_first_of_equally_rough_regions_is_chosen_to_the_last_bit(rows, random):
    # The second half is the mirror image of the first: the same differences, read from the other end.
    half = np.random.default_rng(random).normal(0, 1, (rows, 60))
    xyz = grid(np.concatenate([half, half[:, ::-1]], axis=1))

    region = choose_region(xyz)

    assert region == naive.choose_region(xyz)
    assert region in {(0, 0, rows, 60), (0, 30, rows, 60)}


@pytest.mark.parametrize(
    ('shape', 'region'),
    [((1, 1), (0, 0, 1, 1)), ((60, 60), (0, 0, 60, 60)), ((7, 90), (0, 0, 7, 60)), ((61, 5), (0, 0, 60, 5))],
)
def test_first_region_of_a_flat_cloud_is_chosen_and_never_reaches_out_of_it(shape, region):
    assert choose_region(flat(*shape)) == region


@pytest.mark.parametrize('length', [61, 89, 90, 91, 121, 300])
def test_the_last_possible_region_is_a_candidate(length):
    # Second differences fall from left to right, so that the last region is the smoothest.
    heights = -((length - np.arange(float(length))) ** 3)

    assert choose_region(grid([heights])) == (0, length - 60, 1, 60)
    assert choose_region(grid(heights[:, None])) == (length - 60, 0, 60, 1)


def test_smoother_region_is_preferred():
    heights = np.random.default_rng(0).normal(0, 1, (60, 180))
    heights[:, 90:150] = 0.0

    assert choose_region(grid(heights)) == (0, 90, 60, 60)


def test_tilt_is_not_roughness():
    heights = np.tile(np.arange(120.0) * 3, (60, 1))
    heights[:, :60] = np.random.default_rng(0).normal(0, 0.01, (60, 60))

    assert choose_region(grid(heights)) == (0, 60, 60, 60)


def test_smooth_region_that_is_measured_less_than_95_percent_of_the_best_is_left():
    heights = np.random.default_rng(0).normal(0, 1, (60, 120))
    heights[:, 60:] = 0.0
    heights[:, 116:] = np.nan  # 93 % of the last region remain

    assert choose_region(grid(heights)) != (0, 60, 60, 60)


def test_region_that_is_measured_exactly_95_percent_of_the_best_is_a_candidate():
    heights = np.random.default_rng(0).normal(0, 1, (60, 120))
    heights[:, 60:] = 0.0
    heights[:, 117:] = np.nan

    assert choose_region(grid(heights)) == (0, 60, 60, 60)


@pytest.mark.parametrize(('lost', 'column'), [(3, 60), (4, 30)])
def test_95_percent_are_not_rounded_to_whole_points(lost, column):
    # The best have 59 points, 95 % of which are 56.05; the last and smoothest has 57 or 56.
    heights = -((120 - np.arange(120.0)) ** 3)
    heights[45] = np.nan
    heights[120 - lost :] = np.nan

    assert choose_region(grid([heights])) == (0, column, 1, 60)


def test_region_without_three_points_in_a_row_is_the_roughest():
    # The first 60 columns have every second point of a chessboard, all else is rough.
    heights = np.random.default_rng(0).normal(0, 1e3, (4, 120))
    row, column = np.indices(heights.shape)
    heights[(row + column) % 2 == 1] = np.nan
    heights[2, 100:103] = [0.0, 1e6, 0.0]

    assert choose_region(grid(heights)) == (0, 60, 4, 60)


def test_nothing_measured_has_no_region():
    with pytest.raises(NoSeedError, match='measured'):
        choose_region(np.full((3, 4, 3), np.nan))


def test_points_are_not_measured_if_any_coordinate_is_not_finite():
    for coordinate in range(3):
        for value in (np.nan, np.inf, -np.inf):
            xyz = flat(1, 2)
            xyz[0, 0, coordinate] = value
            assert elect_seed(xyz, (0, 0, 1, 2)) == (0, 1)


def test_the_cloud_is_read_only_to_the_vote():
    for recipe in (Recipe(9, 8, layout='read_only'), Recipe(9, 8, dtype='float32', layout='padded')):
        xyz = recipe.cloud()
        before = xyz.tobytes()
        vote_scores(xyz)
        choose_region(xyz)
        elect_seed(xyz, (0, 0, 9, 8))
        assert xyz.tobytes() == before
        assert len(measured_points(xyz)) == 72
