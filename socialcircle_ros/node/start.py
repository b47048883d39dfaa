# SPDX-License-Identifier: Apache-2.0
"""Starts ROS in a process, or says in a sentence why it cannot start."""

import rclpy
from rclpy.context import Context
from rclpy.signals import SignalHandlerOptions

from socialcircle_ros.errors import SocialCircleError


def start_ros(
    arguments: list[str] | None = None, context: Context | None = None, signals: SignalHandlerOptions | None = None
) -> None:
    """Initialize a context of rclpy.

    Args:
        arguments: of ROS, as on the command line; None: those of this process.
        context: the context; None: the default one.
        signals: which signals rclpy handles; None: as it does by default for the context.

    Raises:
        SocialCircleError: ROS cannot start, for arguments that it cannot read or a log that it cannot write.
    """
    try:
        rclpy.init(args=arguments, context=context, signal_handler_options=signals)
    except RuntimeError as error:
        # The first of its lines says what is wrong; the others are places in the source of rcl.
        reason = str(error).splitlines()[0]
        cure = ' Set ROS_LOG_DIR to a folder that can be written.' if '/log' in reason or '.log' in reason else ''
        raise SocialCircleError(f'{reason.rstrip(".")}.{cure}') from None
