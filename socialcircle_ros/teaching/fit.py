# SPDX-License-Identifier: Apache-2.0
"""Logistic regression with products of traits, held near what the rules do without a lesson: all is an outlier."""

import numpy as np
import numpy.typing as npt

from socialcircle_ros.circle.adaptive.lesson import logistic, terms
from socialcircle_ros.kernels.compiled import kernel

from .examples import LabelledCommunities

_BELIEF = 2.0
"""Constant of the logistic function before anything is learnt: what the rules find is an outlier at 88 %."""
_HOLD = 1.0
"""Strength of that belief, and of the belief that no trait matters: as of one point."""
_LEAST_SCALE = 0.01
"""Least standard deviation of a trait: one that hardly varies must not count for much."""
_LEAST_WEIGHT = 1e-9
_ROUNDS = 40
_HALVINGS = 14
_CLOSE = 1e-6

Coefficients = npt.NDArray[np.float64]


def fit(communities: LabelledCommunities) -> tuple[Coefficients, Coefficients, Coefficients]:
    """Fit the probability that a community is an outlier.

    The penalised likelihood has one maximum, which Newton's method finds; a step that does not raise it is halved
    (T. Hastie, R. Tibshirani, J. Friedman: The Elements of Statistical Learning, 2009, section 4.4.1).

    Args:
        communities: at least one.

    Returns:
        Mean and standard deviation of each trait, and the weights, as in a `Lesson`.
    """
    mean = communities.traits.mean(axis=0)
    scale = communities.traits.std(axis=0) + _LEAST_SCALE
    matrix = terms(communities.traits, mean, scale)
    belief = np.zeros(matrix.shape[1])
    belief[0] = _BELIEF
    weights, loss = belief, _loss(belief, belief, matrix, communities)
    for _ in range(_ROUNDS):
        chance = logistic(matrix @ weights)
        gradient = matrix.T @ (communities.weights * (chance - communities.labels)) + _HOLD * (weights - belief)
        curvature = communities.weights * chance * (1 - chance) + _LEAST_WEIGHT
        hessian = _squares(matrix, curvature) + _HOLD * np.eye(len(belief))
        step = np.linalg.solve(hessian, gradient)
        for halving in range(_HALVINGS):
            tried = weights - step * 0.5**halving
            better = _loss(tried, belief, matrix, communities)
            if better < loss:
                break
        else:
            break
        done = loss - better < _CLOSE * loss
        weights, loss = tried, better
        if done:
            break
    return mean, scale, weights


@kernel
def _squares(matrix: Coefficients, weights: Coefficients) -> Coefficients:
    """Sum of the products of two columns of a matrix over its rows, each with its weight.

    The threads of a matrix product wait for each other: on a busy machine it took ten times as long.
    """
    rows, columns = matrix.shape
    result = np.zeros((columns, columns))
    for row in range(rows):
        for first in range(columns):
            factor = weights[row] * matrix[row, first]
            for second in range(first, columns):
                result[first, second] += factor * matrix[row, second]
    for first in range(columns):
        for second in range(first):
            result[first, second] = result[second, first]
    return result


def _loss(
    weights: Coefficients, belief: Coefficients, matrix: Coefficients, communities: LabelledCommunities
) -> float:
    """Negative logarithm of the likelihood, with the penalty."""
    margin = (2 * communities.labels - 1) * (matrix @ weights)
    penalty = _HOLD / 2 * float(((weights - belief) ** 2).sum())
    return float((communities.weights * np.logaddexp(0, -margin)).sum()) + penalty
