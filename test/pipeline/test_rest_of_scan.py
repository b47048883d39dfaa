# SPDX-License-Identifier: Apache-2.0
"""Which frames belong to the rest of a scan."""

import pytest

from socialcircle_ros.pipeline.rest_of_scan import RestOfScan


@pytest.mark.parametrize(
    ('period', 'frames', 'stamps', 'taken'),
    [
        (10, 0, [130, 140, 219, 299], [True, True, True, False]),  # until a pause of eight periods
        (10, 5, [130, 140, 150, 160], [True, True, False, False]),  # until the last of five frames, at 140
        (10, 0, [99], [False]),  # a replay that begins again
        (10, 0, [100], [False]),  # one that begins with the same frame
        (0, 0, [121], [False]),  # no frame can be told from those of the next scan
    ],
)
def test_the_rest_ends_with_a_pause_with_the_frames_of_the_scan_or_where_time_begins_again(
    period, frames, stamps, taken
):
    rest = RestOfScan(first=100, last=120, period=period, frames=frames)
    assert [rest.takes(stamp) for stamp in stamps] == taken
