# SPDX-License-Identifier: Apache-2.0
"""Pictures of a cloud before and after the filter."""

import io

import numpy as np
import pytest
from examples import surface

from socialcircle_ros.pictures import style
from socialcircle_ros.pictures.drawings import CloudPictures, before_and_after

matplotlib_image = pytest.importorskip('matplotlib.image')
Image = pytest.importorskip('PIL.Image')

RED, BLACK, AMBER, VIOLET, GRAY, ORANGE = (
    tuple(int(colour[at : at + 2], 16) for at in (1, 3, 5))
    for colour in (
        style.OUTLIER, style.FALSE_POSITIVE, style.FALSE_NEGATIVE, style.UNDECIDED, style.KEPT, style.NOT_MEASURED,
    )
)  # fmt: skip


def pixels(png):
    with Image.open(io.BytesIO(png)) as image:
        return np.asarray(image.convert('RGB')).astype(int)


def count(png, colour):
    """Number of pixels close to a colour; the palette of a picture rounds colours."""
    return int((np.abs(pixels(png) - colour).max(axis=2) <= 12).sum())


def spiked(shape=(70, 80)):
    xyz = surface(*shape)
    outliers = np.zeros(shape, bool)
    outliers[11:13, 13:17] = True
    xyz[outliers, 2] = 9
    return xyz, outliers


@pytest.mark.parametrize('shape', [(70, 80), (1700, 300)])
def test_outliers_are_red_even_in_a_thinned_picture(tmp_path, shape):
    xyz, outliers = spiked(shape)
    before_and_after(tmp_path / 'new' / 'picture.png', xyz, outliers, 'a title', 'um')
    found = matplotlib_image.imread(tmp_path / 'new' / 'picture.png')[..., :3]
    assert ((found[..., 0] > 0.8) & (found[..., 1] < 0.1) & (found[..., 2] < 0.1)).any()


def test_a_cloud_without_a_kept_point_can_be_drawn(tmp_path):
    xyz = surface()
    before_and_after(tmp_path / 'picture.png', xyz, np.isfinite(xyz[..., 2]), 'nothing left')
    assert (tmp_path / 'picture.png').stat().st_size > 0


def test_kept_points_have_the_same_colours_before_and_after():
    xyz, outliers = spiked()
    drawn = CloudPictures(xyz, outliers, 'mm')
    before, after = pixels(drawn.before()), pixels(drawn.after())
    assert before.shape == after.shape
    changed = np.abs(before - after).max(axis=2)[60:-60, 120:-200] > 40
    assert 0 < changed.mean() < 0.02
    assert count(drawn.after(), ORANGE) > count(drawn.before(), ORANGE)


def test_outliers_do_not_widen_the_colour_range():
    xyz, outliers = spiked()
    low, high = CloudPictures(xyz, outliers).colour_range
    assert (low, high) == CloudPictures(xyz, outliers, colours=(low, high)).colour_range
    assert high < 1.2


def test_true_and_false_and_undecided_points_have_their_own_colours():
    xyz, outliers = spiked()
    truth, counted = np.roll(outliers, 2, axis=1), np.ones_like(outliers)
    plain = CloudPictures(xyz, outliers).against_truth(truth, counted)
    for colour in (RED, BLACK, AMBER, GRAY):
        assert count(plain, colour) > 20
    assert not count(plain, VIOLET)
    counted[:, :30] = False
    undecided = CloudPictures(xyz, outliers).against_truth(truth, counted)
    assert count(undecided, VIOLET) > 1000
    assert not count(undecided, RED)


def test_the_worst_outlier_is_the_one_farthest_from_the_surface():
    xyz, outliers = spiked()
    xyz[50, 60, 2], outliers[50, 60] = -40, True
    worst = CloudPictures(xyz, outliers).worst
    assert (worst.row, worst.column) == (50, 60)
    assert worst.height == pytest.approx(-40, abs=1.5)
    assert CloudPictures(xyz, np.zeros_like(outliers)).worst is None


@pytest.mark.parametrize(
    ('heights', 'unit', 'removed'),
    [
        (np.full((3, 4), np.nan), None, False),
        (np.full((3, 4), 5.0), 'm', True),
        (np.array([[-3e38, 3e38, 1.0]], 'f4'), None, False),
        (np.full((1, 1), 2.0), 'um', True),
        (1e-9 * np.arange(6.0).reshape(2, 3) + 7, 'mm', False),
    ],
)
def test_any_heights_can_be_drawn(heights, unit, removed):
    y, x = np.mgrid[: heights.shape[0], : heights.shape[1]]
    xyz = np.dstack([1e-6 * x, 3e-6 * y, heights]).astype(heights.dtype)
    drawn = CloudPictures(xyz, np.isfinite(heights) & removed, unit)
    pictures = drawn.before(), drawn.difference(), drawn.histogram()
    assert len({pixels(png).shape for png in pictures}) == 1
    assert pixels(drawn.profile()).std() > 0


def test_two_modes_are_drawn_side_by_side_with_what_the_truth_leaves_undecided(tmp_path):
    xyz, outliers = spiked()
    undecided = np.zeros_like(outliers)
    undecided[30:40, 20:30] = True
    by_mode = {'adaptive': outliers, 'paper': np.zeros_like(outliers)}
    counts = []
    for name, truth in (('plain.png', None), ('truth.png', undecided)):
        before_and_after(tmp_path / name, xyz, outliers, 'a title', 'um', by_mode, truth)
        counts.append(count((tmp_path / name).read_bytes(), VIOLET))
    assert counts[0] < counts[1] > 500


def test_panels_say_which_mode_they_show_and_which_colour_outliers_have():
    xyz, outliers = spiked()
    undecided = np.zeros_like(outliers)
    undecided[11:20, 13:15] = True  # 4 of the 8 outliers
    drawn = CloudPictures(xyz, outliers, 'um')
    figure = drawn.side_by_side('a title', {'adaptive': outliers, 'paper': ~outliers}, undecided)
    titles = [axes.get_title() for axes in figure.axes]
    assert titles[1] == 'adaptive: 8 outliers, 4 in red;\nviolet: undecided by the truth, with 4 outliers'
    assert titles[3] == 'filtered, adaptive; orange: no point'
    plain = [axes.get_title() for axes in drawn.side_by_side('a title').axes]
    assert plain[1:3] == ['8 outliers in red', 'filtered; orange: no point']


def test_a_single_removed_point_near_the_surface_can_be_seen_in_the_difference():
    xyz = surface(500, 500)
    xyz[..., 2] += np.arange(500)  # a form far higher than the outlier
    outliers = np.zeros((500, 500), bool)
    outliers[200, 100] = True
    none = pixels(CloudPictures(xyz, np.zeros_like(outliers), 'um').difference())
    drawn = CloudPictures(xyz, outliers, 'um')
    found = pixels(drawn.difference())
    assert abs(drawn.worst.height) < 10
    map_only = np.s_[:, : found.shape[1] // 2]
    coloured = [np.ptp(each[map_only], axis=2) > 60 for each in (none, found)]
    assert np.count_nonzero(coloured[1]) >= np.count_nonzero(coloured[0]) + 9
