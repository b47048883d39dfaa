# SPDX-License-Identifier: Apache-2.0
"""The node's parameters: declared from the table in `settings`, validated as a whole, applied at once."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import Enum

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rcl_interfaces.msg import Parameter as ParameterMessage
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter
from rclpy.qos import DurabilityPolicy, HistoryPolicy, ReliabilityPolicy

from socialcircle_ros.errors import SettingError
from socialcircle_ros.settings import (
    PARAMETERS,
    MeasurementSettings,
    NodeSettings,
    Parameter,
    PipelineSettings,
    RosValue,
)
from socialcircle_ros.settings.spelling import no_parameter

from .parameter_services import prepare_changes
from .rclpy_internals import given_parameters

_QOS, _SIM_TIME = 'qos_overrides.', 'use_sim_time'

_POLICIES: dict[str, type[Enum]] = {
    'history': HistoryPolicy,
    'reliability': ReliabilityPolicy,
    'durability': DurabilityPolicy,
}


@dataclass(frozen=True)
class Configuration(PipelineSettings):
    """All settings of the node at one moment; a cloud is processed under one of these, never under two."""

    measurements: MeasurementSettings = field(default_factory=MeasurementSettings)
    node: NodeSettings = field(default_factory=NodeSettings)


class LiveParameters:
    """The parameters of a running node.

    A change is built into a new Configuration before it is accepted. If that fails, the change is refused with the
    reason, and nothing changes. An accepted Configuration replaces the old one in one assignment.

    Args:
        node: the node that declares the parameters.
        changed: called after each accepted change with the configuration before it.

    Raises:
        SettingError: the node was started with invalid parameters.
    """

    def __init__(self, node: Node, changed: Callable[[Configuration], None]) -> None:
        self._node = node
        self._changed = changed
        given = {name: _plain(each) for name, each in self._given().items() if name in PARAMETERS}
        Configuration.from_ros(given)  # refuses them in our own words, before rclpy does
        for row in PARAMETERS.values():
            value = _in_type(row, given.get(row.name, row.default))
            node.declare_parameter(row.name, value, _descriptor(row), ignore_override=row.name in given)
        self.configuration = Configuration.from_ros(self._values())
        # What was checked last, and is applied next; meanwhile a file that it names may change.
        self._next = self.configuration
        node.add_on_set_parameters_callback(self._validate)
        node.add_post_set_parameters_callback(self._apply)
        prepare_changes(node, self._prepared)

    def unknown(self) -> list[str]:
        """Parameters that the node was started with and does not have; they are probably misspelled."""
        return [name for name in self._missing() if not name.startswith(_QOS)]

    def unknown_overrides(self) -> list[str]:
        """The same for qos_overrides; the node has those of a topic once it publishes or subscribes there.

        A file for several cells has overrides for topics of the same names in other namespaces.
        """
        namespace = f'{self._node.get_namespace().rstrip("/")}/'
        own = tuple(
            # Of a topic that is remapped to elsewhere, the last part of its name.
            f'/{name.removeprefix(namespace) if name.startswith(namespace) else name.rpartition("/")[2]}'
            for name in self._node.get_parameters_by_prefix(_QOS.rstrip('.'))
        )
        return [name for name in self._missing() if name.startswith(_QOS) and not name.endswith(own)]

    def wrong_overrides(self) -> str:
        """A sentence on each of the qos_overrides of the node that has a value that QoS does not have."""
        given = {name: each.value for name, each in self._given().items() if name.startswith(_QOS)}
        sentences = [
            _wrong_override(name, value) for name, value in given.items() if self._node.has_parameter(name)
        ]
        return ' '.join(sentence for sentence in sentences if sentence)

    def _missing(self) -> list[str]:
        return sorted(name for name in self._given() if not self._node.has_parameter(name))

    def to_save(self) -> tuple[dict[str, RosValue], dict[str, object]]:
        """The values of all parameters, by full names, and of those of ROS that a node is started with.

        These are use_sim_time, and the qos_overrides that the node was started with.
        """
        given = self._given().items()
        overrides = {name: each.value for name, each in given if name.startswith(_QOS)}
        return self.configuration.to_ros(), {_SIM_TIME: self._node.get_parameter(_SIM_TIME).value} | overrides

    def _given(self) -> dict[str, RosParameter]:
        """What the node was started with."""
        return given_parameters(self._node)

    def _values(self) -> dict[str, RosValue | None]:
        return {name: _plain(self._node.get_parameter(name)) for name in PARAMETERS}

    def _prepared(self, asked: Sequence[ParameterMessage]) -> list[ParameterMessage]:
        """Changes that a service asks for, checked and in the declared types.

        Raises:
            SettingError: they are refused.
        """
        changes = [_read(each) for each in asked]
        for change in changes:
            if not self._node.has_parameter(change.name):
                raise SettingError(no_parameter(change.name))
            if change.name in PARAMETERS and PARAMETERS[change.name].read_only:
                raise SettingError(
                    f'{change.name} is read-only; start the node with the value that it shall have.'
                )
        self._changed_by(changes)
        return [
            RosParameter(change.name, value=_in_type(PARAMETERS[change.name], change.value)).to_parameter_msg()
            if change.name in PARAMETERS
            else message
            for change, message in zip(changes, asked, strict=True)
        ]

    def _validate(self, changes: list[RosParameter]) -> SetParametersResult:
        try:
            self._next = self._changed_by(changes)
        except SettingError as refusal:
            return SetParametersResult(successful=False, reason=str(refusal))
        return SetParametersResult(successful=True)

    def _changed_by(self, changes: list[RosParameter]) -> Configuration:
        """The configuration with changes.

        Raises:
            SettingError: they are not allowed.
        """
        ours = [change for change in changes if change.name in PARAMETERS]
        for change in ours:
            if change.type_ == RosParameter.Type.NOT_SET:
                raise SettingError(f'{change.name} cannot be removed; set it to a value.')
        return self.configuration.with_ros({change.name: _plain(change) for change in ours})

    def _apply(self, changes: list[RosParameter]) -> None:
        if any(change.name in PARAMETERS for change in changes):
            before, self.configuration = self.configuration, self._next
            self._changed(before)


def _wrong_override(name: str, value: object) -> str:
    """Why an override of QoS cannot be; empty if nothing speaks against it."""
    policy = name.rpartition('.')[2]
    choices = [each.name.lower() for each in _POLICIES.get(policy, ()) if each.name != 'UNKNOWN']
    if choices and str(value).lower() not in choices:
        allowed = f'use one of: {", ".join(choices)}'
    elif policy == 'depth' and isinstance(value, int) and value < 0:
        allowed = 'it must be at least 0'
    else:
        return ''
    return f'{name} cannot be {value}; {allowed}. Start the node again with another value.'


def _plain(parameter: RosParameter) -> RosValue | None:
    """The value with Python's own types; rclpy holds an array as array.array."""
    value = parameter.value
    return value if isinstance(value, (bool, int, float, str)) or value is None else list(value)


def _read(message: ParameterMessage) -> RosParameter:
    """A parameter as a service gets it.

    Raises:
        SettingError: ROS has no such type of values.
    """
    try:
        return RosParameter.from_parameter_msg(message)
    except ValueError:
        raise SettingError(
            f'{message.name} cannot be set: ROS has no values of type {message.value.type}.'
        ) from None


def _in_type(row: Parameter, value: object) -> object:
    """A valid value in the type of the parameter: ROS refuses 1 where 1.0 is meant (rclcpp #979)."""
    return float(value) if row.kind is float and isinstance(value, int) else value


def _descriptor(row: Parameter) -> ParameterDescriptor:
    """The descriptor of a parameter in ROS."""
    descriptor = ParameterDescriptor(
        name=row.name,
        description=row.description,
        additional_constraints=row.allowed,
        read_only=row.read_only,
    )
    low, high = row.limits.minimum, row.limits.maximum
    if low is not None and high is not None:
        if row.kind is int:
            step = 2 if row.limits.odd else 1
            descriptor.integer_range = [IntegerRange(from_value=int(low), to_value=int(high), step=step)]
        elif row.kind is float:
            descriptor.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
    return descriptor
