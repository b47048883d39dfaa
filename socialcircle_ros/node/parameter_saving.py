# SPDX-License-Identifier: Apache-2.0
"""Saving the node's parameters: where to, as which text, and without holding up the executor."""

import contextlib
import os
import threading
from collections.abc import Mapping
from pathlib import Path

from rclpy.executors import Executor
from rclpy.node import Node
from rclpy.task import Future

from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.settings import OF_CELL, RosValue, quoted_yaml, yaml_text
from socialcircle_ros.storage import write_file

_TIMEOUT_S = 5.0  # more than a disk needs that is busy with a recording

SaveOutcome = tuple[bool, str]
"""Whether the parameters were saved, and a sentence for the caller of the service."""


class ParameterSaver:
    """Writes parameter files on a thread of its own.

    A disk that does not answer holds up neither the executor nor the caller for longer than the timeout, and one
    thread at most waits for it.

    Args:
        timeout_s: how long a file may take.
    """

    def __init__(self, timeout_s: float = _TIMEOUT_S) -> None:
        self._timeout_s = timeout_s
        self._idle = threading.Lock()  # held while a file is being written
        self._answering = threading.Lock()

    async def save(
        self, node: Node, values: Mapping[str, RosValue], own: Mapping[str, object] | None = None
    ) -> SaveOutcome:
        """Write the parameters to the file that `parameters_file` names, or to the default file of the node.

        To be awaited in a callback with a callback group of its own; the other callbacks go on meanwhile.

        Args:
            node: of which the executor runs the callback.
            values: all parameters by their full names.
            own: further parameters for this node alone; see `parameter_text`.
        """
        if not self._idle.acquire(blocking=False):
            return False, 'The parameters were not saved: the disk still has not written the last file.'
        name = node.get_fully_qualified_name()
        future: Future = Future()
        executor = node.executor

        def work() -> None:
            try:
                answer = _saved(name, values, own or {})
            finally:
                self._idle.release()
            self._answer(future, executor, answer)

        late = (False, f'The parameters were not saved within {self._timeout_s:g} s: check the disk.')
        timer = threading.Timer(self._timeout_s, self._answer, (future, executor, late))
        timer.daemon = True
        try:
            timer.start()
            threading.Thread(target=work, name='save_parameters', daemon=True).start()
        except RuntimeError as error:  # the system has no thread left
            timer.cancel()
            self._idle.release()
            return False, f'The parameters were not saved: {error}.'
        answer: SaveOutcome = await future
        timer.cancel()
        return answer

    def _answer(self, future: Future, executor: Executor | None, answer: SaveOutcome) -> None:
        with self._answering:
            if future.done():
                return
            future.set_result(answer)
        if executor is not None:
            with contextlib.suppress(RuntimeError):  # the node has ended meanwhile
                executor.wake()


def parameter_path(given: str, node_name: str) -> Path:
    """Where the parameters of a node are saved; an absolute path, as a caller does not know the node's folder.

    Args:
        given: the value of `parameters_file`; empty: a file in `~/.ros/socialcircle` named after the node.
        node_name: with its namespace, such as `/cell1/social_circle`.

    Raises:
        SocialCircleError: there is no such home directory.
    """
    try:
        if given:
            return Path(given).expanduser().absolute()
        home = Path(os.environ.get('ROS_HOME') or Path.home() / '.ros').absolute()
    except RuntimeError:
        raise SocialCircleError(f'The home directory of {given or "the node"} is not known.') from None
    return home / 'socialcircle' / f'{node_name.strip("/").replace("/", ".")}.yaml'


def parameter_text(values: Mapping[str, RosValue], node_name: str, own: Mapping[str, object]) -> str:
    """A parameter file from which a node starts, in any namespace.

    A second section, which the node of this name alone reads, says which cell it is and where its files go:
    another cell that took that over would write over its files, and under its name.

    Args:
        values: all parameters by their full names.
        node_name: with its namespace.
        own: what the node has beside them, also for the node of this name alone: `use_sim_time`, which is of its
            surroundings, and `qos_overrides`: their names hold whole topics.

    Raises:
        SettingError: a value is text that cannot be written to a file.
    """
    of_cell = {name: value for name, value in values.items() if name in OF_CELL}
    shared = {name: value for name, value in values.items() if name not in OF_CELL}
    plain = {name: _plain(value) for name, value in own.items()}
    return yaml_text(shared, whole=False) + '\n' + quoted_yaml({node_name: {'ros__parameters': of_cell | plain}})


def _saved(node_name: str, values: Mapping[str, RosValue], own: Mapping[str, object]) -> SaveOutcome:
    """Write the file, and say what became of it; on the thread, so that nothing may escape."""
    try:
        path = parameter_path(str(values['parameters_file']), node_name)
        path.parent.mkdir(parents=True, exist_ok=True)
        write_file(path, parameter_text(values, node_name, own))
    except SocialCircleError as error:
        return False, f'The parameters were not saved: {error}'
    except OSError as error:
        return False, f'The parameters were not saved: {error.filename} cannot be made: {error.strerror}.'
    except Exception as error:  # noqa: BLE001 - the service must answer, and the node must go on
        return False, f'The parameters were not saved: {type(error).__name__}: {error}'
    return True, f'Saved to {path}; start with --ros-args --params-file {path}.'


def _plain(value: object) -> object:
    """A value of rclpy, which holds arrays as array.array, as YAML can write it."""
    return value if isinstance(value, (bool, int, float, str)) else list(value)  # type: ignore[call-overload]
