# SPDX-License-Identifier: Apache-2.0
"""Simulated surfaces, varied real ones, and the patches made of them."""

import numpy as np
import pytest

pytest.importorskip('scipy')
from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.studies.learned import corpus
from socialcircle_ros.studies.learned.corpus import make_patch
from socialcircle_ros.studies.learned.measured import TrainingSurface, training_surfaces, varied
from socialcircle_ros.studies.learned.random_fields import fractal, smooth_noise
from socialcircle_ros.studies.learned.simulated import KINDS, simulated_surface, with_holes


@pytest.mark.parametrize('kind', sorted(set(KINDS), key=lambda kind: kind.__name__))
def test_each_kind_of_surface_has_heights_everywhere(kind):
    grid = tuple(np.mgrid[:40, :40].astype(np.float64))
    for seed in range(12):
        heights = kind(grid, 5.0, np.random.default_rng(seed))
        assert heights.shape == (40, 40)
        assert np.isfinite(heights).all()


def test_a_simulated_surface_depends_on_the_seed_alone():
    first, second = (simulated_surface(60, np.random.default_rng(5)) for _ in range(2))
    assert np.array_equal(first, second, equal_nan=True)


def real(height, width, name='real'):
    heights = np.random.default_rng(1).normal(size=(height, width))
    return TrainingSurface(name, heights, np.ones((height, width), bool), 1.0)


@pytest.mark.parametrize('shape', [(30, 40), (400, 500)])
def test_a_varied_surface_fits_into_the_side(shape):
    for seed in range(8):
        heights, plausible = varied(real(*shape), 64, np.random.default_rng(seed))
        assert heights.shape == plausible.shape
        assert max(heights.shape) <= 64


def test_a_patch_counts_measured_points_alone(monkeypatch):
    monkeypatch.setattr(corpus, 'SIDE', 64)
    kinds = set()
    for seed in range(40):
        made = make_patch([real(50, 70)], np.random.default_rng(seed))
        patch, (height, width) = made.patch, made.shape
        kinds.add(made.real)
        assert patch.shape == (corpus.PLANES, 64, 64)
        assert not patch[-1][patch[5] == 0].any()
        assert not patch[:, height:].any()
        assert not patch[..., width:].any()
        assert np.isfinite(patch).all()
        assert np.isfinite(made.grain)
    assert kinds == {True, False}
    assert not make_patch([], np.random.default_rng(1)).real


def test_where_points_are_left_out_outliers_are_as_far_off_as_elsewhere(monkeypatch):
    """The noise is that of the whole surface: sparse points have no neighbours to tell it."""
    monkeypatch.setattr(corpus, 'SIDE', 96)
    monkeypatch.setattr(corpus, '_HOLED_REAL', 1.0)
    monkeypatch.setattr(corpus, 'REAL_SHARE', 1.0)
    monkeypatch.setattr(corpus, '_WHOLE', 1.0)
    tilted = real(96, 96)
    tilted.heights[:] = 1e-3 * tilted.heights + 0.02 * np.arange(96)
    noises = []
    place = corpus.place_outliers
    monkeypatch.setattr(
        corpus, 'varied', lambda surface, side, random: (surface.heights.copy(), surface.plausible)
    )
    monkeypatch.setattr(corpus, 'place_outliers', lambda heights, noise, *rest: (
        noises.append(noise), place(heights, noise, *rest))[1])  # fmt: skip
    for seed in range(25):
        make_patch([tilted], np.random.default_rng(seed))
    assert min(noises) == max(noises) == pytest.approx(1e-3, rel=0.2)


@pytest.mark.parametrize('shape', [(8, 11), (32, 20), (320, 240)])
@pytest.mark.parametrize('field', [lambda shape, random: smooth_noise(shape, 25.0, random),
                                   lambda shape, random: fractal(shape, 1.0, random)])  # fmt: skip
def test_a_random_field_has_mean_0_and_deviation_1_however_small_it_is(shape, field):
    for seed in range(5):
        made = field(shape, np.random.default_rng(seed))
        assert made.mean() == pytest.approx(0, abs=1e-6)
        assert made.std() == pytest.approx(1, abs=1e-6)


def test_a_small_surface_is_as_high_as_a_large_one():
    highest = [
        np.nanmax(np.abs(simulated_surface(side, np.random.default_rng(seed))))
        for side in (12, 40)
        for seed in range(60)
    ]
    assert max(highest) < 1e5


def test_points_are_left_out_in_many_ways_but_never_all():
    heights = np.arange(60.0 * 80).reshape(60, 80)
    shares = []
    for seed in range(60):
        left = with_holes(heights, np.random.default_rng(seed))
        measured = np.isfinite(left)
        assert np.array_equal(left[measured], heights[measured])
        shares.append(measured.mean())
    assert min(shares) > 0.1
    assert max(shares) > 0.9
    assert np.mean(np.array(shares) < 0.6) > 0.1


def test_a_folder_of_another_recipe_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(corpus, 'SHARD', 1)
    corpus.make_corpus(tmp_path, [], [3], lambda step: None)
    corpus.make_corpus(tmp_path, [], [3], lambda step: None)
    monkeypatch.setattr(corpus, 'RECIPE', 'another')
    with pytest.raises(SocialCircleError, match='by another version'):
        corpus.make_corpus(tmp_path, [], [3], lambda step: None)


def test_surfaces_are_left_out_by_the_beginning_of_their_name():
    class Cloud:
        def __init__(self, name):
            self.name, self.points = name, np.zeros((4, 5, 3), np.float32)

    class Surface:
        def __init__(self, name):
            self.cloud, self.plausible = Cloud(name), np.ones((4, 5), bool)

    chosen = training_surfaces([Surface(name) for name in ('afm_a', 'afm_b', 'wyko')], ['afm'])
    assert [each.name for each in chosen] == ['wyko']
