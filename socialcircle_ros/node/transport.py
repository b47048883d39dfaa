# SPDX-License-Identifier: Apache-2.0
"""Settings that make large clouds fast over DDS, made in our own processes before rclpy starts.

Measured at 1280×960 points: a cloud of 20 MB does not fit the shared memory segment of Fast DDS as shipped. It
goes through UDP on loopback in fragments, and clouds are lost from 20 Hz on. In addition, glibc gives each large
block back to the system, so that every cloud pays for its pages again.
"""

import importlib.metadata
import os
from pathlib import Path

from socialcircle_ros.kernels.memory import keep_freed_memory

PROFILE = Path(__file__).with_name('fastdds.xml')
"""For clouds that stay on one machine; the default of the node."""

NETWORK_PROFILE = Path(__file__).with_name('fastdds_network.xml')
"""For the publishers of clouds that cross a network; docs/network.md says when."""

_FAST_DDS_2, _FAST_DDS_3 = 'FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE'
_CHOSEN_BY_USER = (_FAST_DDS_2, _FAST_DDS_3, 'FASTDDS_BUILTIN_TRANSPORTS')
_KILTED = 9  # major version of its rclpy


def prepare_process() -> None:
    """Set transport and allocator for large messages; settings of the user stay."""
    use_large_segment()
    keep_freed_memory()


def use_large_segment() -> None:
    """Give Fast DDS a shared memory segment that holds several clouds, by the profile of this package."""
    other_middleware = 'fastrtps' not in os.environ.get('RMW_IMPLEMENTATION', 'rmw_fastrtps_cpp')
    if not other_middleware and not any(name in os.environ for name in _CHOSEN_BY_USER):
        os.environ[_profile_variable()] = str(PROFILE)


def _profile_variable() -> str:
    """The variable that names a profile: Kilted, with Fast DDS 3, warns of that of Jazzy at each start."""
    try:
        major = int(importlib.metadata.version('rclpy').partition('.')[0])
    except (importlib.metadata.PackageNotFoundError, ValueError):
        return _FAST_DDS_2
    return _FAST_DDS_3 if major >= _KILTED else _FAST_DDS_2
