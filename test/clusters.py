# SPDX-License-Identifier: Apache-2.0
"""Dask clusters of tests: in threads of this process, and with real processes."""

import os
import subprocess
import sys
import time
from contextlib import contextmanager

from socialcircle_ros.kernels import bands


@contextmanager
def cluster_in_this_process():
    """The address of a scheduler with one worker, in threads of this process; other processes can use it too."""
    import distributed

    cluster = distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, protocol='tcp', dashboard_address=None, silence_logs=50
    )
    before = bands.limit  # a worker leaves the cores to the others of its machine
    try:
        with cluster:
            yield cluster.scheduler_address
    finally:
        bands.limit = before


@contextmanager
def cluster_of_processes(folder):
    """The scheduler file and the processes of two workers, as they are started on a cluster."""
    file = folder / 'scheduler.json'
    common = ['--scheduler-file', str(file), '--no-dashboard']
    programs = [
        ['dask_scheduler', *common, '--host', '127.0.0.1', '--port', '0'],
        *[['dask_worker', *common, '--nthreads', '1', '--no-nanny', '--death-timeout', '300']] * 2,
    ]
    processes = [
        subprocess.Popen(
            [sys.executable, '-m', f'distributed.cli.{program}', *arguments],
            stderr=subprocess.DEVNULL,
            cwd=folder,
        )
        for program, *arguments in programs
    ]
    try:
        while not file.exists():  # the scheduler writes it when it listens
            time.sleep(0.05)
        yield file, processes[1:]
    finally:
        for process in processes:
            process.kill()
            process.wait()


def ends_once(mark):
    """Ends its process at the first call; then says whether that has a module which was to be loaded before."""
    if not mark.exists():
        mark.touch()
        os._exit(1)
    return 'tabnanny' in sys.modules
