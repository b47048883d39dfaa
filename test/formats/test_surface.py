# SPDX-License-Identifier: Apache-2.0
"""What is taken as a surface or a cloud for a file, and the pitch of a cloud."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from surfaces import same_bits

from socialcircle_ros.errors import CloudError, SettingError
from socialcircle_ros.formats import MeasuredSurface, OrganizedCloud, surface_of

Z = np.arange(20.0).reshape(4, 5) ** 2
POINTS = np.dstack([*np.meshgrid(np.arange(5.0), np.arange(4.0)), Z])


def test_masked_heights_are_not_measured():
    surface = MeasuredSurface(np.ma.masked_array(Z, Z == 9), (1, 1), 'm')
    assert same_bits(surface.heights, np.where(Z == 9, np.nan, Z))
    assert '1 not measured' in repr(surface)
    assert np.isnan(surface.cloud().points[0, 3, 2])
    assert Z[0, 3] == 9


def test_masked_points_are_not_measured():
    cloud = OrganizedCloud(np.ma.masked_array(POINTS, POINTS == 9), 'm')
    assert same_bits(cloud.points, np.where(POINTS == 9, np.nan, POINTS))


def test_masked_values_of_a_field_are_nan():
    fields = {'n': np.ma.masked_array(np.arange(20, dtype=np.uint8).reshape(4, 5), Z == 9), 'all': Z > 3}
    found = MeasuredSurface(Z, (1, 1), 'm', fields).fields
    assert same_bits(found['n'][0], np.array([0, 1, 2, np.nan, 4], np.float32))
    assert found['all'].dtype == bool


@given(data=st.data())
def test_heights_of_any_number_keep_their_values_and_the_pitch(data):
    kind = data.draw(st.sampled_from(('i1', '>u2', 'i4', '>i8', 'u8', 'f2', '>f4', 'f8')))
    heights = data.draw(hnp.arrays(kind, (2, 3), elements={'max_value': 99, 'min_value': 0}))
    surface = MeasuredSurface(heights.tolist() if data.draw(st.booleans()) else heights, (0.25, 0.5))
    assert surface.heights.dtype in (np.float32, np.float64)
    np.testing.assert_array_equal(surface.heights, heights)
    assert surface.cloud().points[1, 2, :2].tolist() == [0.5, 0.5]


def test_heights_in_a_type_that_fits_are_not_copied():
    assert MeasuredSurface(Z, (1, 1)).heights is Z


@pytest.mark.parametrize(
    ('heights', 'sentence'),
    [
        (Z[0], r'has the shape \(rows, columns\), not \(5,\)'),
        (POINTS, r'has the shape \(rows, columns\), not \(4, 5, 3\)'),
        (Z > 3, 'holds numbers, not bool: give 0 and 1 as numbers'),
        (Z.astype(complex), 'holds numbers, not complex128'),
        (Z.astype('M8[s]'), 'holds numbers, not datetime64'),
        ('text', 'holds numbers, not <U4'),
        (None, 'holds numbers, not object'),
        ([[1, 2], [3]], 'rows differ in their lengths'),
        (np.zeros((0, 5)), 'needs a point'),
        (np.full((2, 2), 2**60 + 1), 'subtract an offset'),
        (np.ma.masked_array([[2**60 + 1, 1]], [[False, True]]), 'lose digits'),
    ],
)
def test_what_is_no_height_map_is_refused(heights, sentence):
    with pytest.raises(CloudError, match=sentence):
        MeasuredSurface(heights, (1, 1))


@pytest.mark.parametrize('points', [Z, POINTS[..., :2], POINTS > 3])
def test_what_is_no_organized_cloud_is_refused(points):
    with pytest.raises(CloudError, match=r'An organized cloud (has the shape \(rows, columns, 3\)|holds numbers)'):
        OrganizedCloud(points)


@pytest.mark.parametrize(
    'pitch', [(-1, 1), (0, 1), (np.nan, 1), (np.inf, 1), (1, 2, 3), 1, ('1', '2'), '12', None, {1: 2, 2: 3}]
)
def test_what_is_no_pitch_is_refused(pitch):
    with pytest.raises(CloudError, match='The pitch is .*(give two numbers|above 0)'):
        MeasuredSurface(Z, pitch)


@pytest.mark.parametrize(
    ('fields', 'sentence'),
    [
        ({'q': Z[:2]}, r"'q' has the shape \(2, 5\); the points have \(4, 5\)"),
        ({'q': 5.0}, r"'q' has the shape \(\)"),
        ({'q': [[1], [2, 3]]}, "'q' cannot be used. Its rows differ"),
        ({'q': Z.astype('M8[s]')}, "'q' has datetime64"),
        ({'q': Z.astype(str)}, "'q' has <U32"),
        (
            {'q': np.ma.masked_array(np.full((4, 5), 2**60 + 1), Z == 9)},
            "'q' cannot be used. Masked whole",
        ),
        ({3: Z}, 'The field 3 has a name that is no text'),
        ([Z], 'as a dict, not list'),
    ],
)
def test_what_is_no_field_is_refused(fields, sentence):
    for made in (lambda: MeasuredSurface(Z, (1, 1), 'm', fields), lambda: OrganizedCloud(POINTS, 'm', fields)):
        with pytest.raises(CloudError, match=sentence):
            made()


@pytest.mark.parametrize('unit', [3, b'm', 'u\nm', '\udc80m'])
def test_a_unit_is_a_text_of_one_line(unit):
    for made in (lambda: MeasuredSurface(Z, (1, 1), unit), lambda: OrganizedCloud(POINTS, unit)):
        with pytest.raises(SettingError, match='give a text'):
            made()


def test_metadata_are_texts_by_name():
    assert MeasuredSurface(Z, (1, 1), metadata={'n': 3}).metadata == {'n': '3'}
    with pytest.raises(CloudError, match='as a dict, not list'):
        MeasuredSurface(Z, (1, 1), metadata=['n'])


@pytest.mark.parametrize('rows', [1, 4])
def test_a_stated_pitch_counts_where_the_coordinates_are_those_that_it_gives(rows):
    surface = MeasuredSurface(Z[:rows].astype(np.float32), (0.1234567890123, 0.7), 'm')
    assert surface_of(surface.cloud()).surface.pitch == surface.pitch
    moved = OrganizedCloud(surface.cloud().points * np.float32(2), 'm', pitch=surface.pitch)
    if rows == 1:
        assert surface_of(moved).surface.pitch == (0.24691358, 0.7)
    else:
        assert surface_of(moved).surface.pitch == (0.24691358, 1.4)


def test_a_cloud_with_one_row_and_no_pitch_has_none():
    with pytest.raises(CloudError, match='Too few points are measured to tell the pitch in y'):
        surface_of(OrganizedCloud(POINTS[:1]))


@pytest.mark.parametrize(
    ('moved', 'start', 'notes'),
    [
        (0.0, 0, ()),
        (5e-4, 0, ('x is off a regular grid by up to 0.0005 of its pitch; the file holds the grid.',)),
        (0.0, 5, ('x starts at 5; in the file it starts at 0.',)),
        (0.0, -5, ('x starts at -5; in the file it starts at 0.',)),
    ],
)
def test_what_a_height_map_does_not_hold_of_a_cloud_is_noted(moved, start, notes):
    points = POINTS + np.array([start, 0, 0])
    points[2, 3, 0] += moved
    assert surface_of(OrganizedCloud(points)).notes == notes


def test_points_far_off_a_regular_grid_are_refused():
    points = POINTS.copy()
    points[2, 3, 0] += 2e-3
    with pytest.raises(CloudError, match='off a regular grid by 0.002 of the pitch in x, and a height map'):
        surface_of(OrganizedCloud(points))
