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
