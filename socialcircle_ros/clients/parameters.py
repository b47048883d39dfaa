# SPDX-License-Identifier: Apache-2.0
"""A node's parameters as the tuning page shows them, from the messages of rcl_interfaces."""

from rcl_interfaces.msg import ParameterDescriptor, ParameterType, ParameterValue
from rclpy.parameter import parameter_value_to_python

from socialcircle_ros.panel.link import Descriptor, ParameterKind
from socialcircle_ros.settings import RosValue, choices_in, sentence_and_unit

_KINDS = {
    ParameterType.PARAMETER_BOOL: ParameterKind.BOOLEAN,
    ParameterType.PARAMETER_INTEGER: ParameterKind.INTEGER,
    ParameterType.PARAMETER_DOUBLE: ParameterKind.REAL,
    ParameterType.PARAMETER_STRING: ParameterKind.TEXT,
    ParameterType.PARAMETER_INTEGER_ARRAY: ParameterKind.INTEGERS,
}
_TYPES: dict[ParameterKind, type] = {
    ParameterKind.BOOLEAN: bool,
    ParameterKind.INTEGER: int,
    ParameterKind.REAL: float,
    ParameterKind.TEXT: str,
    ParameterKind.INTEGERS: list,
}
_NUMBERS = (ParameterType.PARAMETER_INTEGER, ParameterType.PARAMETER_DOUBLE)


def descriptor_of(message: ParameterDescriptor, value_type: int) -> Descriptor | None:
    """Describe a parameter for the page.

    Args:
        message: the descriptor that the node gave.
        value_type: of the parameter's value, a constant of ParameterType. With dynamic typing the descriptor holds
            no type.

    Returns:
        None if the page has no control for this type.
    """
    if value_type not in _KINDS:
        return None
    sentence, unit = sentence_and_unit(message.description)
    # The node declares real numbers with dynamic typing, so that they accept integers.
    is_real = message.dynamic_typing and value_type in _NUMBERS
    ranges = message.floating_point_range or message.integer_range
    allowed = message.additional_constraints
    return Descriptor(
        name=message.name,
        kind=ParameterKind.REAL if is_real else _KINDS[value_type],
        sentence=sentence,
        unit=unit,
        allowed=allowed,
        choices=choices_in(allowed) if value_type == ParameterType.PARAMETER_STRING else (),
        low=ranges[0].from_value if ranges else None,
        high=ranges[0].to_value if ranges else None,
        step=ranges[0].step if ranges else 0,
        read_only=message.read_only,
    )


def python_value(value: ParameterValue) -> RosValue | None:
    """The value of a parameter in Python's own types.

    Returns:
        None if the parameter is not set, or if the page has no control for its type.
    """
    if value.type not in _KINDS:
        return None
    plain = parameter_value_to_python(value)
    return plain if isinstance(plain, (bool, int, float, str)) else [int(item) for item in plain]


def as_kind(value: RosValue, kind: ParameterKind | None) -> RosValue:
    """The value, as a float if the parameter is a real number and the value an integer."""
    return float(value) if kind is ParameterKind.REAL and type(value) is int else value


def is_of_kind(value: RosValue, kind: ParameterKind) -> bool:
    """Whether a parameter of a kind can have this value, which any participant of the graph may have sent."""
    return type(value) is _TYPES[kind]
