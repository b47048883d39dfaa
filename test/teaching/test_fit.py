# SPDX-License-Identifier: Apache-2.0
"""The fit of a lesson."""

import numpy as np

from socialcircle_ros.circle.adaptive.lesson import logistic, terms
from socialcircle_ros.teaching.examples import LabelledCommunities
from socialcircle_ros.teaching.fit import _squares, fit

GENERATOR = np.random.default_rng(5)


def test_the_squares_are_a_weighted_product():
    matrix, weights = GENERATOR.normal(size=(300, 17)), GENERATOR.random(300)
    np.testing.assert_allclose(_squares(matrix, weights), (matrix * weights[:, None]).T @ matrix, rtol=1e-10)


def test_what_is_large_is_told_from_what_is_small():
    traits = GENERATOR.normal(size=(400, 12))
    is_outlier = traits[:, 0] > 0
    communities = LabelledCommunities(traits, 9.0 * is_outlier, 9.0 * ~is_outlier)
    mean, scale, weights = fit(communities)
    chances = logistic(terms(traits, mean, scale) @ weights)
    assert ((chances > 0.5) == is_outlier).mean() > 0.98


def test_the_weights_have_the_greatest_penalised_likelihood():
    random = np.random.default_rng(7)
    traits = random.normal(size=(40, 12)) * np.geomspace(0.01, 10, 12)
    outliers, good = random.uniform(0, 9, (2, 40))
    communities = LabelledCommunities(traits, outliers, good)
    mean, scale, weights = fit(communities)
    np.testing.assert_allclose(mean, traits.mean(axis=0))
    np.testing.assert_allclose(scale, traits.std(axis=0) + 0.01)
    matrix = terms(traits, mean, scale)
    chances = 1 / (1 + np.exp(-matrix @ weights))
    belief = np.zeros(weights.size)
    belief[0] = 2
    gradient = matrix.T @ (np.abs(outliers - good) * (chances - (outliers > good))) + (weights - belief)
    assert np.abs(gradient).max() < 1e-2
