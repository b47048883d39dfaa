"""The executable `social_circle_node`."""

import contextlib
import itertools
import os
import signal
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from .transport import prepare_process

_SWITCH = 1e-4  # s that a thread keeps the interpreter from others, instead of Python's 5 ms


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

    odd = _file_without_parameters(sys.argv[1:] if arguments is None else arguments)
    if odd is not None:
        sys.stderr.write(
            f'The node cannot start: {odd} holds no parameters; see config/social_circle.yaml for the form.\n'
        )
        return 1
    node, began = None, False
    try:
        rclpy.init(args=arguments)
        began = True
        node = SocialCircleNode()
        node.start()
        if not rclpy.ok():
            return 0
        # The worker has a cloud while the executor still prepares its next wait: it need not wait for that.
        sys.setswitchinterval(_SWITCH)
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


def _file_without_parameters(arguments: Sequence[str]) -> str | None:
    """A parameter file that is some other text, which rcl takes for one without parameters; None: none is.

    An empty file may be meant; what rcl refuses itself, and what cannot be read, is left to it.
    """
    for option, path in itertools.pairwise(arguments):
        if option == '--params-file':
            with contextlib.suppress(OSError, UnicodeDecodeError, yaml.YAMLError):
                content = yaml.safe_load(Path(path).read_text(encoding='utf-8'))
                if content is not None and not isinstance(content, dict):
                    return path
    return None


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
