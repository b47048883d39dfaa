# SPDX-License-Identifier: Apache-2.0
"""Parameter files by the rules of ROS: which section applies to which node, and which type a value has.

The rules are those of rcl's parser and of rclpy in Jazzy. They differ from YAML: 1e-6 is a number, 010 is 8, and a
number in quotes is text. `test/settings/test_rcl_rules.py` gives the same files to both and compares.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass, field

import yaml

from .plain_yaml import PlainYamlError, line_of, plain_events

RclValue = bool | int | float | str | list[bool] | list[int] | list[float] | list[str] | None
"""A value as rcl reads it; None: a name without a value, such as an empty list."""

_PARAMETERS = 'ros__parameters'
_MOST = 5000  # parameters of a node
_TRUE = frozenset(['Y', 'y', 'yes', 'Yes', 'YES', 'true', 'True', 'TRUE', 'on', 'On', 'ON'])
_FALSE = frozenset(['N', 'n', 'no', 'No', 'NO', 'false', 'False', 'FALSE', 'off', 'Off', 'OFF'])
_INFINITIES = frozenset(['.inf', '.Inf', '.INF', '+.inf', '+.Inf', '+.INF', '-.inf', '-.Inf', '-.INF'])
_NANS = frozenset(['.nan', '.NaN', '.NAN'])
_TEXT_TAGS = frozenset(('!!str', 'tag:yaml.org,2002:str'))

# What strtol with base 0 and strtod accept.
_INTEGER = re.compile(r'\s*([+-]?)(0[xX][0-9a-fA-F]+|0[0-7]*|[1-9][0-9]*)', re.ASCII)
_DECIMAL = re.compile(r'\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?', re.ASCII)
_HEXADECIMAL = re.compile(r'\s*[+-]?0[xX]([0-9a-fA-F]+\.?[0-9a-fA-F]*|\.[0-9a-fA-F]+)([pP][+-]?\d+)?', re.ASCII)
_SPECIAL = re.compile(r'\s*[+-]?(inf|infinity|nan)(?:(?<=n)\(\w*\))?', re.ASCII | re.IGNORECASE)
_SMALLEST = 2.2250738585072014e-308  # below it strtod reports that digits are lost, and rcl takes the text

_PART = re.compile(r'[A-Za-z_][A-Za-z0-9_]*|\*\*?')
_TYPES = (bool, int, float, str, list)  # in this order rclpy looks for the value of a parameter that has several


class RclError(ValueError):
    """rcl would refuse the text; the message says why."""


@dataclass
class _NodeEntry:
    """A parameter of a section. A name that occurs twice with values of different types holds both."""

    name: str
    values: dict[type, RclValue] = field(default_factory=dict)

    def set(self, value: bool | float | str) -> None:
        self.values[type(value)] = value

    def append(self, value: bool | float | str, line: int, *, first: bool) -> None:
        if first:
            self.values[list] = []
        items = self.values[list]
        assert isinstance(items, list)  # noqa: S101 - for mypy
        if items and type(items[0]) is not type(value):
            raise RclError(f'the list in line {line} mixes types')
        items.append(value)  # type: ignore[arg-type]

    @property
    def value(self) -> RclValue:
        return next((self.values[kind] for kind in _TYPES if kind in self.values), None)


ParameterSection = tuple[str, dict[str, RclValue]]
"""The full name of a node, in which `*` and `**` may stand for parts, and its parameters by dotted names."""


def read_sections(text: str | bytes) -> list[ParameterSection]:
    """Read a parameter file.

    Args:
        text: the content of the file.

    Returns:
        The sections in the order of the file: a later one overrides an earlier one.

    Raises:
        RclError: rcl would refuse the file, or it is no plain YAML.
    """
    parser = _Parser()
    try:
        for event in plain_events(text):
            parser.take(event)
    except PlainYamlError as error:
        raise RclError(str(error)) from None
    return [
        (name if name.startswith('/') else f'/{name}', {entry.name: entry.value for entry in entries})
        for name, entries in parser.sections.items()
    ]


def parameters_of(sections: Iterable[ParameterSection], node: str) -> dict[str, RclValue]:
    """The parameters that a node gets.

    Args:
        sections: of a file.
        node: full name of the node, such as `/cell1/social_circle`.
    """
    values: dict[str, RclValue] = {}
    for pattern, section in sections:
        # `/*` stands for one part; the second star of `/**` then makes that any number of parts.
        if re.fullmatch(pattern.replace('/*', r'(/\w+)'), node, re.ASCII):
            values.update(section)
    return values


def rcl_value(text: str) -> RclValue:
    """Read the value of `-p NAME:=VALUE`.

    Raises:
        RclError: rcl would refuse it.
    """
    entry = _NodeEntry('')
    in_list = first = False
    try:
        for event in plain_events(text):
            if isinstance(event, yaml.ScalarEvent):
                value = _scalar(event)
                if in_list:
                    entry.append(value, line_of(event), first=first)
                    first = False
                else:
                    entry.set(value)
            elif isinstance(event, yaml.SequenceStartEvent):
                in_list = first = True
            elif isinstance(event, yaml.SequenceEndEvent):
                in_list = False
            elif isinstance(event, yaml.MappingStartEvent):
                raise RclError('it is a mapping')
    except PlainYamlError as error:
        raise RclError(str(error)) from None
    return entry.value


class _Parser:
    """The state of rcl's parser. It tells keys, values and levels apart by counting, with the same quirks."""

    def __init__(self) -> None:
        self.sections: dict[str, list[_NodeEntry]] = {}
        self._section: list[_NodeEntry] = []
        self._place = 0  # in the section; it outlives the section, as in rcl
        self._namespace, self._namespace_length = '', 0  # of the node
        self._prefix, self._prefix_length = '', 0  # of the parameter
        self._in_parameters = False
        self._depth = 0
        self._is_key, self._in_list, self._is_first, self._is_new_map = True, False, False, False

    def take(self, event: yaml.Event) -> None:
        """Take the next event.

        Raises:
            RclError: it is not allowed here.
        """
        if isinstance(event, yaml.ScalarEvent):
            if self._is_key:
                self._take_key(event)
                self._is_key = False
            else:
                self._take_value(event)
        elif isinstance(event, yaml.SequenceStartEvent):
            if self._is_key or not self._in_parameters:
                raise RclError(f'line {line_of(event)} has a list where a name must stand')
            self._in_list = self._is_first = True
        elif isinstance(event, yaml.SequenceEndEvent):
            self._in_list, self._is_key = False, True
        elif isinstance(event, yaml.MappingStartEvent):
            self._depth += 1
            self._is_new_map = not (self._in_parameters and self._depth - self._namespace_length == 3)
            self._is_key = True
        elif isinstance(event, yaml.MappingEndEvent):
            self._end_mapping()
            self._depth -= 1

    def _take_key(self, event: yaml.ScalarEvent) -> None:
        name = event.value
        if not name:
            raise RclError(f'line {line_of(event)} has an empty name')
        if self._in_parameters:
            if self._is_new_map:
                if self._place >= len(self._section):
                    raise RclError(f'line {line_of(event)} has a mapping that rcl does not understand')
                self._prefix, self._prefix_length = self._section[self._place].name, self._prefix_length + 1
                self._is_new_map = False
            self._find(self._prefix or name)
            if self._prefix:
                self._section[self._place].name = f'{self._prefix}.{name}'
        elif not name.startswith(_PARAMETERS):
            joined = self._namespace_length > 0 and not self._namespace.endswith('/')
            self._namespace += f'/{name}' if joined else name
            self._namespace_length += 1
        else:
            if self._namespace_length == 0:
                raise RclError(f'line {line_of(event)} has {_PARAMETERS} without the name of a node above it')
            _check_node(self._namespace, line_of(event))
            self._section = self.sections.setdefault(self._namespace, [])
            self._leave_namespace()
            self._in_parameters = True

    def _take_value(self, event: yaml.ScalarEvent) -> None:
        if not (self._in_parameters and self._section):
            raise RclError(f'line {line_of(event)} has a value outside of {_PARAMETERS}')
        value, entry = _scalar(event), self._section[self._place]
        if self._in_list:
            entry.append(value, line_of(event), first=self._is_first)
            self._is_first = False
        else:
            entry.set(value)
            self._is_key = True

    def _end_mapping(self) -> None:
        if not self._in_parameters:
            if self._depth == self._namespace_length + 1:
                self._leave_namespace()
        elif self._prefix_length:
            self._prefix_length -= 1
            self._prefix = self._prefix.rpartition('.')[0] if self._prefix_length else ''
        else:
            self._in_parameters = False

    def _leave_namespace(self) -> None:
        if self._namespace_length:
            self._namespace_length -= 1
            above = self._namespace.rpartition('/')[0] if '/' in self._namespace else self._namespace
            self._namespace = above if self._namespace_length else ''

    def _find(self, name: str) -> None:
        """Set the place to that of the parameter, which is added if it is new."""
        names = [entry.name for entry in self._section]
        self._place = names.index(name) if name in names else len(names)
        if self._place == len(names):
            if self._place == _MOST:
                raise RclError(f'a node has more than {_MOST} parameters')
            self._section.append(_NodeEntry(name))


