# SPDX-License-Identifier: Apache-2.0
"""The machine: the cores that this process may use, and a line that describes the hardware."""

import contextlib
import math
import os
import platform
from functools import cache
from importlib.metadata import version
from pathlib import Path

_CGROUP = Path('/sys/fs/cgroup')


def usable_cores(cgroup: Path = _CGROUP) -> int:
    """Count the cores that this process may use: its affinity, limited by the quota of its control group.

    Args:
        cgroup: folder of the control group's files (version 2: `cpu.max`; version 1: `cpu/cpu.cfs_quota_us`).

    Returns:
        At least 1. A quota of 1.5 cores counts as 2: the second core is used for half of the time.
    """
    cores = len(os.sched_getaffinity(0))
    quota = _quota(cgroup)
    return cores if quota is None else max(1, min(cores, math.ceil(quota)))


@cache
def _quota(cgroup: Path) -> float | None:
    """Cores that the control group allows; None where it sets no limit."""
    with contextlib.suppress(OSError, ValueError):
        quota, period = (cgroup / 'cpu.max').read_text(encoding='ascii').split()
        return None if quota == 'max' else int(quota) / int(period)
    with contextlib.suppress(OSError, ValueError):
        first = int((cgroup / 'cpu' / 'cpu.cfs_quota_us').read_text(encoding='ascii'))
        second = int((cgroup / 'cpu' / 'cpu.cfs_period_us').read_text(encoding='ascii'))
        return first / second if first > 0 else None
    return None


def hardware() -> str:
    """Describe processor, cores, and versions of Python and NumPy in one line, to print beside measured times."""
    model = platform.processor() or platform.machine()
    with contextlib.suppress(OSError, StopIteration):
        lines = Path('/proc/cpuinfo').read_text(encoding='utf-8').splitlines()
        model = next(line.partition(':')[2].strip() for line in lines if line.startswith('model name'))
    return f'{model}, {usable_cores()} cores, Python {platform.python_version()}, NumPy {version("numpy")}'
