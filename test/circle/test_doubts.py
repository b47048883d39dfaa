# SPDX-License-Identifier: Apache-2.0
"""What a result says of itself."""

from dataclasses import replace

import numpy as np
import pytest

from socialcircle_ros import CircleSettings, remove_outliers
from socialcircle_ros.circle import network
from socialcircle_ros.circle.adaptive import Islands, Sureness
from socialcircle_ros.circle.doubts import (
    doubts_of,
    kept_islands,
    notes_of_removed_islands,
    removed_islands,
    single_steps,
    unknown_texture,
)

PAPER, ADAPTIVE = CircleSettings(mode='paper'), CircleSettings()


def smooth(rows=90, columns=110, height=0.02):
    """A rough surface whose heights are far smaller than the pitch of 1."""
    return height * np.random.default_rng(5).normal(0, 1, (rows, columns))


def test_a_circle_that_exceeds_every_difference_is_named_with_what_helps():
    heights = smooth()
    heights[40:44, 50:54] += 1

    result = remove_outliers(heights, PAPER, pitch=(1.0, 1.0))

    assert not result.outliers.any()
    (warning,) = result.warnings
    assert warning.startswith('no point can be an outlier: the circle exceeds every height difference between')
    assert 'set circle.mode to adaptive, or lower circle.radius_scale' in warning
    assert remove_outliers(heights, pitch=(1.0, 1.0)).outliers[40:44, 50:54].all()


def test_a_few_larger_differences_do_not_hide_that_the_circle_is_too_large():
    heights = smooth(200, 210)
    heights[100, 60] = 2.5  # still within the radius of a diagonal neighbour
    found = doubts_of(heights, heights.size, 0, 2.4, PAPER)
    assert 'hardly a point can be an outlier' in found[0]
    assert 'exceeds all but 4 of the 83590 height differences' in found[0]


@pytest.mark.parametrize(('radius', 'warns'), [(0.1, False), (0.15, False), (1.0, True)])
def test_a_circle_of_the_size_of_the_roughness_gives_no_warning(radius, warns):
    assert bool(doubts_of(smooth(), 9900, 0, radius, PAPER)) == warns


def test_surfaces_with_holes_steps_and_planes():
    heights = smooth()
    heights[::2, ::3] = np.nan
    assert len(doubts_of(heights, 4000, 0, 1.0, PAPER)) == 1
    stairs = np.repeat(np.arange(60.0), 3)[:, None] + np.zeros((1, 90))
    assert doubts_of(stairs, stairs.size, 0, 0.5, PAPER) == ()
    assert doubts_of(np.full((30, 40), 7.0), 1200, 0, 1.0, PAPER) == ()
    assert doubts_of(np.full((1, 1), 7.0), 1, 0, 1.0, PAPER) == ()
    assert doubts_of(np.full((30, 40), np.nan), 0, 0, 1.0, PAPER) == ()


def test_coarse_steps_blind_the_adaptive_mode_with_a_warning():
    row, column = np.mgrid[:120, :150]
    heights = np.round(2 * np.sin(row / 15) * np.cos(column / 20))

    result = remove_outliers(heights, pitch=(1.0, 1.0))

    assert not result.outliers.any()
    assert 'the heights are stored in steps so coarse that neighbours differ by few of them' in result.warnings[0]
    assert remove_outliers(smooth(), pitch=(1.0, 1.0)).warnings == ()


def test_a_depth_of_field_in_another_unit_is_named():
    heights = smooth()
    heights[40, 50] = 1.0
    found = remove_outliers(heights, CircleSettings(depth_of_field=0.3), pitch=(1.0, 1.0))
    assert found.outliers.any()
    assert not any('depth of field' in warning for warning in found.warnings)
    found = remove_outliers(heights, CircleSettings(depth_of_field=1e5), pitch=(1.0, 1.0))
    assert not found.outliers.any()
    (sentence,) = (warning for warning in found.warnings if 'depth of field' in warning)
    assert sentence.startswith('no point can be an outlier: the depth of field, 100000, is ')
    assert sentence.endswith(' times the range of all heights; circle.depth_of_field is in the unit of the cloud.')


