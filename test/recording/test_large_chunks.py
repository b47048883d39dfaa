# SPDX-License-Identifier: Apache-2.0
"""Large chunks give the same messages, and the same damage, as small ones, which are read in another way."""

import os
import zlib
from unittest.mock import patch

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recording.samples import read, some_messages, write_mcap

from socialcircle_ros.recording import Message, mcap_file, open_recording
from socialcircle_ros.recording.large_chunks import LARGE


def read_as_if(large, path):
    """What is read if chunks from `large` bytes count as large."""
    with patch.object(mcap_file, 'LARGE', large):
        return read(path)


@settings(max_examples=150, deadline=None)
@given(
    compression=st.sampled_from(['NONE', 'NONE', 'NONE', 'LZ4']),
    chunk_size=st.integers(1, 600),
    checked=st.booleans(),
    place=st.floats(0, 1, exclude_max=True),
    change=st.sampled_from(['nothing', 'a byte', 'a cut', 'zeros']),
    value=st.integers(0, 255),
)
def test_sound_and_damaged_chunks_are_read_alike(
    tmp_path_factory, compression, chunk_size, checked, place, change, value
):
    path = tmp_path_factory.mktemp('large') / 'a.mcap'
    messages = some_messages(12, size=60)
    write_mcap(path, messages, chunk_size=chunk_size, compression=compression, enable_crcs=checked)
    content = bytearray(path.read_bytes())
    at = int(place * len(content))
    if change == 'a byte':
        content[at] = value
    elif change == 'a cut':
        del content[at:]
    elif change == 'zeros':
        content[at : at + 40] = bytes(len(content[at : at + 40]))
    if content[:8] != path.read_bytes()[:8]:
        return  # no MCAP file any more
    path.write_bytes(content)
    found = read_as_if(0, path)
    assert found == read_as_if(1 << 40, path)
    assert change != 'nothing' or found == (messages, None)


def test_the_data_of_a_large_message_are_not_cut_out_of_its_chunk(tmp_path):
    messages = [Message('/points', bytes([number]) * (LARGE + 7), number, number, number) for number in range(3)]
    path = write_mcap(tmp_path / 'a.mcap', messages)
    with patch.object(mcap_file.McapFile, '_records', side_effect=AssertionError):
        assert read(path) == (messages, None)


def test_a_large_message_knows_the_checksum_of_its_data_until_the_data_is_replaced(tmp_path):
    sent = Message('/points', os.urandom(LARGE), 1, 1, 0)
    with open_recording(write_mcap(tmp_path / 'a.mcap', [sent], enable_crcs=False)) as reader:
        (message,) = reader.messages()
    assert message.checksum == zlib.crc32(sent.data)
    assert message._replace(data=b'other').checksum is None


@pytest.mark.parametrize('rest', [0, 30, 60, 75, 1000])
def test_a_file_that_becomes_shorter_while_it_is_read_is_damaged(tmp_path, rest):
    messages = [Message('/points', bytes([number]) * LARGE, number, number, number) for number in range(2)]
    path = write_mcap(tmp_path / 'a.mcap', messages, enable_crcs=False)
    with open_recording(path) as reader:
        (file,) = reader._files
        os.truncate(path, file.spans[1].offset + rest)
        assert list(reader.messages()) == messages[:1]
        assert 'is damaged in the record that begins at byte' in reader.damage
