"""Filling the holes that the filter leaves (section 4.2), and saying which points were filled.

Which points may be filled, and how their x, y and heights are found from the measured points round them.
What is an outlier is decided elsewhere, in `circle` and `baselines`.
"""

from .repair import RepairResult, repair_holes

__all__ = ['RepairResult', 'repair_holes']