def test_a_clean_plane_within_its_depth_of_field_gives_no_warning():
    found = remove_outliers(smooth(), CircleSettings(depth_of_field=0.3), pitch=(1.0, 1.0))
    assert not found.outliers.any()
    assert not any('depth of field' in warning for warning in found.warnings)
    assert not remove_outliers(np.zeros((9, 9)), CircleSettings(depth_of_field=1.0), pitch=(1.0, 1.0)).warnings


def test_settings_without_effect_are_named():
    settings = CircleSettings(radius_scale=2.0, window=5)
    assert remove_outliers(smooth(), settings, pitch=(1.0, 1.0)).warnings == tuple(
        f'circle.{name} has no effect in the adaptive mode; set circle.mode to paper to use it.'
        for name in ('window', 'radius_scale')
    )


@pytest.mark.parametrize(
    ('settings', 'removed', 'sentences'),
    [
        (PAPER, 60, ['more than half of the points: the circle may have stayed']),
        (ADAPTIVE, 60, ['more than half of the points: they may be the surface', '60 % of the points']),
        (ADAPTIVE, 35, ['35 % of the points were removed']),
        (PAPER, 35, []),
    ],
)
def test_many_outliers_are_named(settings, removed, sentences):
    found = doubts_of(smooth(), 100 - removed, removed, 0.1, settings)
    assert len(found) == len(sentences)
    assert all(sentence in doubt for sentence, doubt in zip(sentences, found, strict=True))


def islands(height, smoothed=6):
    """A surface with irregular islands of its own."""
    hills = np.random.default_rng(2).normal(size=(150, 200))
    for _ in range(smoothed):
        hills = (2 * hills + sum(np.roll(hills, step, axis) for step in (1, -1) for axis in (0, 1))) / 6
    noise = np.random.default_rng(3).normal(size=hills.shape)
    return noise + height * np.maximum(hills / hills.std() - 1.2, 0)


def test_a_texture_that_resembles_outliers_is_named_with_the_cure():
    sentence = 'nearly as steep as outliers: good points may be among the removed ones; teach this texture'
    rich, rules = islands(10.0), CircleSettings(judge='rules')
    result = remove_outliers(rich, rules, pitch=(1.0, 2.0))
    assert result.outliers.mean() > 0.005
    assert any(sentence in warning for warning in result.warnings)
    optics = remove_outliers(rich, replace(rules, depth_of_field=1.0), pitch=(1.0, 2.0))
    assert not any(sentence in warning for warning in optics.warnings)
    assert remove_outliers(islands(0.0), rules, pitch=(1.0, 2.0)).warnings == ()


@pytest.mark.parametrize(
    ('sureness', 'removed', 'said'),
    [
        ([(0.004, 0.0)], 0, None),
        ([(0.02, 0.0)], 0, 'undecided about 2.0 % of the points, more than the 0.0 %'),
        ([(0.02, 0.01)], 90, 'undecided about 2.0 % of the points, more than the 1.0 %'),
        ([(0.02, 0.01)], 0, 'undecided about 2.0 % of the points, more'),
        ([(0.02, 0.03)], 90, None),
        ([(0.02, 0.03), (0.011, 0.002)], 90, 'undecided about 1.1 % of the points, single ones aside, more'),
        ([(0.02, 0.03), (0.011, 0.012)], 90, None),
        ([(0.02, 0.03), (0.004, 0.002)], 90, None),
    ],
)
def test_a_texture_that_the_network_does_not_know_is_named_with_the_cure(sureness, removed, said):
    found = unknown_texture([Sureness(*each) for each in sureness], removed)
    assert bool(found) == bool(said)
    for each in found:
        assert said in each
        assert 'outliers may have stayed' in each
        assert ('good points may be among the removed ones' in each) == (removed > 0)
        assert 'socialcircle teach' in each


@pytest.mark.parametrize('singles', [0.0, 0.005, 0.01, 0.02])
def test_single_outliers_do_not_silence_the_warning_of_a_texture(singles):
    random = np.random.default_rng(8)
    heights = islands(8.0, smoothed=20)
    outliers = random.random(heights.shape) < singles
    heights[outliers] += random.choice([-1, 1], outliers.sum()) * random.uniform(60, 300, outliers.sum())
    result = remove_outliers(heights.astype(np.float32), pitch=(1.0, 2.0))
    assert any('the network is undecided' in warning for warning in result.warnings)


