# SPDX-License-Identifier: Apache-2.0
"""Lengths as a person reads them: one SI prefix that suits, the unit always said, never guessed."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.errors import SettingError
from socialcircle_ros.lengths import METRES, length_scale, length_text, metres_per, range_text, unit_name


def test_a_person_reads_the_sign_of_the_micrometre():
    assert [unit_name(unit) for unit in ('um', 'micron', 'mm', 'furlong')] == ['µm', 'µm', 'mm', 'furlong']


WORTH = {'m': 1.0, 'mm': 1e-3, 'µm': 1e-6, 'nm': 1e-9, 'pm': 1e-12}


def as_number(text):
    """The number that a text shows, with or without a power of ten."""
    return float(text.replace(' × 10', 'e').translate(str.maketrans('−⁻⁰¹²³⁴⁵⁶⁷⁸⁹', '--0123456789')))


@pytest.mark.parametrize(
    ('value', 'unit', 'text'),
    [
        (12.4123, 'um', '12.4 µm'),
        (-3, 'nm', '−3 nm'),
        (-0.003, 'µm', '−3 nm'),
        (1e-4, 'm', '100 µm'),
        (999.6, 'nm', '1 µm'),
        (25.4, 'inch', '645 mm'),
        (2, 'Å', '200 pm'),
        (1234567.0, 'm', '1234567 m'),
        (0, 'um', '0 µm'),
        (-0.0, 'cm', '0 m'),
        (float('nan'), 'm', '– m'),
        (12.5, None, '12.5 (unit not known)'),
        (13_117.0, None, '13,117 (unit not known)'),
        (-0.0, None, '0 (unit not known)'),
        (2.5e-7, 'furlong', '2.5 × 10⁻⁷ furlong'),
        (1e-20, 'm', '1 × 10⁻⁸ pm'),
        (-3.2, 'px', '−3.2 px'),
    ],
)
def test_a_length_has_a_prefix_that_suits_it_and_its_unit(value, unit, text):
    assert length_text(value, unit) == text


@given(st.floats(1e-11, 9e2), st.sampled_from(sorted(METRES)), st.booleans())
def test_a_text_is_the_length_to_three_digits_with_one_to_three_digits_before_the_point(metres, unit, negative):
    value = (-metres if negative else metres) / METRES[unit]
    number, name = length_text(value, unit).split(' ')
    shown = float(number.replace('−', '-'))
    assert shown * WORTH[name] == pytest.approx(value * METRES[unit], rel=5.001e-3)
    assert 1 <= abs(shown) < 1000


@given(
    st.lists(st.floats(-1e3, 1e3, allow_subnormal=False), min_size=1),
    st.sampled_from(sorted(METRES)),
    st.booleans(),
)
def test_a_series_has_the_prefix_of_its_largest_value_and_no_value_becomes_zero(values, unit, has_nan):
    scale = length_scale([*values, *[np.nan] * has_nan], unit)
    for value in values:
        if abs(value) * METRES[unit] > 1e-15:
            shown = as_number(scale.number(value)) * WORTH[scale.name]
            assert shown == pytest.approx(value * METRES[unit], rel=0.051)
    largest = max(map(abs, values)) * METRES[unit]
    if largest >= 1e-12:
        assert largest / WORTH[scale.name] >= 1 - 1e-5
        assert largest / WORTH[scale.name] < 1000 or scale.name == 'm'


def test_all_numbers_of_a_series_have_the_decimals_of_the_largest_and_nan_is_a_dash():
    scale = length_scale([0, 3.21e-4, np.nan, np.inf], 'm')
    assert [scale.number(each) for each in (0, 3.21e-4, -2e-5, np.nan)] == ['0.0', '321.0', '−20.0', '–']
    assert (scale.text(1e-7), scale.label('x')) == ('0.10 µm', 'x [µm]')


def test_without_a_unit_it_is_said_and_a_power_of_ten_keeps_the_numbers_short():
    assert length_scale([3.5], None).label('z') == 'z [unit not known]'
    small = length_scale([0, 2e-5], None)
    assert (small.label('x'), small.number(2e-5)) == ('x [10⁻⁶; unit not known]', '20.00')
    assert length_scale([2e-5], 'px').label('x') == 'x [10⁻⁶ px]'


@pytest.mark.parametrize(
    ('low', 'high', 'unit', 'text'),
    [
        (-4.82018e-7, 3.4748e-7, 'm', '−482.018 to 347.48 nm'),
        (0, 400, 'um', '0 to 400 µm'),
        (1, 1.1, None, '1 to 1.1 (unit not known)'),
        (-9.999999e-4, 0.5e-3, 'm', '−1 to 0.5 mm'),
    ],
)
def test_a_range_has_one_prefix(low, high, unit, text):
    assert range_text(low, high, unit) == text


def test_a_unit_that_is_not_known_has_no_size():
    for unit in (None, 'furlong'):
        with pytest.raises(SettingError, match='--unit'):
            metres_per(unit)


@pytest.mark.parametrize(
    ('low', 'high', 'label', 'texts'),
    [
        (0, 3.2e-4, 'x [µm]', ['0', '80', '160', '240', '320']),
        (-2e-9, 2e-9, 'x [nm]', ['−2', '−1', '0', '1', '2']),
        (1e-3, 1.0005e-3, 'x [mm]', ['1.000000', '1.000125', '1.000250', '1.000375', '1.000500']),
    ],
)
def test_ticks_of_an_axis_have_one_prefix_and_the_decimals_that_tell_them_apart(low, high, label, texts):
    pytest.importorskip('matplotlib')
    from matplotlib.figure import Figure

    axis = Figure().subplots().xaxis
    axis.set_ticks(np.linspace(low, high, 5))
    length_scale([low, high], 'm').label_axis(axis, 'x')
    assert axis.get_major_formatter().format_ticks(axis.get_majorticklocs()) == texts
    assert axis.get_label_text() == label


def test_lengths_below_every_unit_widen_no_table():
    scale = length_scale([1e-6, 1e-20], 'm')
    assert (scale.number(1e-20), scale.decimals_of([1e-20])) == ('1.0 × 10⁻¹⁴', 6)
    assert length_scale([1e-20], 'm').text(1e-20) == '1.0 × 10⁻⁸ pm'
