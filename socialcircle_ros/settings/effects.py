# SPDX-License-Identifier: Apache-2.0
"""Which parameters have an effect with the others as they are."""

from collections.abc import Mapping
from typing import cast

from socialcircle_ros.errors import SettingError

from .lessons import Judge, finder, read_lesson
from .schema import RosValue

MODE, VOTE_REGION = 'circle.mode', 'circle.vote_region'
_JUDGE, _PROVIDER, _DEPTH_OF_FIELD, _LESSON = (
    'circle.judge', 'circle.provider', 'circle.depth_of_field', 'circle.lesson',
)  # fmt: skip

_ONLY_WITH: Mapping[str, tuple[str, RosValue]] = {
    'circle.window': (MODE, 'paper'),
    VOTE_REGION: (MODE, 'paper'),
    'circle.radius': (MODE, 'paper'),
    'circle.radius_scale': (MODE, 'paper'),
    _JUDGE: (MODE, 'adaptive'),
    _PROVIDER: (MODE, 'adaptive'),
    _DEPTH_OF_FIELD: (MODE, 'adaptive'),
    _LESSON: (MODE, 'adaptive'),
    'output.score': (MODE, 'adaptive'),
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
        values: of all parameters, or their texts. A parameter that depends on one that is not among them, or on
            a lesson that cannot be read here, has an effect.
    """
    other, needed = _ONLY_WITH.get(name, (name, None))
    depends = needed is not None and other in values
    if depends and not (values[other] == needed and has_effect(other, values)):
        return False
    if name == _JUDGE:
        return not values.get(_LESSON) and not _has_depth_of_field(values)
    if name == _PROVIDER:
        return _finder(values) != 'rules'
    if name == _DEPTH_OF_FIELD:
        return not values.get(_LESSON) or _finder(values) != 'network'
    return True


def needing(mode: str) -> tuple[str, ...]:
    """The parameters that have an effect in this mode only."""
    return tuple(name for name, needed in _ONLY_WITH.items() if needed == (MODE, mode))


def _finder(values: Mapping[str, RosValue]) -> str | None:
    """What finds the outliers in the adaptive mode; None where that is not known."""
    judge = cast('Judge', values.get(_JUDGE))
    path = str(values.get(_LESSON, ''))
    try:
        return finder(read_lesson(path) if path else None, judge, has_depth_of_field=_has_depth_of_field(values))
    except SettingError:
        return None


def _has_depth_of_field(values: Mapping[str, RosValue]) -> bool:
    return float(str(values.get(_DEPTH_OF_FIELD, 0.0))) != 0
