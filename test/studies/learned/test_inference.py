# SPDX-License-Identifier: Apache-2.0
"""The packaged network: what it says of itself, and that it judges."""

import json

import numpy as np
import pytest

pytest.importorskip('onnxruntime')
from socialcircle_ros.studies.learned.inference import Judge, packaged_network
from socialcircle_ros.studies.learned.surfaces import DEVELOPMENT, HELD_OUT


@pytest.fixture(scope='module')
def judge():
    return Judge(packaged_network(), threads=1)


def test_the_file_is_small():
    assert packaged_network().stat().st_size < 2_000_000


def test_the_file_names_what_it_was_trained_on_and_what_was_left_out(judge):
    trained, left_out = (set(json.loads(judge.card[name])) for name in ('trained_on', 'held_out'))
    assert left_out == set(HELD_OUT)
    assert trained >= set(DEVELOPMENT)
    assert not trained & left_out


def noise(height=130, width=170):
    return np.random.default_rng(6).normal(size=(height, width)).astype(np.float32)


def test_spikes_and_patches_are_outliers_and_noise_is_none(judge):
    heights = noise()
    heights[40, 60] += 30
    heights[80:86, 100:107] -= 25
    heights[20:30, 20:25] = np.nan
    found = judge.outliers(heights)
    assert found[40, 60]
    assert found[80:86, 100:107].mean() > 0.9
    assert not found[20:30, 20:25].any()
    assert found.sum() < 60


@pytest.mark.parametrize('factor', [2.0**-40, 8.0])
def test_a_power_of_two_changes_nothing(judge, factor):
    assert np.array_equal(judge.logits(noise() * np.float32(factor)), judge.logits(noise()))