@pytest.mark.parametrize(('probability', 'warns'), [(0, False), (100, True)])
def test_the_result_warns_where_the_network_is_undecided(probability, warns, monkeypatch):
    class Undecided:
        def probabilities(self, heights):
            found = np.zeros(heights.shape, np.uint8)
            found[:10] = probability
            return found

    monkeypatch.setattr(network, 'packaged_network', lambda provider: Undecided())
    result = remove_outliers(smooth(), CircleSettings(judge='network'), pitch=(1.0, 2.0))
    assert any('the network is undecided' in warning for warning in result.warnings) == warns


@pytest.mark.parametrize(
    'noise',
    [
        lambda random: random.exponential(1.0, (200, 300)),
        lambda random: random.normal(size=(200, 300)) ** 2,
        lambda random: np.exp(random.normal(0, 0.6, (200, 300))),
    ],
)
def test_the_result_warns_of_skewed_noise_however_much_of_it_falls(noise):
    heights = noise(np.random.default_rng(8)).astype(np.float32)
    result = remove_outliers(heights, CircleSettings(judge='network'), pitch=(1.0, 2.0))
    assert result.outliers.mean() > 0.05  # good points
    assert any('the network is undecided' in warning for warning in result.warnings)


def test_outliers_on_a_plain_surface_are_no_texture():
    heights = np.random.default_rng(4).normal(size=(150, 200))
    heights[5::10, 7::10] += 30
    for row in range(12, 130, 24):
        heights[row : row + 5, 40:46] -= 20
    result = remove_outliers(heights, pitch=(1.0, 2.0))
    assert result.outliers.mean() > 0.01
    assert result.warnings == ()


def test_single_points_of_one_height_are_told_as_noise_of_stored_steps():
    noise = np.random.default_rng(1).normal(size=(150, 200))
    stored = np.round(0.25 * noise) * 3e-6 + 1e-6 * np.arange(200)
    (warning,) = remove_outliers(stored, pitch=(1.0, 2.0)).warnings
    assert 'most single outliers differ from their neighbours by one height, 3e-06 in the unit' in warning
    spikes = np.random.default_rng(2).random(noise.shape) < 0.02
    for rise in (np.random.default_rng(3).uniform(20, 60, noise.shape), 30, 1e4):
        for slope in (0.0, 0.2):
            heights = noise + rise * spikes + slope * np.arange(200)
            assert remove_outliers(heights, pitch=(1.0, 2.0)).warnings == ()


@pytest.mark.parametrize('tilt', [(0.37, 0.11), (0.05, 0.0), (0.003, 0.0)])
@pytest.mark.parametrize('noise', [0.3, 0.35, 0.5, 0.7, 1.0])
@pytest.mark.parametrize('judge', ['network', 'rules'])
def test_heights_that_were_stored_in_steps_and_then_levelled_lose_no_good_points(tilt, noise, judge):
    y, x = np.indices((150, 200))
    heights = np.round(np.random.default_rng(1).normal(0, noise, x.shape)) + tilt[0] * x + tilt[1] * y
    result = remove_outliers(heights, CircleSettings(judge=judge), pitch=(1.0, 2.0))
    assert result.outliers.mean() < 1e-3


NONE, ONE, MANY = Islands(0, 0, 0), Islands(1, 90, 90), Islands(5, 700, 200)


def test_islands_that_were_kept_are_named_and_narrow_decisions_said():
    assert kept_islands(0, narrowly=False) == []
    (sure,), (narrow,) = kept_islands(9, narrowly=False), kept_islands(9, narrowly=True)
    assert sure.startswith(
        '9 islands of one height were kept as the texture of the surface; this mode cannot tell'
    )
    assert 'kept as the texture of the surface, narrowly: with a few points more or less' in narrow


