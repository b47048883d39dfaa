# SPDX-License-Identifier: Apache-2.0
"""Surfaces have the requested size, roughness and walls."""

import numpy as np
import pytest

from socialcircle_ros.errors import SettingError
from socialcircle_ros.simulation import surfaces
from socialcircle_ros.simulation.surfaces import Grid

GRID = Grid(120, 160, dx=0.5, dy=0.8)


@pytest.mark.parametrize(
    'rough',
    [
        lambda seed: surfaces.gaussian(GRID, 0.3, 5.0, seed),
        lambda seed: surfaces.fractal(GRID, 0.3, seed),
    ],
)
def test_roughness_has_its_sq_and_depends_on_its_seed(rough):
    first = rough(1)
    assert first.shape == GRID.shape
    assert first.std() == pytest.approx(0.3)
    assert first.mean() == pytest.approx(0.0, abs=1e-12)
    assert first.tobytes() == rough(1).tobytes()
    assert not np.allclose(first, rough(2))


def test_gaussian_roughness_has_its_correlation_length():
    grid = Grid(512, 512)
    z = surfaces.gaussian(grid, 1.0, 8.0, 0)
    correlation = (z * np.roll(z, 8, axis=1)).mean()
    assert correlation == pytest.approx(np.exp(-1), abs=0.05)


def test_tilt_has_its_slopes():
    z = surfaces.tilt(GRID, 0.1, -0.2)
    np.testing.assert_allclose(np.diff(z, axis=1), 0.1 * 0.5)
    np.testing.assert_allclose(np.diff(z, axis=0), -0.2 * 0.8)


def test_a_sphere_is_round():
    grid = Grid(101, 101)
    cap = surfaces.sphere(grid, 200.0)
    assert cap[50, 50] == 0
    assert cap[50, 80] == pytest.approx(np.sqrt(200**2 - 30**2) - 200)
    assert cap[80, 50] == cap[50, 80]


def test_sphere_that_does_not_fill_the_field_is_refused():
    with pytest.raises(SettingError, match='does not reach the edge of the field; give more than 71 µm'):
        surfaces.sphere(Grid(101, 101), 50.0)


@pytest.mark.parametrize(('angle', 'step'), [(45.0, 1.0), (70.0, np.tan(np.deg2rad(70)))])
def test_groove_has_lands_floor_and_walls_of_its_angle(angle, step):
    z = surfaces.groove(Grid(10, 200), 100.0, 20.0, angle)
    assert z[:, 0].max() == 0
    assert (z[:, 100] == -20.0).all()
    assert np.abs(np.diff(z, axis=1)).max() == pytest.approx(step)


def test_vertical_wall_is_between_two_points():
    z = surfaces.groove(Grid(10, 200), 100.0, 20.0, 90.0)
    assert set(np.unique(z)) == {-20.0, 0.0}


def test_groove_without_a_floor_is_refused():
    with pytest.raises(SettingError, match=r'has no floor at a depth of 60.0 µm.*give a width above 120 µm'):
        surfaces.groove(GRID, 100.0, 60.0, 45.0)


def test_ring_groove_separates_the_disc_from_the_land():
    z = surfaces.ring_groove(Grid(101, 101), 30.0, 10.0, 8.0, 85.0)
    assert z[50, 50] == 0
    assert z[50, 80] == -8.0
    assert z[0, 0] == 0


def test_steps_pits_discs_and_islands_keep_to_their_limits():
    assert list(np.unique(surfaces.steps(GRID, [0.0, 3.0, 1.0]))) == [0.0, 1.0, 3.0]
    pits = surfaces.pits(GRID, 10, (3.0, 8.0), (1.0, 4.0), 0)
    assert -4.0 <= pits.min() < -1.0
    assert pits.max() == 0
    discs = surfaces.discs(GRID, 10, (3.0, 8.0), (1.0, 4.0), 0)
    assert 1.0 <= discs.max() <= 4.0
    assert discs.min() == 0
    raised = surfaces.islands(GRID, 2.0, 10.0, 0.3, 0)
    assert (raised == 2.0).mean() == pytest.approx(0.3, abs=0.01)


def test_milling_marks_have_their_depth():
    marks = surfaces.milling_marks(Grid(300, 50), 1.0, 12.0, 400.0, 0)
    assert marks.max() - marks.min() == pytest.approx(1.1, abs=0.3)
    assert abs(marks.mean()) < 0.1


def test_tows_of_a_weave_alternate():
    grid = Grid(200, 200)
    z = surfaces.weave(grid, 50.0, 20.0, 0)
    along_x = np.abs(np.diff(z, axis=1)).reshape(4, 50, 199)[:, 15:35]
    along_y = np.abs(np.diff(z, axis=0)).T.reshape(4, 50, 199)[:, 15:35]
    # A fibre is smooth along its axis and ridged across it: in each cell of the weave one direction dominates.
    cell = [[along_x[i, :, 50 * j + 15 : 50 * j + 35].mean() for j in range(4)] for i in range(4)]
    other = [[along_y[j, :, 50 * i + 15 : 50 * i + 35].mean() for j in range(4)] for i in range(4)]
    over = np.array(cell) > np.array(other)
    expected = np.indices((4, 4)).sum(0) % 2 == 0
    assert (over == expected).all()


def test_grid_without_points_or_pitch_is_refused():
    with pytest.raises(SettingError, match='has no points'):
        Grid(0, 10)
    with pytest.raises(SettingError, match='both must be above 0'):
        Grid(10, 10, dx=0.0)
