# SPDX-License-Identifier: Apache-2.0
"""Headers and stamps."""

import pytest
from examples import cloud

from socialcircle_ros.errors import MessageError
from socialcircle_ros.messages.header import Header, readable_header, stamp_of, stamp_text


def test_a_stamp_is_split_and_joined():
    header = Header.at(5_000_000_007, 'camera')
    assert header == Header(5, 7, 'camera')
    assert header.stamp == 5_000_000_007


def test_a_stamp_is_written_with_nine_decimals():
    assert stamp_text(5_000_000_007) == '5.000000007'


def test_the_stamp_of_a_serialized_message_is_read():
    assert stamp_of(cloud(2, 3, stamp=5_000_000_007)) == 5_000_000_007
    with pytest.raises(MessageError, match='ends early'):
        stamp_of(b'\0\1\0\0\1')


def test_the_header_of_a_damaged_message_is_none():
    assert readable_header(cloud(2, 3, stamp=5_000_000_007)) == Header(5, 7, 'microscope')
    assert readable_header(b'\0\1\0\0\1') is None
