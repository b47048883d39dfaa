# SPDX-License-Identifier: Apache-2.0
"""Two renderers that compute defocus in different ways give the same image, except at steep walls.

The bounds are root mean square differences over the field, as a share of the light of flat, bright metal:

- 0.3 % on a flat rough surface;
- 0.6 % on a ball;
- 2 % on walls of 45°.

The renderers differ at walls that block the light cone, because only the ray renderer includes occlusion.
"""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from naive.plain_depth import depth_from_focus
from naive.waves import Waves

from socialcircle_ros.errors import SettingError
from socialcircle_ros.simulation.camera import NOISELESS
from socialcircle_ros.simulation.instrument import simulate
from socialcircle_ros.simulation.optics import INSTRUMENTS
from socialcircle_ros.simulation.rendering import LayeredRenderer, RayRenderer
from socialcircle_ros.simulation.specimen import Glints, Material, Specimen, make_specimen
from socialcircle_ros.simulation.stage import Stage
from socialcircle_ros.simulation.surfaces import Grid, steps, tilt

OPTICS = INSTRUMENTS['10x']
NO_GLINTS = Glints(np.zeros(0, int), np.zeros(0, int), np.zeros(0), np.zeros(0))
CLEAN = Material(glints=0.0, stained=0.0, polished=0.0, burnished=0.0)
INNER = (slice(4, -4), slice(4, -4))


def field(surface, radiance, glints=NO_GLINTS):
    grid = Grid(*surface.shape)
    return Specimen('made', grid, surface.astype(float), radiance.astype(np.float32), glints)


def point(size=65):
    radiance = np.zeros((size, size))
    radiance[size // 2, size // 2] = 100.0
    return field(np.zeros((size, size)), radiance)


@pytest.mark.parametrize(('name', 'bound'), [('flat', 0.003), ('ball', 0.006), ('metal_groove', 0.02)])
def test_renderers_agree(name, bound):
    specimen = make_specimen(name, 80, 96, material=CLEAN, seed=1)
    low, high = specimen.surface.min() - 9, specimen.surface.max() + 9
    layered, rays = (kind(specimen, OPTICS, low, high) for kind in (LayeredRenderer, RayRenderer))
    for z in np.linspace(low, high, 7):
        difference = (layered.render(z) - rays.render(z))[INNER]
        assert difference.std() < bound
        assert abs(difference.mean()) < bound / 2


@pytest.mark.parametrize(('kind', 'bound'), [(LayeredRenderer, 0.002), (RayRenderer, 0.01)])
def test_pixel_is_blurred_by_its_distance_from_focus(kind, bound):
    waves = Waves(0)
    surface = tilt(Grid(96, 128), 0.1, -0.05)
    renderer = kind(field(surface, waves.radiance((96, 128))), OPTICS, -20, 20)
    for z in (-7.0, 0.0, 0.31, 5.0):
        image = renderer.render(z)
        for row, column in np.random.default_rng(1).integers((24, 24), (72, 104), (40, 2)):
            expected = waves.imaged(row, column, z - surface[row, column], OPTICS)
            assert image[row, column] == pytest.approx(expected, abs=bound)


def test_depths_measured_with_either_renderer_agree_within_a_fiftieth_of_a_step():
    specimen = make_specimen('flat', 64, 80, material=CLEAN, seed=3)
    depths = []
    for renderer in ('layered', 'rays'):
        scan = simulate(
            specimen, camera=NOISELESS, stage=Stage(jitter=0, encoder_noise=0), flicker=0, renderer=renderer
        )
        frames = list(scan.frames())
        depths.append(depth_from_focus([f.image for f in frames], [f.z for f in frames]))
    step = OPTICS.depth_of_field / 4
    difference = (depths[0] - depths[1])[INNER] / step
    assert np.sqrt((difference**2).mean()) < 0.02
    error = (depths[0] - specimen.surface)[INNER] / step
    assert np.sqrt((error**2).mean()) < 0.04
    assert abs(error.mean()) < 0.01


def test_point_becomes_a_disc_with_the_radius_of_the_light_cone():
    image = LayeredRenderer(point(), OPTICS, -30, 30).render(25.0)
    assert image.sum() == pytest.approx(100.0, rel=0.01)
    radius = 25 * OPTICS.cone
    inside = np.hypot(*(np.indices(image.shape) - 32)) < radius - 2
    outside = np.hypot(*(np.indices(image.shape) - 32)) > radius + 2
    assert image[inside].mean() == pytest.approx(100 / (np.pi * radius**2), rel=0.05)
    assert np.abs(image[outside]).max() < 0.05 * image[inside].mean()


def test_blur_is_symmetric_about_focus_and_least_in_focus():
    renderer = LayeredRenderer(point(), OPTICS, -30, 30)
    np.testing.assert_array_equal(renderer.render(-7.3), renderer.render(7.3))
    peaks = [renderer.render(z).max() for z in (0.0, 1.0, 2.0, 4.0, 8.0, 16.0)]
    assert peaks == sorted(peaks, reverse=True)


def test_glint_is_a_point_at_its_own_depth():
    glints = Glints(np.array([32]), np.array([32]), np.array([100.0]), np.array([12.0]))
    specimen = field(np.zeros((65, 65)), np.zeros((65, 65)), glints)
    renderer = LayeredRenderer(specimen, OPTICS, -5, 30)
    plain = LayeredRenderer(point(), OPTICS, -20, 20)
    for z in (12.0, 8.3, 25.1, 0.0):
        np.testing.assert_allclose(
            renderer.render(z), plain.render(z - 12), atol=0.02 * plain.render(z - 12).max()
        )
    assert (renderer.glare() >= renderer.render(12.0) - 1e-6).all()


def test_ray_renderer_includes_occlusion():
    """With focus on the upper land, neither renderer lets the bright floor shine through its edge."""
    surface = steps(Grid(64, 96), [30.0, 0.0])
    radiance = np.where(surface > 0, 0.2, 1.0)
    for kind in (LayeredRenderer, RayRenderer):
        image = kind(field(surface, radiance), OPTICS, -5, 35).render(30.0)
        assert image[32, 44] == pytest.approx(0.2, abs=0.02)
    # With focus on the floor, the blurred land covers the floor at its foot. Only the ray renderer shows this.
    layered, rays = (
        kind(field(surface, radiance), OPTICS, -5, 35).render(0.0)[32, 50]
        for kind in (LayeredRenderer, RayRenderer)
    )
    assert abs(layered - rays) > 0.05


def test_z_outside_the_prepared_range_is_refused():
    with pytest.raises(SettingError, match=r'z = 31.000 µm is outside -30.000 to 30.000 µm'):
        LayeredRenderer(point(), OPTICS, -30, 30).render(31.0)


def test_specimen_of_another_pitch_is_refused():
    specimen = replace(point(), grid=Grid(65, 65, 0.5, 0.5))
    with pytest.raises(SettingError, match=r'make the specimen with pitch=1.0'):
        LayeredRenderer(specimen, OPTICS, -30, 30)


def test_memory_does_not_grow_with_the_number_of_frames():
    def peak(frames):
        scan = simulate('flat', 60, 80, frames=frames, seed=0)
        _ = scan.renderer
        tracemalloc.start()
        for _ in scan.frames():
            pass
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return most

    peak(5)
    assert peak(200) < peak(20) + 200_000
