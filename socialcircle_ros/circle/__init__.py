"""The filter (section 3.2): votes elect a seed, the ring round it gives the radius, the circle expands."""

from .filter import CircleResult, remove_outliers

__all__ = ['CircleResult', 'remove_outliers']
