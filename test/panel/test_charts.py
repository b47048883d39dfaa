# SPDX-License-Identifier: Apache-2.0
"""Map, profile and histogram."""

import dataclasses
import re

import numpy as np
import pytest
from examples import surface
from hypothesis import example, given
from hypothesis import strategies as st
from panel.test_view import drawing, masked

from socialcircle_ros.focus import FocusCurve
from socialcircle_ros.panel import charts, colours

numbers = st.floats(-1e6, 1e6)


@example(low=1.0, span=40001.0, about=2)
@example(low=-999999.9999999999, span=0.001953125, about=2)  # one tick, far from 0
@given(low=numbers, span=st.floats(1e-3, 1e6), about=st.integers(2, 8))
def test_ticks_are_round_evenly_spaced_and_inside(low, span, about):
    high = low + span
    ticks = charts.nice_ticks(low, high, about)
    assert 1 <= len(ticks) <= 2.6 * about + 1
    assert all(low - 1e-6 * span <= tick <= high + 1e-6 * span for tick in ticks)
    if len(ticks) > 2:
        np.testing.assert_allclose(np.diff(ticks), ticks[1] - ticks[0], rtol=1e-6)
    texts = charts.tick_texts(ticks)
    assert len(set(texts)) == len(ticks)
    for tick, text in zip(ticks, texts, strict=True):
        assert float(text.replace('−', '-')) == pytest.approx(tick, abs=1e-3 * span / about)


def test_the_map_shows_heights_gaps_and_outliers_row_0_at_the_top():
    xyz = surface()
    picture = charts.map_picture(drawing(xyz, masked(xyz, [(10, 12)])))
    assert tuple(picture[10, 12]) == colours.OUTLIER
    assert tuple(picture[21, 1]) == colours.NOT_MEASURED
    assert picture.shape == (70, 80, 3)
    table = colours.height_table().tolist()
    assert picture[30, 30].tolist() in table


def test_a_single_outlier_is_visible_on_the_map_of_a_large_cloud():
    y, x = np.mgrid[:961, :1283].astype(np.float32)
    xyz = np.dstack([x, y, x])
    picture = charts.map_picture(drawing(xyz, masked(xyz, [(500, 777)])))
    assert max(picture.shape[:2]) <= 400
    assert (picture == colours.OUTLIER).all(axis=2).sum() == 1


def test_the_axes_have_units_and_the_scale_bar_a_length():
    y, x = np.mgrid[:70, :80].astype(np.float64)
    xyz = np.dstack([x * 2e-6, y * 1e-6, np.sin(x) * 5e-7])
    drawn = charts.map_svg(drawing(xyz, masked(xyz)), (3, 4), (1, 2, 30, 40))
    assert 'x [µm]' in drawn
    assert 'y [µm]' in drawn
    assert re.search('class="sc-bar-text"[^>]*>20 µm<', drawn)
    for part in ('sc-picked', 'sc-cut', 'sc-region'):
        assert drawn.count(f'class="{part}"') == 1
    assert 'z [nm]' in charts.profile_svg(drawing(xyz, masked(xyz)), (3, 4))
    assert 'z [nm]' in charts.histogram_svg(drawing(xyz, masked(xyz)))


def test_the_profile_breaks_at_gaps_and_marks_outliers():
    xyz = surface()
    drawn = charts.profile_svg(drawing(xyz, masked(xyz, [(21, 12), (21, 40)])), (21, 7))
    assert drawn.count('class="sc-outlier"') == 2
    assert drawn.count('<polyline') == 3
    assert charts.profile_svg(drawing(xyz, masked(xyz), along='column'), (21, 1)).count('<polyline') == 2


def test_a_long_profile_keeps_its_extremes():
    y, x = np.mgrid[:3, :5000].astype(np.float64)
    xyz = np.dstack([x, y, np.random.default_rng(0).random(x.shape)])
    xyz[1, 2345, 2] = 7
    drawn = charts.profile_svg(drawing(xyz, masked(xyz)), (1, 0))
    points = re.search('<polyline[^>]*points="([^"]*)"', drawn)[1].split()
    assert len(points) < 1500
    assert min(float(point.split(',')[1]) for point in points) < 20


def test_the_focus_curve_has_one_mark_per_frame_and_a_line_at_its_depth():
    z = np.linspace(-3e-6, 5e-6, 17)
    curve = FocusCurve(z, 900 * np.exp(-((z / 1e-6) ** 2)), 0.0, 0.9, ())
    drawn = charts.curve_svg(curve)
    assert drawn.count('<circle') == 17
    assert drawn.count('sc-cut') == 1
    assert 'z of the stage [µm]' in drawn
    assert charts.curve_svg(dataclasses.replace(curve, depth=np.nan)).count('sc-cut') == 0
    assert 'nan' not in charts.curve_svg(dataclasses.replace(curve, measure=0 * z))


def test_the_histogram_counts_each_outlier_also_one_beyond_its_range():
    xyz = surface()
    xyz[33, 44, 2] = 1e6
    mask = masked(xyz, [(33, 44)])
    assert charts.histogram_svg(drawing(xyz, mask)).count('class="sc-outlier"') == 1
    flat = xyz.copy()
    flat[..., 2] = np.where(np.isfinite(flat[..., 2]), 5, np.nan)
    assert charts.histogram_svg(drawing(flat, masked(flat))).count('class="sc-kept"') == 1
