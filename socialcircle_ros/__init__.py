"""Outlier removal for organized point clouds of optical microscopes, by the social circle method."""

from .circle import CircleResult, remove_outliers
from .errors import SocialCircleError
from .settings import CircleSettings

__all__ = ['CircleResult', 'CircleSettings', 'SocialCircleError', 'remove_outliers']
