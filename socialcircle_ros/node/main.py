# SPDX-License-Identifier: Apache-2.0
"""The executable `social_circle_node`."""

import os
import sys
import traceback
from typing import TYPE_CHECKING, NoReturn

from .ending_signals import EndingSignals
from .parameter_files import fault_of_a_file, files_for_other_nodes
from .transport import prepare_process

if TYPE_CHECKING:
    from .social_circle_node import SocialCircleNode

_SWITCH_S = 1e-4  # interval at which threads switch; 5 ms is the default of Python


def main(arguments: list[str] | None = None) -> int:
    """Run the node until Ctrl-C or SIGTERM.

    Args:
        arguments: those of ROS (--ros-args ...); None: those of the command line.

    Returns:
        The exit code: 0 after a signal, 1 where the node could not start.
    """
    signals = EndingSignals()
    try:
        return _run(arguments, signals)
    finally:
        signals.ignore()


def _run(arguments: list[str] | None, signals: EndingSignals) -> int:
    prepare_process()
    try:
        import rclpy  # noqa: PLC0415 - after the environment is set, and with a sentence where it is missing
    except ImportError as error:
        from socialcircle_ros.errors import install_command  # noqa: PLC0415

        sys.stderr.write(f'ROS 2 is not here ({error}): source Jazzy, or {install_command("ros")}.\n')
        return 1
    from rclpy.exceptions import ParameterException  # noqa: PLC0415
    from rclpy.signals import SignalHandlerOptions  # noqa: PLC0415

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
    if signals.came:
        return 0
    node = None
    try:
        start_ros(arguments, signals=SignalHandlerOptions.NO)
        node = SocialCircleNode(is_wanted=lambda: not signals.came)
        for sentence in files_for_other_nodes(given, node.get_fully_qualified_name()):
            node.get_logger().warning(sentence)
        node.start()
        # The worker takes a cloud at once, instead of waiting until the executor has prepared its next wait.
        sys.setswitchinterval(_SWITCH_S)
        _spin(node, signals)
    except (ParameterException, SocialCircleError, RuntimeError) as error:
        if node is not None:
            raise
        # rclpy raises RuntimeError, with several lines, for arguments and files that it cannot read.
        sys.stderr.write(f'The node cannot start: {str(error).splitlines()[0]}\n')
        return 1
    finally:
        ended = node is None or _closed(node)
        rclpy.try_shutdown()
    if node is not None and not ended:
        _exit_at_once(node)
    return 0


def _spin(node: 'SocialCircleNode', signals: EndingSignals) -> None:
    """Run the executor until a signal comes. What one of rclpy's own callbacks raises, the node reports.

    rclpy raises for legal messages too, such as a `/clock` before 0 (with use_sim_time).
    """
    import rclpy  # noqa: PLC0415 - as in _run
    from rclpy.executors import SingleThreadedExecutor  # noqa: PLC0415

    executor = SingleThreadedExecutor()
    executor.add_node(node)
    signals.wake_by(lambda: executor.create_task(lambda: None))
    while rclpy.ok() and not signals.came:
        try:
            executor.spin_once()
        except Exception as error:  # noqa: BLE001, PERF203 - whatever it is, the node goes on
            node.executor_failed(error)


def _closed(node: 'SocialCircleNode') -> bool:
    """Close the node; return whether all its threads have ended, which is not known where closing fails."""
    try:
        return node.close()
    except Exception:  # noqa: BLE001 - whatever it is, the process must end
        traceback.print_exc()
        return False


def _exit_at_once(node: 'SocialCircleNode') -> NoReturn:
    """End a process in which a thread filters or compiles, once all else has ended.

    That can neither be interrupted nor waited for, and at the interpreter's exit it would abort the process. The
    context is freed here, since that frees the shared memory, and that exit is skipped.
    """
    from .rclpy_internals import release_context  # noqa: PLC0415 - as in _run

    release_context(node)
    sys.stderr.flush()
    os._exit(0)


if __name__ == '__main__':
    sys.exit(main())
