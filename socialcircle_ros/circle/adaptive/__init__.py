"""The adaptive mode: touch measured in the surface's own spread, and communities judged by how they end.

Its steps, in order: `jumps` (how far neighbours differ, in the surface's own spread), `loners` (points that
touch nobody), `relief` (a surface of the surprising jumps alone), `islands` (communities that rise from their
surroundings on all sides), `texture` (islands that are the surface's own) and, for clouds that were focus stacks,
`optics` (what the depth of field promises, and walls).
`docs/adaptive.md` has the equations.
"""

from .adaptive import AdaptiveResult, Rules, find_outliers
from .loners import TOUCH

__all__ = ['TOUCH', 'AdaptiveResult', 'Rules', 'find_outliers']
