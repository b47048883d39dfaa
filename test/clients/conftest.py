# SPDX-License-Identifier: Apache-2.0
import pytest

pytest.importorskip('rclpy', reason='live tests need ROS 2: source Jazzy, or pip install ".[ros]"')

from live import cell, shared_cell, start_cell  # noqa: F401 - fixtures
