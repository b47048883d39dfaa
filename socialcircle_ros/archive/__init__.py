# SPDX-License-Identifier: Apache-2.0
"""Many recordings at once: they are filtered on the cores of a machine or of a Dask cluster, and become rows.

What a recording is lives in `recording`, what a row is in `measurements`. Nothing here schedules tasks; Dask does.
"""

from .batch import BatchResult, run_batch
from .inputs import ArchiveInput, find_inputs
from .names import NamePattern

__all__ = ['ArchiveInput', 'BatchResult', 'NamePattern', 'find_inputs', 'run_batch']
