"""The experiment of the notes: fractal roughness with an 8-unit step, 8.4 % holes, truth known."""

import numpy as np
import pytest
from repair.surfaces import cloud, fractal, scattered_and_clustered, step_distance

from socialcircle_ros.repair import repair_holes
from socialcircle_ros.settings import RepairSettings


def errors(method, z, holes, near_step):
    """RMSE of the filled heights: of all, and of those within 3 points of the step."""
    result = repair_holes(cloud(z), holes, RepairSettings(method=method))
    squared = (result.xyz[..., 2] - z) ** 2
    return tuple(float(np.sqrt(squared[result.filled & part].mean())) for part in (True, near_step))


def experiment(hurst, angle, seed, blur=0.0):
    """Ratios of the RMSE of 'biharmonic' to that of 'spline': of all filled points, of those at the step.

    Args:
        hurst: smoothness of the roughness, 0 (jagged) to 1.
        angle: direction of the step in radians.
        seed: of roughness and holes.
        blur: width in points of the step's logistic flank; 0: sharp.
    """
    shape = 240, 320
    distance = step_distance(*shape, angle)
    flank = distance > 0 if blur == 0 else 1 / (1 + np.exp(-distance / blur))
    z = fractal(*shape, hurst, 3.0, seed) + 8.0 * flank
    holes = scattered_and_clustered(*shape, seed)
    # A hole that is open to the border is extrapolated in part by either method: one of them hides all others.
    holes[:6], holes[-6:], holes[:, :6], holes[:, -6:] = False, False, False, False
    biharmonic = errors('biharmonic', z, holes, abs(distance) < 3)
    spline = errors('spline', z, holes, abs(distance) < 3)
    return biharmonic[0] / spline[0], biharmonic[1] / spline[1]


@pytest.mark.parametrize('angle', [0.0, 0.4, np.pi / 4, 1.2, np.pi / 2])
@pytest.mark.parametrize('seed', [1, 2, 3])
def test_two_thirds_of_the_error_of_the_spline(angle, seed):
    everywhere, at_step = experiment(hurst=0.8, angle=angle, seed=seed)
    assert everywhere <= 0.65
    assert at_step <= 0.65


@pytest.mark.parametrize(('hurst', 'blur'), [(0.5, 0.5), (0.8, 0.5), (1.0, 0.5), (1.0, 1.0)])
def test_two_thirds_of_the_error_of_the_spline_at_a_blurred_step(hurst, blur):
    ratios = [experiment(hurst, angle, seed=4, blur=blur) for angle in np.linspace(0, np.pi, 8, endpoint=False)]
    everywhere, at_step = np.transpose(ratios)
    assert np.mean(at_step) <= 0.65
    assert max(at_step) <= 1.0
    assert max(everywhere) <= 0.95


@pytest.mark.parametrize(('hurst', 'blur'), [(0.5, 1.0), (0.8, 1.0)])
def test_roughness_as_high_as_the_flank_is_no_worse_than_with_the_spline(hurst, blur):
    ratios = [experiment(hurst, angle, seed=4, blur=blur) for angle in np.linspace(0, np.pi, 8, endpoint=False)]
    everywhere, at_step = np.mean(ratios, axis=0)
    assert everywhere <= 0.95
    assert at_step <= 1.0
