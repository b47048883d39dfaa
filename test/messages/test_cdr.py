# SPDX-License-Identifier: Apache-2.0
"""CDR as ROS 2 writes it."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.errors import MessageError
from socialcircle_ros.messages.cdr import CdrReader, CdrWriter

VALUES = st.lists(
    st.one_of(
        st.tuples(st.just('uint8'), st.integers(0, 255)),
        st.tuples(st.just('boolean'), st.booleans()),
        st.tuples(st.just('int32'), st.integers(-(2**31), 2**31 - 1)),
        st.tuples(st.just('uint32'), st.integers(0, 2**32 - 1)),
        st.tuples(st.just('float64'), st.floats(allow_nan=False)),
        st.tuples(st.just('string'), st.text(st.characters(exclude_characters='\0', exclude_categories=['Cs']))),
    )
)


@given(VALUES)
def test_written_values_are_read_back(values):
    writer = CdrWriter()
    for kind, value in values:
        getattr(writer, kind)(value)
    reader = CdrReader(writer.finish())
    assert [getattr(reader, kind)() for kind, _ in values] == [value for _, value in values]


@given(VALUES.filter(bool), st.data())
def test_a_message_that_is_cut_short_is_refused(values, data):
    writer = CdrWriter()
    for kind, value in values:
        getattr(writer, kind)(value)
    message = writer.finish()
    with pytest.raises(MessageError):
        reader = CdrReader(message[: data.draw(st.integers(0, len(message) - 1))])
        for kind, _ in values:
            getattr(reader, kind)()


def test_numbers_are_aligned_to_their_size_from_the_end_of_the_header():
    writer = CdrWriter()
    writer.uint8(1)
    writer.float64(1.0)
    assert writer.finish() == b'\0\1\0\0' + b'\1' + bytes(7) + bytes(6) + b'\xf0\x3f'


def test_big_endian_messages_are_read():
    assert CdrReader(b'\0\0\0\0' + b'\0\0\1\2').uint32() == 258


@pytest.mark.parametrize('data', [b'', b'\0\1', b'\0\7\0\0', b'\1\1\0\0'])
def test_other_encodings_are_refused(data):
    with pytest.raises(MessageError, match='not plain CDR'):
        CdrReader(data)


def test_a_length_beyond_the_message_is_refused_before_memory_is_allocated():
    writer = CdrWriter()
    writer.uint32(4_000_000_000)
    with pytest.raises(MessageError, match='4000000000 more bytes follow, but only 0 do'):
        CdrReader(writer.finish()).octets()


def test_bytes_that_are_not_utf_8_are_written_back_unchanged():
    writer = CdrWriter()
    writer.octets(b'caf\xe9\0')
    again = CdrWriter()
    again.string(CdrReader(writer.finish()).string())
    assert again.finish() == writer.finish()
