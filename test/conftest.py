# SPDX-License-Identifier: Apache-2.0
"""What all tests share: a DDS domain for each test process, and the real measurements where they are."""

import os
import zlib
from pathlib import Path

import hypothesis
import pytest


def _own_domain() -> str:
    """A domain for this process: apart from the other workers, and likely from other runs on this machine."""
    run = os.environ.get('PYTEST_XDIST_TESTRUNUID', str(os.getpid()))
    worker = int(os.environ.get('PYTEST_XDIST_WORKER', 'gw0').removeprefix('gw'))
    return str(1 + zlib.crc32(run.encode()) % 12 * 8 + worker % 8)


# Before anything starts rclpy, here or in a process that a test starts.
os.environ['ROS_DOMAIN_ID'] = _own_domain()
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'


# The first call of a kernel compiles it, which no deadline of an example allows for.
hypothesis.settings.register_profile('socialcircle', deadline=None)
hypothesis.settings.load_profile('socialcircle')


def pytest_collection_modifyitems(items):
    """Begin with the long tests, lest one of them run alone at the end."""
    items.sort(key=lambda item: item.get_closest_marker('long') is None)


@pytest.fixture(scope='session')
def real_measurements() -> Path:
    folder = os.environ.get('SOCIALCIRCLE_DATA')
    if not folder:
        pytest.skip('SOCIALCIRCLE_DATA names no folder of real measurements')
    return Path(folder)
