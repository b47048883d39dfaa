"""The executable `social_circle_node`."""

import os
import signal
import sys
from typing import Any

from .transport import prepare_process


def main(arguments: list[str] | None = None) -> int:
    """Run the node until Ctrl-C or SIGTERM.

    Args:
        arguments: as ROS takes them (--ros-args ...); None: the command line's.

    Returns:
        The exit code: 0 after a clean end, 1 where the node could not start.
    """
    try:
        return _run(arguments)
    except KeyboardInterrupt:
        return 0  # before the node could be told to end


def _run(arguments: list[str] | None) -> int:
    prepare_process()
    try:
        import rclpy  # noqa: PLC0415 - after the environment is set, and with a sentence where it is missing
    except ImportError as error:
        sys.stderr.write(f'ROS 2 is not here ({error}): source Jazzy, or pip install "socialcircle_ros[ros]".\n')
        return 1
    from rclpy.exceptions import ParameterException  # noqa: PLC0415
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor  # noqa: PLC0415

    from socialcircle_ros.errors import SocialCircleError  # noqa: PLC0415

    from .social_circle_node import SocialCircleNode  # noqa: PLC0415

    node, began = None, False
    try:
        rclpy.init(args=arguments)
        began = True
        node = SocialCircleNode()
        node.start()
        if not rclpy.ok():
            return 0
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        return 0
    except (ParameterException, SocialCircleError, RuntimeError) as error:
        if began and not rclpy.ok():
            return 0  # a signal came in the middle of something, which then could not be done
        if node is not None:
            raise
        # RuntimeError is what rclpy raises for arguments and files that it cannot read, on several lines.
        sys.stderr.write(f'The node cannot start: {str(error).splitlines()[0]}\n')
        return 1
    finally:
        _end(node, rclpy)
    return 0


def _end(node: Any, rclpy: Any) -> None:
    """Leave the graph; a second Ctrl-C must not cut that short: a worker left behind aborts the process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if node is None:
        rclpy.try_shutdown()
        return
    node.close()
    rclpy.try_shutdown()
    if node.warm_up.running:
        # What is being compiled can neither be interrupted nor waited for; everything else has ended, and
        # the context, whose end frees the shared memory, is not left to the interpreter's exit.
        node._state_machine.destroy_when_not_in_use()  # noqa: SLF001 - it holds the node, and that the context
        node.context.destroy()
        sys.stderr.flush()
        os._exit(0)


if __name__ == '__main__':
    sys.exit(main())
