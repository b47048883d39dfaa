# SPDX-License-Identifier: Apache-2.0
"""The numbers of the measurement of a cloud."""

import dataclasses

import numpy as np
import pytest
from examples import cloud

from socialcircle_ros.interface import MeasurementValues
from socialcircle_ros.messages.diagnostics import OK, Status
from socialcircle_ros.panel.link import ShownCloud

NUMBERS = MeasurementValues('1.000000000', 5600, 5594, 5568, 26, 0, 39, 50, 2.25)


def shown(values):
    return ShownCloud(1, cloud(), np.zeros((1, 1), np.uint8), Status(OK, 'name', 'message', '', values))


def test_the_numbers_are_read_from_the_measurement():
    assert shown(NUMBERS.to_text()).numbers == NUMBERS


def test_the_depth_of_field_is_the_one_of_the_stack_and_not_the_parameter():
    parameter = {'circle.depth_of_field': '100.0'}
    of_a_stack = dataclasses.replace(NUMBERS, stack_depth_of_field=6e-6)
    assert shown(NUMBERS.to_text() | parameter).depth_of_field is None
    assert shown(of_a_stack.to_text() | parameter).depth_of_field == 6e-6


@pytest.mark.parametrize(
    'broken',
    [
        {'outliers': 'many'}, {'stack_depth_of_field': 'x'}, {'radius': ''}, {'measured': '9' * 5000},
        {'measured': str(2**63)}, {'seed_row': str(-(2**63) - 1)},
    ],
)  # fmt: skip
def test_a_measurement_that_cannot_be_read_has_no_numbers(broken):
    read = shown(NUMBERS.to_text() | broken)
    assert read.numbers is None
    assert read.depth_of_field is None


def test_a_measurement_without_a_key_has_no_numbers():
    values = NUMBERS.to_text()
    del values['kept']
    assert shown(values).numbers is None
    assert ShownCloud(1, cloud(), np.zeros((1, 1), np.uint8), None).numbers is None
