"""Two renderers that make the blur in ways of their own give the same image, but for walls.

The bounds, in units of the light of flat bright metal, root mean square over the field: 0.3 % where the
surface is flat and rough, 0.6 % on a ball, 2 % on walls of 45°. At walls that cut the light cone they part:
only the rays know what stands in the way.
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
from socialcircle_ros.simulation.rendering import LayeredRenderer, RayRenderer, aperture_openness
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
def test_the_two_renderers_agree(name, bound):
    specimen = make_specimen(name, 80, 96, material=CLEAN, seed=1)
    low, high = specimen.surface.min() - 9, specimen.surface.max() + 9
    layered, rays = (kind(specimen, OPTICS, low, high) for kind in (LayeredRenderer, RayRenderer))
    for z in np.linspace(low, high, 7):
        difference = (layered.render(z) - rays.render(z))[INNER]
        assert difference.std() < bound
        assert abs(difference.mean()) < bound / 2


@pytest.mark.parametrize(('kind', 'bound'), [(LayeredRenderer, 0.002), (RayRenderer, 0.01)])
def test_each_pixel_is_blurred_as_its_own_distance_asks(kind, bound):
    waves = Waves(0)
    surface = tilt(Grid(96, 128), 0.1, -0.05)
    renderer = kind(field(surface, waves.radiance((96, 128))), OPTICS, -20, 20)
    for z in (-7.0, 0.0, 0.31, 5.0):
        image = renderer.render(z)
        for row, column in np.random.default_rng(1).integers((24, 24), (72, 104), (40, 2)):
            expected = waves.imaged(row, column, z - surface[row, column], OPTICS)
            assert image[row, column] == pytest.approx(expected, abs=bound)


def test_depths_found_in_the_images_of_either_renderer_agree_within_a_fiftieth_of_a_step():
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


def test_a_point_becomes_a_disc_with_the_radius_of_the_cone():
    image = LayeredRenderer(point(), OPTICS, -30, 30).render(25.0)
    assert image.sum() == pytest.approx(100.0, rel=0.01)
    radius = 25 * OPTICS.cone
    inside = np.hypot(*(np.indices(image.shape) - 32)) < radius - 2
    outside = np.hypot(*(np.indices(image.shape) - 32)) > radius + 2
    assert image[inside].mean() == pytest.approx(100 / (np.pi * radius**2), rel=0.05)
    assert np.abs(image[outside]).max() < 0.05 * image[inside].mean()


def test_blur_is_the_same_above_and_below_the_focus_and_least_in_it():
    renderer = LayeredRenderer(point(), OPTICS, -30, 30)
    np.testing.assert_array_equal(renderer.render(-7.3), renderer.render(7.3))
    peaks = [renderer.render(z).max() for z in (0.0, 1.0, 2.0, 4.0, 8.0, 16.0)]
    assert peaks == sorted(peaks, reverse=True)


def test_a_glint_is_a_point_at_a_depth_of_its_own():
    glints = Glints(np.array([32]), np.array([32]), np.array([100.0]), np.array([12.0]))
    specimen = field(np.zeros((65, 65)), np.zeros((65, 65)), glints)
    renderer = LayeredRenderer(specimen, OPTICS, -5, 30)
    plain = LayeredRenderer(point(), OPTICS, -20, 20)
    for z in (12.0, 8.3, 25.1, 0.0):
        np.testing.assert_allclose(
            renderer.render(z), plain.render(z - 12), atol=0.02 * plain.render(z - 12).max()
        )
    assert (renderer.glare() >= renderer.render(12.0) - 1e-6).all()


@pytest.mark.parametrize('distance', [2.0, 5.0, 9.0])
def test_a_wall_cuts_a_segment_out_of_the_light_cone(distance):
    surface = steps(Grid(81, 120), [40.0, 0.0])
    radius = 40 * OPTICS.cone
    share = aperture_openness(surface, OPTICS)[40, 60 + int(distance) - 1]
    t = (distance - 0.5) / radius
    cut = (np.arccos(t) - t * np.sqrt(1 - t**2)) / np.pi
    assert share == pytest.approx(1 - cut, abs=0.06)
    assert aperture_openness(surface, OPTICS)[40, 30] == 1.0


def test_rays_know_what_stands_in_the_way():
    """Focused on the upper land, the bright floor must not shine through its edge; nor in the layers."""
    surface = steps(Grid(64, 96), [30.0, 0.0])
    radiance = np.where(surface > 0, 0.2, 1.0)
    for kind in (LayeredRenderer, RayRenderer):
        image = kind(field(surface, radiance), OPTICS, -5, 35).render(30.0)
        assert image[32, 44] == pytest.approx(0.2, abs=0.02)
    # Focused on the floor, the land out of focus veils the floor at its foot: only rays see that.
    layered, rays = (
        kind(field(surface, radiance), OPTICS, -5, 35).render(0.0)[32, 50]
        for kind in (LayeredRenderer, RayRenderer)
    )
    assert abs(layered - rays) > 0.05


def test_z_outside_of_the_prepared_range_is_refused():
    with pytest.raises(SettingError, match=r'z = 31.000 µm is outside -30.000 to 30.000 µm'):
        LayeredRenderer(point(), OPTICS, -30, 30).render(31.0)


def test_a_specimen_of_another_pitch_is_refused():
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
