# SPDX-License-Identifier: Apache-2.0
"""Commands in processes that are forked from one that has imported the libraries.

Most of what a short command takes is the import of Numba. Such a process does not show what is imported only when
it is needed, what an import costs, what a variable of the environment does at an import, and how Python ends. That
is tested in new processes.
"""

import atexit
import multiprocessing
import os
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

LIBRARIES = ('numba', 'socialcircle_ros.commands.main', 'socialcircle_ros.pipeline', 'socialcircle_ros.recording')
"""What most commands import."""


class Done(NamedTuple):
    """What a command returned and printed."""

    code: int
    out: str
    err: str


def run_command(arguments, folder, timeout):
    """Run `socialcircle` with some arguments in a folder, for `timeout` seconds at most."""
    multiprocessing.set_forkserver_preload(list(LIBRARIES))
    said = os.memfd_create('out'), os.memfd_create('err')
    places = [f'/proc/{os.getpid()}/fd/{each}' for each in said]
    process = multiprocessing.get_context('forkserver').Process(
        target=_command, args=(arguments, folder, dict(os.environ), *places)
    )
    try:
        process.start()
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


def _command(arguments, folder, environment, out, err):
    """What `python -m socialcircle_ros.commands.main` does, in this process."""
    for number, place in enumerate((out, err), 1):
        os.dup2(os.open(place, os.O_WRONLY | os.O_APPEND), number)
    sys.stdout = open(1, 'w', encoding='utf-8', closefd=False)  # noqa: SIM115 - as long as the process
    sys.stderr = open(2, 'w', buffering=1, encoding='utf-8', errors='backslashreplace', closefd=False)  # noqa: SIM115
    os.environ.clear()
    os.environ.update(environment)
    os.chdir(folder)
    sys.argv = ['socialcircle', *arguments]
    from socialcircle_ros.commands.main import main

    try:
        sys.exit(main())
    finally:
        atexit._run_exitfuncs()  # a forked process ends without them
