"""The executable `social_circle_node`."""

import signal
import sys

from .transport import prepare_process


def main(arguments: list[str] | None = None) -> int:
    """Run the node until Ctrl-C or SIGTERM.

    Args:
        arguments: as ROS takes them (--ros-args ...); None: the command line's.

    Returns:
        The exit code: 0 after a clean end, 1 where the node could not start.
    """
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

    node = None
    try:
        try:
            rclpy.init(args=arguments)
            node = SocialCircleNode()
        except (ParameterException, SocialCircleError, RuntimeError) as error:
            # RuntimeError is what rclpy raises for arguments and files that it cannot read, on several lines.
            sys.stderr.write(f'The node cannot start: {str(error).splitlines()[0]}\n')
            return 1
        node.start()
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        return 0
    finally:
        # A second Ctrl-C must not cut the clean-up short: a worker left behind aborts the process.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        if node is not None:
            node.close()
        rclpy.try_shutdown()
    return 0


if __name__ == '__main__':
    sys.exit(main())
