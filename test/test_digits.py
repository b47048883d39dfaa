# SPDX-License-Identifier: Apache-2.0
"""Numbers and shares as text."""

import math

import pytest

from socialcircle_ros.digits import decimal_text, number_text, share_text, size_text


@pytest.mark.parametrize(
    ('share', 'text'),
    [
        (0.0496, '4.96 %'),
        (0.0, '0 %'),
        (1.0, '100 %'),
        (3 / 307_084, '0.00098 %'),
        (307_199 / 307_200, '99.99967 %'),
        (1e-9, '0.00000010 %'),
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


def test_a_size_says_which_number_is_that_of_the_rows():
    assert size_text(480, 640) == '480 rows × 640 columns'
