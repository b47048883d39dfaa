# SPDX-License-Identifier: Apache-2.0
"""Clouds are joined with their results, in any order of arrival."""

import itertools

import numpy as np
import pytest
from examples import cloud

from socialcircle_ros.clients import matching
from socialcircle_ros.clients.matching import CloudMatcher
from socialcircle_ros.errors import MessageError
from socialcircle_ros.interface import MeasurementValues
from socialcircle_ros.messages.diagnostics import OK, Status
from socialcircle_ros.messages.header import Header, stamp_text
from socialcircle_ros.messages.image import encode_image

STAMP = 5_000_000_007


def mask_message(stamp=STAMP, value=0):
    return encode_image(Header.at(stamp, ''), np.full((2, 3), value, np.uint8))


def measurement_message(stamp=STAMP, outliers=0):
    values = MeasurementValues(stamp_text(stamp), 6, 6, 6 - outliers, outliers, 0, 1, 1, 0.5)
    return Status(OK, 'measurement', 'done', values=values.to_text()).encode()


def parts(stamp=STAMP):
    return [
        (CloudMatcher.add_cloud, cloud(2, 3, stamp=stamp)),
        (CloudMatcher.add_mask, mask_message(stamp)),
        (CloudMatcher.add_measurement, measurement_message(stamp)),
    ]


@pytest.mark.parametrize('order', list(itertools.permutations(range(3))))
def test_a_match_is_complete_with_its_last_part(order):
    matcher = CloudMatcher()
    first, second, third = (parts()[place] for place in order)
    assert first[0](matcher, first[1]) is None
    assert second[0](matcher, second[1]) is None
    match = third[0](matcher, third[1])
    assert match.cloud == cloud(2, 3, stamp=STAMP)
    assert match.mask.shape == (2, 3)
    assert MeasurementValues.from_text(match.measurement.values).stamp == '5.000000007'


def test_results_of_another_cloud_do_not_match():
    matcher = CloudMatcher()
    matcher.add_cloud(cloud(2, 3, stamp=STAMP))
    matcher.add_mask(mask_message(STAMP))
    assert matcher.add_measurement(measurement_message(STAMP + 1)) is None


def test_a_cloud_that_is_filtered_again_matches_its_new_results_only():
    matcher = CloudMatcher()
    for add, message in parts():
        add(matcher, message)
    assert matcher.add_mask(mask_message(value=255)) is None
    match = matcher.add_measurement(measurement_message(outliers=6))
    assert (match.mask == 255).all()
    assert MeasurementValues.from_text(match.measurement.values).outliers == 6


def test_old_clouds_are_dropped(monkeypatch):
    monkeypatch.setattr(matching, '_MOST_CLOUDS', 2)
    matcher = CloudMatcher()
    for stamp in (1, 2, 3):
        matcher.add_cloud(cloud(2, 3, stamp=stamp))
    for stamp, is_kept in ((1, False), (2, True), (3, True)):
        matcher.add_mask(mask_message(stamp))
        assert (matcher.add_measurement(measurement_message(stamp)) is not None) == is_kept


@pytest.mark.parametrize('add', [CloudMatcher.add_cloud, CloudMatcher.add_mask, CloudMatcher.add_measurement])
def test_a_message_that_ends_early_is_refused(add):
    with pytest.raises(MessageError):
        add(CloudMatcher(), b'\0\1\0\0\1')


def test_a_status_that_is_no_measurement_is_refused():
    with pytest.raises(MessageError, match='not a measurement'):
        CloudMatcher().add_measurement(Status(OK, 'other', '').encode())
