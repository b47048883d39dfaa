# SPDX-License-Identifier: Apache-2.0
import os

import pytest

from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.studies.bench.two_hosts import two_hosts


@pytest.fixture(scope='session')
def two_hosts_possible(tmp_path_factory):
    """For tests that make two hosts; skips them where this machine cannot."""
    try:
        with two_hosts((['true'], ['true']), 0.5, tmp_path_factory.mktemp('hosts'), os.environ):
            pass
    except SocialCircleError as error:
        pytest.skip(str(error))
