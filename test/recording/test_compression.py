# SPDX-License-Identifier: Apache-2.0
"""Decompression in bounded memory."""

import os
import random
import tracemalloc

import lz4.frame
import pytest
import zstandard
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.errors import RecordingError, SettingError
from socialcircle_ros.recording.compression import (
    LIMIT_VARIABLE,
    ExpansionError,
    expand,
    expand_file,
    expand_message,
    expansion_limit,
)

PACK = {'lz4': lz4.frame.compress, 'zstd': zstandard.compress}
methods = st.sampled_from(sorted(PACK))


@given(data=st.binary(max_size=3000), method=methods)
def test_what_is_compressed_is_expanded(data, method):
    assert expand(PACK[method](data), method, len(data)) == data
    assert expand_message(zstandard.compress(data)) == data


@given(data=st.binary(min_size=1, max_size=3000), method=methods, size=st.integers(0, 2999))
def test_no_more_than_the_stated_size_and_a_byte_is_expanded(data, method, size):
    assert expand(PACK[method](data), method, size) == data[: size + 1]


@given(data=st.binary(max_size=3000), method=methods, cut=st.floats(0, 1))
def test_the_beginning_of_what_is_cut_off_is_expanded(data, method, cut):
    packed = PACK[method](data)
    try:
        found = expand(packed[: int(cut * len(packed))], method, len(data))
    except (RuntimeError, zstandard.ZstdError):
        return
    assert data.startswith(found)


@given(data=st.binary(min_size=1, max_size=3000), cut=st.floats(0, 1))
def test_a_message_that_is_damaged_stays_as_it_is(data, cut):
    packed = zstandard.compress(data)
    part = packed[: int(cut * len(packed))]
    assert expand_message(part) == (data if part == packed else part)


@given(garbage=st.binary(max_size=60))
def test_garbage_that_begins_like_a_compressed_message_raises_nothing(garbage):
    assert isinstance(expand_message(b'\x28\xb5\x2f\xfd' + garbage), bytes)


@pytest.mark.parametrize('method', PACK)
def test_what_would_fill_the_memory_is_refused_before_it_is_expanded(method, monkeypatch):
    packed = PACK[method](bytes(10**8))
    tracemalloc.start()
    assert len(expand(packed, method, 1000)) == 1001
    monkeypatch.setenv(LIMIT_VARIABLE, '5')
    with pytest.raises(ExpansionError, match=r'expands to 100 MB, above the limit of 5 MB, which SOCIAL'):
        expand(packed, method, 10**8)
    if method == 'zstd':
        assert expand_message(packed) == packed
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2e6
    monkeypatch.setenv(LIMIT_VARIABLE, '100')
    assert expand(packed, method, 10**8) == bytes(10**8)


@pytest.mark.parametrize('given', ['0', '-1', 'much', 'nan', 'inf'])
def test_a_limit_that_is_no_positive_number_is_refused(given, monkeypatch):
    monkeypatch.setenv(LIMIT_VARIABLE, given)
    with pytest.raises(SettingError, match=LIMIT_VARIABLE):
        expansion_limit()


def test_a_file_is_expanded_up_to_its_damage(tmp_path):
    data = os.urandom(10**6)
    packed = zstandard.compress(data)
    path = tmp_path / 'a.mcap.zstd'
    for content in (packed, packed + b'x' * 20, packed[:500_000]):
        path.write_bytes(content)
        with expand_file(path.open('rb'), path) as file:
            found = file.read()
        assert data.startswith(found)
        assert len(found) >= min(len(content), len(data)) - 300_000
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_that_expands_beyond_all_measure_is_refused(tmp_path, monkeypatch):
    monkeypatch.setenv(LIMIT_VARIABLE, '1')
    path = tmp_path / 'a.mcap.zstd'
    path.write_bytes(zstandard.compress(bytes(10**7)))
    with pytest.raises(RecordingError, match=r'a\.mcap\.zstd expands to more than 1 MB: .*zstd -d'):
        expand_file(path.open('rb'), path)


@pytest.mark.parametrize(('times', 'fits'), [(90, True), (120, False)])
def test_a_file_may_expand_a_hundredfold_whatever_the_limit(tmp_path, monkeypatch, times, fits):
    monkeypatch.setenv(LIMIT_VARIABLE, '0.001')
    path, data = tmp_path / 'a.mcap.zstd', random.Random(0).randbytes(10_000) * times
    path.write_bytes(zstandard.compress(data))
    if fits:
        with expand_file(path.open('rb'), path) as file:
            assert file.read() == data
    else:
        with pytest.raises(RecordingError, match='expands to more than 1 MB'):
            expand_file(path.open('rb'), path)
