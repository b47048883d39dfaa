"""Kernels on several threads."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.compiled import in_bands


@given(height=st.integers(1, 50), threads=st.integers(1, 5))
def test_bands_cover_every_row_once_and_answer_in_order(height, threads):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr('os.cpu_count', lambda: threads)
        patch.setattr('socialcircle_ros.compiled._PIXELS_PER_THREAD', 10)
        bands = in_bands(lambda band: list(range(height))[band], height, 10)
    assert [row for band in bands for row in band] == list(range(height))
    assert len(bands) == min(threads, height)
