# SPDX-License-Identifier: Apache-2.0
"""The executable `social_circle_node`."""

import os
import signal
import sys
from typing import TYPE_CHECKING

from .parameter_files import fault_of_a_file, files_for_other_nodes
from .transport import prepare_process

if TYPE_CHECKING:
    from rclpy.executors import SingleThreadedExecutor

    from .social_circle_node import SocialCircleNode

_SWITCH_S = 1e-4  # interval at which threads switch; 5 ms is the default of Python


def main(arguments: list[str] | None = None) -> int:
    """Run the node until Ctrl-C or SIGTERM.

    Args:
        arguments: those of ROS (--ros-args ...); None: those of the command line.

    Returns:
        The exit code: 0 after a clean end, 1 where the node could not start.
    """
    try:
        return _run(arguments)
    except KeyboardInterrupt:
        return 0  # a signal came before the node handles it


def _run(arguments: list[str] | None) -> int:
    prepare_process()
    try:
        import rclpy  # noqa: PLC0415 - after the environment is set, and with a sentence where it is missing
    except ImportError as error:
        from socialcircle_ros.errors import install_command  # noqa: PLC0415

        sys.stderr.write(f'ROS 2 is not here ({error}): source Jazzy, or {install_command("ros")}.\n')
        return 1
    from rclpy.exceptions import ParameterException  # noqa: PLC0415
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor  # noqa: PLC0415

    from socialcircle_ros.errors import SocialCircleError  # noqa: PLC0415

    try:
        from .social_circle_node import SocialCircleNode  # noqa: PLC0415
        from .start import start_ros  # noqa: PLC0415
    except SocialCircleError as error:  # the environment lets Numba compile nothing
        sys.stderr.write(f'The node cannot start: {error}\n')
        return 1

    given = sys.argv[1:] if arguments is None else arguments
    fault = fault_of_a_file(given)
    if fault is not None:
        sys.stderr.write(f'The node cannot start: {fault}\n')
        return 1
    node, began = None, False
    try:
        start_ros(arguments)
        began = True
        node = SocialCircleNode()
        for sentence in files_for_other_nodes(given, node.get_fully_qualified_name()):
            node.get_logger().warning(sentence)
        node.start()
        if not rclpy.ok():
            return 0
        # The worker takes a cloud at once, instead of waiting until the executor has prepared its next wait.
        sys.setswitchinterval(_SWITCH_S)
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        while rclpy.ok():
            _spin(executor, node)
    except (KeyboardInterrupt, ExternalShutdownException):
        return 0
    except (ParameterException, SocialCircleError, RuntimeError) as error:
        if began and not rclpy.ok():
            return 0  # a signal ended the context, and the call that needed it failed
        if node is not None:
            raise
        # rclpy raises RuntimeError, with several lines, for arguments and files that it cannot read.
        sys.stderr.write(f'The node cannot start: {str(error).splitlines()[0]}\n')
        return 1
    finally:
        _end(node)
    return 0


def _spin(executor: 'SingleThreadedExecutor', node: 'SocialCircleNode') -> None:
    """Run the executor until the context ends or one of rclpy's own callbacks raises; the node reports that.

    rclpy raises for legal messages too, such as a `/clock` before 0 (with use_sim_time).
    """
    from rclpy.executors import ExternalShutdownException  # noqa: PLC0415 - as in _run

    try:
        executor.spin()
    except ExternalShutdownException:
        raise
    except Exception as error:  # noqa: BLE001 - whatever it is, the node goes on
        node.executor_failed(error)


def _end(node: 'SocialCircleNode | None') -> None:
    """Leave the graph. A second Ctrl-C must not interrupt this: a worker that still runs aborts the process."""
    import rclpy  # noqa: PLC0415 - as in _run

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if node is None:
        rclpy.try_shutdown()
        return
    ended = node.close()
    rclpy.try_shutdown()
    if not ended:
        # The compilation can neither be interrupted nor waited for. Everything else has ended. The context
        # is freed here, since that frees the shared memory, and the interpreter's exit is skipped.
        from .rclpy_internals import release_context  # noqa: PLC0415

        release_context(node)
        sys.stderr.flush()
        os._exit(0)


if __name__ == '__main__':
    sys.exit(main())
