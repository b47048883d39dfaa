# SPDX-License-Identifier: Apache-2.0
"""The adaptive mode: touch is relative to the spread of the surface, and communities are judged by their borders.

Its steps, in order:

- `heights`: float32 heights, and holes in them filled.
- `slopes`, `spread`, `differences`: how far neighbours differ, relative to the spread of the surface.
- `isolated`: points in touch with at most one neighbour.
- `relief`: a surface of the significant differences alone.
- `islands`: communities that rise from their surroundings on all sides.
- `texture`: islands that belong to the surface, and removed ones that may.
- `communities`, `lesson`: a lesson about one kind of part, which judges what the other steps found.
- `pyramid`: the same at reduced resolution.
- `optics`: for focus stacks, the tolerance that the depth of field gives, and walls.

In their place `likelihood` decides by the probability of each point, which a network gives. `far` finds the
islands far off a plain surface that the network takes for parts of it; `parts` counts these.

Both compare neighbours. `few_neighbours` finds points far off that have hardly any.

`detection` composes them. `docs/adaptive.md` has the equations.
"""

from .detection import AdaptiveResult, Rules, find_outliers, find_probable_outliers
from .few_neighbours import outliers_with_few_neighbours
from .isolated import TOUCH
from .lesson import CommunityJudge, LessonJudge, unlike
from .likelihood import MANY_UNDECIDED, UNDECIDED, Likelihood, Probabilities, Sureness
from .texture import Islands

__all__ = [
    'MANY_UNDECIDED', 'TOUCH', 'UNDECIDED', 'AdaptiveResult', 'CommunityJudge', 'Islands', 'LessonJudge',
    'Likelihood', 'Probabilities', 'Rules', 'Sureness', 'find_outliers', 'find_probable_outliers',
    'outliers_with_few_neighbours', 'unlike',
]  # fmt: skip
