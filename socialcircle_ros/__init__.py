# SPDX-License-Identifier: Apache-2.0
"""Outlier removal for organized point clouds of optical microscopes, by the social circle method.

The names below load what they need on first use, so that the command line answers at once.
"""

import importlib
import importlib.metadata
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from socialcircle_ros.archive import run_batch
    from socialcircle_ros.circle import CircleResult, remove_outliers
    from socialcircle_ros.errors import SocialCircleError
    from socialcircle_ros.focus import FocusResult, FocusStack, depth_from_focus
    from socialcircle_ros.formats import MeasuredSurface, write_surface
    from socialcircle_ros.measurements import open_measurements
    from socialcircle_ros.recording import read_surface
    from socialcircle_ros.repair import RepairResult, repair_holes
    from socialcircle_ros.report.report import make_report
    from socialcircle_ros.settings import CircleSettings, FocusSettings, RepairSettings
    from socialcircle_ros.sweep.sweep import run_sweep

__all__ = [
    'CircleResult',
    'CircleSettings',
    'FocusResult',
    'FocusSettings',
    'FocusStack',
    'MeasuredSurface',
    'RepairResult',
    'RepairSettings',
    'SocialCircleError',
    'depth_from_focus',
    'make_report',
    'open_measurements',
    'read_surface',
    'remove_outliers',
    'repair_holes',
    'run_batch',
    'run_sweep',
    'write_surface',
]

_ROOMS = {
    'CircleResult': 'circle',
    'CircleSettings': 'settings',
    'FocusResult': 'focus',
    'FocusSettings': 'settings',
    'FocusStack': 'focus',
    'RepairResult': 'repair',
    'RepairSettings': 'settings',
    'SocialCircleError': 'errors',
    'MeasuredSurface': 'formats',
    'depth_from_focus': 'focus',
    'make_report': 'report.report',
    'open_measurements': 'measurements',
    'read_surface': 'recording',
    'remove_outliers': 'circle',
    'repair_holes': 'repair',
    'run_batch': 'archive',
    'run_sweep': 'sweep.sweep',
    'write_surface': 'formats',
}


def __getattr__(name: str) -> object:
    """Load a public name from its room; the version is that of the installed package."""
    if name == '__version__':
        return importlib.metadata.version(__name__)
    if name not in _ROOMS:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(importlib.import_module(f'.{_ROOMS[name]}', __name__), name)


def __dir__() -> list[str]:
    """List the public names."""
    return sorted(__all__)
