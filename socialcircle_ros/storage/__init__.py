# SPDX-License-Identifier: Apache-2.0
"""Writing files safely: whole or not at all, in spite of signals and full disks; and files at URLs.

Nothing here knows what a file holds; the rooms above write their recordings, reports and parameters with it.
"""

from .direct import ALIGNMENT, DirectFile
from .folders import check_folder_name, folder_of_results, has_suffix_of_file
from .remote import file_system, is_below, is_url, real_location, reason_of
from .signals import NotedSignal, SignalExit, lasting_interruption, noted_signals, raised_signals
from .space import Reserve, free_bytes, is_full
from .unfinished import (
    Unfinished,
    check_place,
    kind_of_target,
    lies_in,
    open_in_place,
    remove_leftovers,
    remove_leftovers_below,
    write_file,
)

__all__ = [
    'ALIGNMENT',
    'DirectFile',
    'NotedSignal',
    'Reserve',
    'SignalExit',
    'Unfinished',
    'check_folder_name',
    'check_place',
    'file_system',
    'folder_of_results',
    'free_bytes',
    'has_suffix_of_file',
    'is_below',
    'is_full',
    'is_url',
    'kind_of_target',
    'lasting_interruption',
    'lies_in',
    'noted_signals',
    'open_in_place',
    'raised_signals',
    'real_location',
    'reason_of',
    'remove_leftovers',
    'remove_leftovers_below',
    'write_file',
]
