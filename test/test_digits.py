# SPDX-License-Identifier: Apache-2.0
"""Numbers and shares as text."""

import math

import pytest

from socialcircle_ros.digits import decimal_text, number_text, share_text, size_text, unlike_texts


@pytest.mark.parametrize(
    ('share', 'text'),
    [
        (0.0496, '4.96 %'),
        (0.0, '0 %'),
        (1.0, '100 %'),
        (3 / 307_084, '0.00098 %'),
        (307_199 / 307_200, '99.99967 %'),
        (1e-7, '0.000010 %'),
        (1e-9, '1.0 × 10⁻⁷ %'),
        (-1e-30, '−1.0 × 10⁻²⁸ %'),
        (1 - 2**-53, '99.999999999999986 %'),
        (-1.04, '−104.00 %'),
        (math.nan, '–'),
    ],
)
def test_only_nothing_is_0_percent_and_only_all_is_100(share, text):
    assert share_text(share) == text


@pytest.mark.parametrize(
    ('change', 'text'),
    [(-0.0003, '−0.030 %'), (0.0004, '+0.040 %'), (0.0, '0 %'), (0.123, '+12.3 %'), (1.0, '+100 %')],
)
def test_a_change_has_a_sign_and_a_true_minus(change, text):
    assert share_text(change, 1, signed=True) == text


@pytest.mark.parametrize(
    ('number', 'text'),
    [
        (13_117.0, '13,117'),
        (49.9, '49.9'),
        (-1.04, '−1.04'),
        (0.0000354, '0.0000354'),
        (3.54e-7, '3.54 × 10⁻⁷'),
        (-2.5e9, '−2.50 × 10⁹'),
        (0.0, '0'),
        (math.nan, '–'),
        (-math.inf, '−∞'),
    ],
)
def test_a_number_has_significant_digits_and_no_exponent_of_programs(number, text):
    assert number_text(number) == text


def test_zeros_at_the_end_stay_only_where_they_are_measured():
    assert (number_text(0.5, 4), number_text(0.5, 4, padded=False)) == ('0.5000', '0.5')
    assert number_text(2e-9, padded=False) == '2 × 10⁻⁹'


def test_a_small_number_does_not_become_0():
    assert [decimal_text(each, 2) for each in (12.3, 0.0012, 0.0, -0.001)] == [
        '12.30',
        '0.0012',
        '0.00',
        '−0.0010',
    ]


def test_a_very_small_number_has_a_power_of_ten_and_widens_no_table():
    assert [decimal_text(each, 2) for each in (1.2e-5, 1.2e-6, -1e-300)] == [
        '0.000012',
        '1.2 × 10⁻⁶',
        '−1.0 × 10⁻³⁰⁰',
    ]
    assert decimal_text(1.25e-7, 8) == '0.00000012'


def test_a_size_says_which_number_is_that_of_the_rows():
    assert size_text(480, 640) == '480 rows × 640 columns'


@pytest.mark.parametrize(
    ('one', 'other', 'texts'),
    [
        (0.1, 0.05, ('10.00 %', '5.00 %')),
        (0.99999, 1.0, ('99.99900 %', '100 %')),
        (0.123456, 0.123457, ('12.3456 %', '12.3457 %')),
        (1.01e-9, 1.02e-9, ('0.000000101 %', '0.000000102 %')),
        (0.5, 0.5, ('50.00 %', '50.00 %')),
    ],
)
def test_two_numbers_that_a_sentence_compares_are_alike_only_if_equal(one, other, texts):
    assert unlike_texts(one, other, share_text, 2) == texts
