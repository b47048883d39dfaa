# SPDX-License-Identifier: Apache-2.0
"""The checksum of two parts is that of the whole."""

import zlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.recording.checksums import joined_checksum


@given(first=st.binary(max_size=300), second=st.binary(max_size=300), repeats=st.sampled_from([0, 1, 7, 1000]))
def test_the_checksum_of_two_parts_is_that_of_both_together(first, second, repeats):
    second *= repeats
    joined = joined_checksum(zlib.crc32(first), zlib.crc32(second), len(second))
    assert joined == zlib.crc32(first + second)


@pytest.mark.parametrize('size', [2**25, 2**25 + 1])
def test_the_second_part_may_be_large(size):
    first, second = b'\xff' * 9, bytes(size)
    joined = joined_checksum(zlib.crc32(first), zlib.crc32(second), len(second))
    assert joined == zlib.crc32(second, zlib.crc32(first))
