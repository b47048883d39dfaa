# SPDX-License-Identifier: Apache-2.0
"""A specimen reflects light as its material says."""

from dataclasses import replace

import numpy as np
import pytest

from socialcircle_ros.errors import SettingError
from socialcircle_ros.simulation.specimen import MATERIALS, Material, make_specimen


@pytest.mark.parametrize('name', MATERIALS)
def test_same_seed_gives_the_same_specimen(name):
    one, again, other = (make_specimen(name, 64, 80, seed=seed) for seed in (1, 1, 2))
    assert one.surface.shape == one.radiance.shape == (64, 80)
    assert one.radiance.dtype == np.float32
    assert one.radiance.tobytes() == again.radiance.tobytes()
    assert one.glints.z.tobytes() == again.glints.z.tobytes()
    assert one.radiance.tobytes() != other.radiance.tobytes()


def test_walls_reflect_only_their_matte_part():
    specimen = make_specimen('metal_groove', 64, 200, seed=0)
    wall = (specimen.surface < -0.3 * 24) & (specimen.surface > -0.7 * 24)
    assert specimen.radiance[wall].mean() == pytest.approx(0.12 / np.sqrt(2), rel=0.2)
    assert np.median(specimen.radiance[specimen.surface > -1]) == pytest.approx(1.0, abs=0.1)


def test_polished_areas_have_almost_no_texture():
    rough = Material(polished=0.0, stained=0.0, burnished=0.0)
    assert make_specimen('flat', 200, 200, material=rough).radiance.std() == pytest.approx(0.3, abs=0.03)
    assert make_specimen('flat', 200, 200, material=replace(rough, polished=1.0)).radiance.std() < 0.03


def test_glints_are_more_frequent_in_the_groove():
    specimen = make_specimen('metal_groove', 400, 400, material=Material(glints=30.0))
    inside = specimen.surface[specimen.glints.row, specimen.glints.column] < -2
    assert inside.mean() > 1.5 * (specimen.surface < -2).mean()


def test_unknown_specimen_is_refused():
    with pytest.raises(SettingError, match="no specimen 'cheese'; use one of: metal_groove"):
        make_specimen('cheese')
