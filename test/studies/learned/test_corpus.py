# SPDX-License-Identifier: Apache-2.0
"""Simulated surfaces, varied real ones, and the patches made of them."""

import numpy as np
import pytest

pytest.importorskip('scipy')
from socialcircle_ros.studies.learned import corpus
from socialcircle_ros.studies.learned.corpus import make_patch
from socialcircle_ros.studies.learned.measured import TrainingSurface, training_surfaces, varied
from socialcircle_ros.studies.learned.simulated import KINDS, simulated_surface


@pytest.mark.parametrize('kind', sorted(set(KINDS), key=lambda kind: kind.__name__))
def test_each_kind_of_surface_has_heights_everywhere(kind):
    grid = tuple(np.mgrid[:40, :40].astype(np.float64))
    heights = kind(grid, 5.0, np.random.default_rng(3))
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
    for seed in range(6):
        patch, grain = make_patch([real(50, 70)], np.random.default_rng(seed))
        assert patch.shape == (corpus.PLANES, 64, 64)
        assert not patch[-1][patch[5] == 0].any()
        assert np.isfinite(patch).all()
        assert np.isfinite(grain)


def test_surfaces_are_left_out_by_the_beginning_of_their_name():
    class Cloud:
        def __init__(self, name):
            self.name, self.points = name, np.zeros((4, 5, 3), np.float32)

    class Surface:
        def __init__(self, name):
            self.cloud, self.plausible = Cloud(name), np.ones((4, 5), bool)

    chosen = training_surfaces([Surface(name) for name in ('afm_a', 'afm_b', 'wyko')], ['afm'])
    assert [each.name for each in chosen] == ['wyko']
