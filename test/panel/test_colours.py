# SPDX-License-Identifier: Apache-2.0
"""The colours can be told apart with every kind of colour vision."""

import numpy as np
import pytest

from socialcircle_ros.panel import colours

# Linear RGB as seen with each kind of colour blindness, severity 1: Machado, Oliveira and Fernandes 2009,
# doi:10.1109/TVCG.2009.113.
VISION = {
    'full': np.eye(3),
    'protanopia': [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    'deuteranopia': [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    'tritanopia': [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}


def lab(rgb, vision):
    """CIELAB (D65) of sRGB colours, 0 to 255, as seen with a kind of colour vision."""
    share = np.asarray(rgb, float) / 255
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    seen = np.clip(linear @ np.transpose(VISION[vision]), 0, 1)
    to_xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    xyz = seen @ to_xyz.T / [0.9505, 1.0, 1.089]
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.stack([116 * f[..., 1] - 16, 500 * (f[..., 0] - f[..., 1]), 200 * (f[..., 1] - f[..., 2])], -1)


@pytest.mark.parametrize('vision', VISION)
@pytest.mark.parametrize('name', colours.MAPS)
def test_outliers_differ_from_every_height_and_from_gaps(vision, name):
    others = np.vstack([colours.height_table(name), colours.NOT_MEASURED, colours.KEPT])
    assert np.linalg.norm(lab(others, vision) - lab(colours.OUTLIER, vision), axis=-1).min() > 25


@pytest.mark.parametrize('vision', VISION)
def test_the_classes_of_a_comparison_differ_from_each_other(vision):
    classes = lab([colours.ONLY_A, colours.ONLY_B, colours.BOTH, colours.KEPT, colours.NOT_MEASURED], vision)
    for number, one in enumerate(classes):
        assert np.linalg.norm(np.delete(classes, number, 0) - one, axis=-1).min() > 10


@pytest.mark.parametrize('vision', VISION)
@pytest.mark.parametrize('name', colours.MAPS)
def test_higher_is_always_lighter(vision, name):
    assert (np.diff(lab(colours.height_table(name)[::8], vision)[:, 0]) > 0).all()


def test_heights_outside_the_span_get_the_colours_of_its_ends():
    table = colours.height_table()
    found = colours.coloured(np.array([-5.0, 0.0, 1.0, 9.0, np.nan]), (0.0, 1.0))
    assert found.tolist() == [table[0].tolist(), table[0].tolist(), table[255].tolist(), table[255].tolist(),
                              table[0].tolist()]  # fmt: skip
    assert colours.coloured(np.zeros(2), (0.0, 0.0)).tolist() == [table[0].tolist()] * 2
