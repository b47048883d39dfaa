# SPDX-License-Identifier: Apache-2.0
"""The whole instrument: stacks are reproducible, and outliers have physical causes."""

import numpy as np
import pytest
from naive.plain_depth import depth_from_focus

from socialcircle_ros.errors import SettingError
from socialcircle_ros.simulation.camera import Camera
from socialcircle_ros.simulation.instrument import simulate
from socialcircle_ros.simulation.optics import Optics
from socialcircle_ros.simulation.specimen import MATERIALS
from socialcircle_ros.simulation.truth import Cause


def measured(scan):
    frames = list(scan.frames())
    return depth_from_focus([frame.image for frame in frames], [frame.z for frame in frames])


def group_sizes(mask):
    """Sizes of the groups of points that touch along a side or at a corner."""
    remaining = {tuple(place) for place in np.argwhere(mask)}
    sizes = []
    while remaining:
        edge, size = [remaining.pop()], 0
        while edge:
            row, column = edge.pop()
            size += 1
            near = {(row + y, column + x) for y in (-1, 0, 1) for x in (-1, 0, 1)} & remaining
            remaining -= near
            edge += near
        sizes.append(size)
    return np.array(sizes)


def test_same_seed_gives_the_same_bytes():
    one, again, other = (simulate('metal_groove', 48, 64, frames=6, seed=seed) for seed in (1, 1, 2))
    first = b''.join(frame.image.tobytes() for frame in one.frames())
    assert first == b''.join(frame.image.tobytes() for frame in again.frames())
    assert first == b''.join(frame.image.tobytes() for frame in one.frames())
    assert first != b''.join(frame.image.tobytes() for frame in other.frames())


def test_frame_has_its_stamp_and_position():
    scan = simulate('flat', 48, 64, frames=5, z_step=2.0, camera=Camera(bits=12))
    frames = list(scan.frames())
    assert len(scan) == len(frames) == 5
    assert [frame.index for frame in frames] == [0, 1, 2, 3, 4]
    assert [frame.stamp for frame in frames] == list(scan.travel.stamps)
    assert frames[0].image.dtype == np.uint16
    np.testing.assert_allclose([frame.z for frame in frames], scan.travel.z_true, atol=0.1)


@pytest.mark.parametrize('name', MATERIALS)
def test_scan_extends_above_and_below_the_surface(name):
    scan = simulate(name, 48, 64)
    surface = scan.specimen.surface
    assert scan.travel.z_nominal[0] <= surface.min() - 9
    assert scan.travel.z_nominal[-1] >= surface.max() + 9
    np.testing.assert_allclose(np.diff(scan.travel.z_nominal), scan.optics.depth_of_field / 4)


@pytest.mark.parametrize('seed', [1, 2])
@pytest.mark.parametrize('name', ['metal_groove', 'steep_groove'])
def test_outliers_of_a_groove_have_a_known_cause(name, seed):
    scan = simulate(name, 160, 208, seed=seed)
    truth = scan.truth
    verdict = truth.classify(measured(scan))
    assert 0.02 < verdict.bad.mean() < 0.15
    assert verdict.good.mean() > 0.8
    has_cause = truth.cause != Cause.NONE
    assert (verdict.bad & has_cause).sum() > 0.85 * verdict.bad.sum()
    assert verdict.bad[~has_cause].mean() < 0.01
    sizes = group_sizes(verdict.bad)
    assert sizes[sizes >= 10].sum() > 0.5 * sizes.sum()
    assert (sizes <= 3).sum() >= 3


def test_outliers_of_a_textured_plane_are_where_the_contrast_is_low():
    scan = simulate('flat', 160, 208, seed=1)
    verdict = scan.truth.classify(measured(scan))
    assert verdict.good.mean() > 0.96
    assert 0.002 < verdict.bad.mean() < 0.03
    step = scan.optics.depth_of_field / 4
    assert np.sqrt((verdict.error[verdict.good] ** 2).mean()) < 0.25 * step
    weak = (scan.truth.cause & Cause.LOW_CONTRAST) > 0
    assert verdict.bad[weak].mean() > 20 * verdict.bad[scan.truth.cause == 0].mean()


def test_camera_with_a_smaller_full_well_gives_more_outliers():
    good, poor = (
        simulate('metal_groove', 96, 128, seed=1, camera=Camera(full_well=well)) for well in (30_000.0, 3000.0)
    )
    few, many = (scan.truth.classify(measured(scan)).bad.mean() for scan in (good, poor))
    assert many > 1.2 * few


def test_optics_can_be_given():
    scan = simulate('flat', 48, 64, instrument=Optics(20.0, 0.45, pixel=5.0), frames=8)
    assert scan.specimen.grid.dx == 0.25
    assert len(list(scan.frames())) == 8


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        ({'instrument': '7x'}, "no instrument '7x'; use one of: 5x, 10x"),
        ({'renderer': 'magic'}, "use 'layered' or 'rays'"),
        ({'frames': 2}, 'at least 3'),
        ({'z_step': 0.0}, 'must be above 0'),
        ({'flicker': -1.0}, 'cannot be below 0'),
    ],
)
def test_scan_with_values_out_of_range_is_refused(arguments, message):
    with pytest.raises(SettingError, match=message):
        simulate('flat', 48, 64, **arguments)


def test_a_wide_step_leaves_as_many_frames_as_a_stack_needs():
    assert len(simulate('flat', 20, 30, z_step=1000.0)) == 3
