"""The adaptive mode: touch measured in the surface's own spread, and communities judged by how they end.

Its steps, in order: `differences` (how far neighbours differ, in the surface's own spread), `isolated` (points
in touch with at most one neighbour), `relief` (a surface of the significant differences alone), `islands`
(communities that rise from their surroundings on all sides), `texture` (islands that are the surface's own)
and, for clouds that were focus stacks, `optics` (what the depth of field promises, and walls).
`docs/adaptive.md` has the equations.
"""

from .detection import AdaptiveResult, Rules, find_outliers
from .isolated import TOUCH

__all__ = ['TOUCH', 'AdaptiveResult', 'Rules', 'find_outliers']
