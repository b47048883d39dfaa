"""Which parameters have an effect, given the values of the others."""

from collections.abc import Mapping

from .groups import PARAMETERS
from .schema import RosValue

_OF_BOTH_MODES = frozenset({'circle.mode', 'circle.not_measured'})
_OF_ADAPTIVE = frozenset({'circle.depth_of_field', 'output.score'})
_NEEDS = {
    'stack.z_start': ('stack.z_source', 'step'),
    'stack.z_step': ('stack.z_source', 'step'),
    'stack.joint': ('stack.z_source', 'joint_states'),
}


def has_effect(name: str, values: Mapping[str, RosValue]) -> bool:
    """Whether another value of a parameter could change a result.

    Args:
        name: full name of the parameter.
        values: values of the parameters by full name; missing ones have their defaults.

    Example:
        >>> has_effect('circle.window', {'circle.mode': 'adaptive'})
        False
    """

    def value(other: str) -> RosValue:
        return values.get(other, PARAMETERS[other].default)

    if name in _OF_ADAPTIVE:
        return value('circle.mode') == 'adaptive'
    if name.startswith('circle.') and name not in _OF_BOTH_MODES:
        return value('circle.mode') == 'paper'
    if name.startswith('repair.'):
        return value('output.repaired') is True
    if name in _NEEDS:
        needed, wanted = _NEEDS[name]
        return value(needed) == wanted
    return True