@pytest.mark.parametrize(
    ('alike', 'parts', 'warning', 'note'),
    [
        (NONE, NONE, None, None),
        (MANY, NONE, '5 islands (700 points, the largest has 200) of one height were removed; if', None),
        (MANY, MANY, '5 islands (700 points, the largest has 200) of one height were removed', None),
        (MANY, ONE, '5 islands (700 points, the largest has 200) of one height were removed', None),
        (NONE, MANY, 'far off a plain surface were removed, though the network takes them for parts of it', None),
        (NONE, ONE, None, '1 island of 90 points far off a plain surface was removed, though the'),
        (NONE, Islands(2, 150, 80), None, '2 islands (150 points, the largest has 80) far off a plain'),
    ],
)  # fmt: skip
def test_removed_islands_that_may_be_parts_are_named(alike, parts, warning, note):
    warnings, notes = removed_islands(alike, parts), notes_of_removed_islands(alike, parts)
    assert [warning in said for said in warnings] == [True] * (warning is not None)
    assert [note in said for said in notes] == [True] * (note is not None)
    assert all('socialcircle teach' in said for said in warnings)


def plate_with_pins(number, judge, side=9):
    """A plate with square pins of one height, and what becomes of it."""
    heights = np.random.default_rng(0).normal(0, 0.02, (150, 210))
    for pin in range(number):
        row, column = 15 + 40 * (pin // 4), 20 + 45 * (pin % 4)
        heights[row : row + side, column : column + side] += 5
    return remove_outliers(heights.astype(np.float32), CircleSettings(judge=judge), pitch=(1.0, 1.0))


@pytest.mark.parametrize('judge', ['network', 'rules'])
@pytest.mark.parametrize('number', [4, 5, 6, 7])
def test_pins_are_not_removed_in_silence(number, judge):
    result = plate_with_pins(number, judge)
    assert np.count_nonzero(result.outliers) >= 81 * number
    (warning,) = result.warnings
    assert warning.startswith(f'{number} islands ({np.count_nonzero(result.outliers)} points')


def test_two_pins_are_noted_where_the_network_takes_them_for_parts():
    result = plate_with_pins(2, 'network', side=16)
    assert np.count_nonzero(result.outliers) == 512
    assert result.warnings == ()
    (note,) = result.notes
    assert note.startswith(
        '2 islands (512 points, the largest has 256) far off a plain surface were removed, though'
    )


@pytest.mark.parametrize(('number', 'warns'), [(2, False), (3, True)])
def test_three_islands_that_the_network_takes_for_parts_are_a_warning(number, warns):
    parts = Islands(number, 100 * number, 100)
    assert (bool(removed_islands(NONE, parts)), bool(notes_of_removed_islands(NONE, parts))) == (warns, not warns)


@pytest.mark.parametrize(('ratio', 'warns'), [(9, False), (11, True)])
def test_a_depth_of_field_of_ten_times_the_range_of_all_heights_is_doubted(ratio, warns):
    heights = np.linspace(0, 2, 12).reshape(3, 4)
    found = doubts_of(heights, heights.size, 0, 1.0, CircleSettings(depth_of_field=2.0 * ratio))
    assert [f'the depth of field, {2 * ratio}, is {ratio} times the range' in each for each in found] == [
        True
    ] * warns


@pytest.mark.parametrize(('ratio', 'warns'), [(9, False), (11, True)])
def test_a_circle_of_ten_median_differences_is_doubted(ratio, warns):
    heights = np.tile([0.0, 2.0], (8, 8))
    assert bool(doubts_of(heights, heights.size, 0, 2.0 * ratio, PAPER)) == warns


def test_differences_between_rows_that_are_compared_apart_are_counted():
    heights = np.zeros((512, 64))
    heights[256:] = 9  # 256 rows are compared at once
    (sentence,) = doubts_of(heights, heights.size, 0, 1.0, PAPER)
    assert 'exceeds all but 64 of the 64960 height differences' in sentence


@pytest.mark.parametrize(
    ('number', 'alike', 'warns'),
    [(200, 1.0, True), (40, 1.0, False), (200, 0.8, True), (200, 0.6, False)],
    ids=['many', 'fewer than two in a thousand', 'eight in ten are alike', 'six in ten are alike'],
)
def test_single_outliers_are_doubted_where_many_of_them_have_one_height(number, alike, warns):
    heights, places, rises = np.zeros((300, 300)), 3 + 441 * np.arange(number), np.arange(5.0, 5 + number)
    rises[: round(alike * number)] = 5
    heights.flat[places] = rises
    assert bool(single_steps(heights, heights > 0)) == warns