def _check_node(name: str, line: int) -> None:
    """See that a name is one that a node can have, apart from `*` and `**`."""
    parts = name.removeprefix('/').split('/')
    if not all(_PART.fullmatch(part) for part in parts):
        raise RclError(f'{name!r} above line {line} cannot be the name of a node')


def _scalar(event: yaml.ScalarEvent) -> bool | int | float | str:
    """The value of a scalar in the type that rcl finds."""
    text: str = event.value
    if event.tag in _TEXT_TAGS or event.style in ('"', "'"):
        return text
    if not text:
        raise RclError(f'line {line_of(event)} has a name without a value')
    if text in _TRUE or text in _FALSE:
        return text in _TRUE
    if match := _INTEGER.fullmatch(text):
        sign, digits = match.groups()
        whole = int(sign + digits, 0 if digits[:2] in ('0x', '0X') else 8 if digits.startswith('0') else 10)
        if -(2**63) <= whole < 2**63:
            return whole
    real = _real(text)
    return text if real is None else real


def _real(text: str) -> float | None:
    if text in _INFINITIES or text in _NANS:
        return float(text.replace('.', ''))
    if _SPECIAL.fullmatch(text):
        return float(text.partition('(')[0])
    if _DECIMAL.fullmatch(text):
        number = float(text)
    elif _HEXADECIMAL.fullmatch(text):
        try:
            number = float.fromhex(text)
        except OverflowError:
            return None
    else:
        return None
    in_range = _SMALLEST <= abs(number) < float('inf')
    is_zero = number == 0 and not re.search('[1-9a-fA-F]', re.split('[eEpP]', text.lower().replace('0x', ''))[0])
    return number if in_range or is_zero else None
