# SPDX-License-Identifier: Apache-2.0
"""Repair (section 4.2): which holes in a cloud may be filled, and with which points.

Which points are outliers is decided in `circle` and `baselines`.
"""

from .repair import RepairResult, repair_holes

__all__ = ['RepairResult', 'repair_holes']
