# SPDX-License-Identifier: Apache-2.0
import pytest

from socialcircle_ros.studies.bench.two_hosts import why_impossible


@pytest.fixture(scope='session')
def two_hosts_possible():
    """For tests that make two hosts; skips them where this machine cannot."""
    reason = why_impossible()
    if reason:
        pytest.skip(reason)
