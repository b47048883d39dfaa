"""The adaptive mode as a whole."""

import numpy as np
import pytest

from socialcircle_ros.circle.adaptive import find_outliers


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('height', [1e300, -1e300, np.finfo(np.float64).max])
def test_an_outlier_beyond_what_float32_holds_is_one(height):
    heights = np.random.default_rng(0).normal(0, 1, (40, 50))
    heights[3, 4] = height

    result = find_outliers(heights)

    assert result.outliers[3, 4]
    assert result.score[3, 4] > 0.5
