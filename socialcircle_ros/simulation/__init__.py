"""A virtual focus-variation instrument: stacks and clouds with known truth."""

from .outliers import Contaminated, Contamination, add_outliers
from .scenes import SCENES, Scene, make_scene
from .surfaces import Grid

__all__ = ['SCENES', 'Contaminated', 'Contamination', 'Grid', 'Scene', 'add_outliers', 'make_scene']
