# SPDX-License-Identifier: Apache-2.0
"""The social circle filter (section 3.2 of the paper): the seed by votes, the radius, the expansion.

The adaptive mode is in `adaptive`. Repairing the holes that the filter leaves is in `socialcircle_ros.repair`.
"""

from .filter import CircleResult, remove_outliers

__all__ = ['CircleResult', 'remove_outliers']
