# SPDX-License-Identifier: Apache-2.0
"""Commands and nodes in processes that are forked from one that has imported the libraries.

Most of what a short command and the start of a node take is the import of Numba and the loading of kernels. Such a
process does not show what is imported only when it is needed, what an import costs, what a variable of the
environment does at an import, and how Python ends. That is tested in new processes.
"""

import atexit
import multiprocessing
import os
import signal
import subprocess
import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from socialcircle_ros.clients.process import NodeProcess

LIBRARIES = ('numba', 'socialcircle_ros.commands.main', 'socialcircle_ros.pipeline', 'socialcircle_ros.recording')
"""What most commands import."""

NODE_LIBRARIES = ('socialcircle_ros.node.social_circle_node',) if find_spec('rclpy') else ()
"""What nodes import, where ROS 2 is installed."""

KERNELS = 'socialcircle_ros.archive.preload'
"""Loads the kernels of the default settings, and leaves no thread."""


class Done(NamedTuple):
    """What a command returned and printed."""

    code: int
    out: str
    err: str


def run_command(arguments, folder, timeout):
    """Run `socialcircle` with some arguments in a folder, for `timeout` seconds at most."""
    said = os.memfd_create('out'), os.memfd_create('err')
    places = [f'/proc/{os.getpid()}/fd/{each}' for each in said]
    process = _fork('socialcircle_ros.commands.main', arguments, folder, *places)
    try:
        process.join(timeout)
        if process.exitcode is None:
            process.kill()
            process.join()
            raise subprocess.TimeoutExpired(arguments, timeout)
        out, err = (Path(f'/proc/self/fd/{each}').read_text(encoding='utf-8') for each in said)
        return Done(process.exitcode, out, err)
    finally:
        for each in said:
            os.close(each)


class ForkedNode(NodeProcess):
    """A node in a forked process."""

    def begin(self, module, arguments):
        self.log.write_bytes(b'')
        return _Forked(_fork(module, arguments, Path.cwd(), str(self.log), str(self.log)))


class _Forked:
    """A process of multiprocessing, used as one of subprocess."""

    def __init__(self, process):
        self._process = process
        self.pid = process.pid

    def poll(self):
        return self._process.exitcode

    def wait(self, timeout=None):
        self._process.join(timeout)
        if self._process.exitcode is None:
            raise subprocess.TimeoutExpired('node', timeout)
        return self._process.exitcode

    def send_signal(self, number):
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self):
        self.send_signal(signal.SIGKILL)


def _fork(module, arguments, folder, out, err):
    multiprocessing.set_forkserver_preload([*LIBRARIES, *NODE_LIBRARIES, KERNELS])
    process = multiprocessing.get_context('forkserver').Process(
        target=_run, args=(module, arguments, folder, dict(os.environ), out, err)
    )
    process.start()
    return process


def _run(module, arguments, folder, environment, out, err):
    """What `python -m module` does, in this process."""
    for number, place in enumerate((out, err), 1):
        os.dup2(os.open(place, os.O_WRONLY | os.O_APPEND), number)
    sys.stdout = open(1, 'w', encoding='utf-8', closefd=False)  # noqa: SIM115 - as long as the process
    sys.stderr = open(2, 'w', buffering=1, encoding='utf-8', errors='backslashreplace', closefd=False)  # noqa: SIM115
    os.environ.clear()
    os.environ.update(environment)
    os.chdir(folder)
    sys.argv = [module, *arguments]
    try:
        sys.exit(import_module(module).main())
    finally:
        atexit._run_exitfuncs()  # a forked process ends without them
