# SPDX-License-Identifier: Apache-2.0
"""Message classes by the names that recordings hold."""

import importlib

from socialcircle_ros.errors import RecordingError


def message_class(type_name: str) -> type:
    """Import the Python class of a message type.

    Args:
        type_name: such as `sensor_msgs/msg/PointCloud2`.

    Raises:
        RecordingError: the package of the type is not installed.
    """
    package, _, name = type_name.replace('/msg/', '/').partition('/')
    try:
        found = getattr(importlib.import_module(f'{package}.msg'), name)
    except (ImportError, AttributeError, TypeError, ValueError):  # TypeError: the recording names no type
        found = None
    if not isinstance(found, type):
        raise RecordingError(
            f'Type {type_name!r} is not installed here; install its package, or leave its topic out.'
        )
    return found
