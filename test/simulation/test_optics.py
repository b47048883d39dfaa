# SPDX-License-Identifier: Apache-2.0
"""The optics agree with theory: cut-off frequency, depth of field, circle of confusion."""

import numpy as np
import pytest

from socialcircle_ros.errors import SettingError
from socialcircle_ros.simulation.optics import INSTRUMENTS, Optics


def test_depth_of_field_of_a_10x_objective():
    optics = INSTRUMENTS['10x']
    assert optics.pitch == 1.0
    assert optics.depth_of_field == pytest.approx(6.11, abs=0.01)
    assert optics.cone == pytest.approx(0.3145, abs=1e-4)


def test_transfer_is_zero_above_the_cut_off_frequency():
    optics = Optics(magnification=100.0)  # the pixels are fine enough to show the diffraction
    cut_off = 2 * optics.numerical_aperture / optics.wavelength
    f = np.array([0.0, 0.5 * cut_off, cut_off, 2 * cut_off])
    transfer = optics.sharp_transfer(f, np.zeros(4))
    assert transfer[0] == 1.0
    assert transfer[1] == pytest.approx(0.391 * np.sinc(0.5 * cut_off * optics.pitch), abs=1e-3)
    assert transfer[2:] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize('defocus', [0.3, 4.0, -25.0, 80.0])
def test_defocus_transfer_is_the_fourier_transform_of_a_disc(defocus):
    optics = INSTRUMENTS['10x']
    radius = abs(defocus) * optics.cone
    f = np.linspace(0, 0.7, 23)
    x = np.linspace(-radius, radius, 20_001)
    chord = 2 * np.sqrt(np.maximum(radius**2 - x**2, 0))
    waves = np.cos(2 * np.pi * f[:, np.newaxis] * x)
    expected = (waves @ chord) * (x[1] - x[0]) / (np.pi * radius**2)
    np.testing.assert_allclose(optics.defocus_transfer(f, defocus), expected, atol=3e-4)


def test_transfer_without_defocus_is_one():
    assert INSTRUMENTS['10x'].defocus_transfer(np.linspace(0, 1, 5), 0.0) == pytest.approx(1.0)


@pytest.mark.parametrize('change', [{'numerical_aperture': 1.0}, {'pixel': 0.0}])
def test_optics_with_values_out_of_range_are_refused(change):
    with pytest.raises(SettingError, match='0'):
        Optics(**change)
