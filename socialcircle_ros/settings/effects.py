# SPDX-License-Identifier: Apache-2.0
"""Which parameters have an effect with the others as they are."""

from collections.abc import Mapping

from .schema import RosValue

VOTE_REGION = 'circle.vote_region'

_ONLY_WITH: Mapping[str, tuple[str, RosValue]] = {
    'circle.window': ('circle.mode', 'paper'),
    VOTE_REGION: ('circle.mode', 'paper'),
    'circle.radius': ('circle.mode', 'paper'),
    'circle.radius_scale': ('circle.mode', 'paper'),
    'circle.judge': ('circle.mode', 'adaptive'),
    'circle.provider': ('circle.judge', 'network'),
    'circle.depth_of_field': ('circle.mode', 'adaptive'),
    'circle.lesson': ('circle.mode', 'adaptive'),
    'output.score': ('circle.mode', 'adaptive'),
    'stack.z_start': ('stack.z_source', 'step'),
    'stack.z_step': ('stack.z_source', 'step'),
    'stack.check_stamps': ('stack.z_source', 'step'),
    'stack.joint': ('stack.z_source', 'joint_states'),
    'stack.latency': ('stack.z_source', 'joint_states'),
    'repair.method': ('output.repaired', True),
    'repair.largest': ('output.repaired', True),
    'repair.sides': ('output.repaired', True),
    'repair.heights_agree': ('output.repaired', True),
}
"""The value of another parameter with which a parameter has an effect."""


def has_effect(name: str, values: Mapping[str, RosValue]) -> bool:
    """Whether a change of a parameter can change a result.

    Args:
        name: of the parameter.
        values: of all parameters. A parameter that depends on one that is not among them has an effect.
    """
    other, needed = _ONLY_WITH.get(name, (name, None))
    if needed is None or other not in values:
        return True
    return values[other] == needed and has_effect(other, values)
