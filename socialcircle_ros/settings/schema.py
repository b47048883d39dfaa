# SPDX-License-Identifier: Apache-2.0
"""How parameters are declared and checked: as fields of frozen dataclasses with unit, range and sentence.

Creating a settings object checks each value, then the values together, so that every settings object is valid.
"""

import dataclasses
import math
import operator
import re
import types
import typing
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal, SupportsFloat, SupportsIndex, TypeVar, cast

from socialcircle_ros.errors import SettingError, shown

Value = TypeVar('Value')

RosValue = bool | int | float | str | list[int]
"""The types of ROS parameters that are used here."""

_OWN = 'socialcircle'

_INTEGERS = 2**63
"""Whole numbers of ROS are below it; the least of them is its negative."""


@typing.runtime_checkable
class _NumpyScalar(typing.Protocol):
    """A scalar of NumPy, or an array; commands that only read settings do not load NumPy."""

    @property
    def shape(self) -> tuple[int, ...]: ...

    def item(self) -> object: ...


@dataclass(frozen=True)
class Limits:
    """Restrictions on a value beyond its type."""

    minimum: float | None = None
    maximum: float | None = None
    odd: bool = False
    choices: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Declaration:
    """What is declared of a parameter beyond the name, type and default of its dataclass field."""

    sentence: str
    unit: str
    limits: Limits
    empty: RosValue | None  # the ROS value that stands for None; a ROS parameter cannot be None
    read_only: bool
    of_cell: bool


def setting(
    default: Value,
    sentence: str,
    *,
    unit: str = '',
    minimum: float | None = None,
    maximum: float | None = None,
    odd: bool = False,
    empty: RosValue | None = None,
    read_only: bool = False,
    of_cell: bool = False,
) -> Value:
    """Declare a parameter: a dataclass field with its default and its description.

    Args:
        default: In Python; None where `empty` stands for it in ROS.
        sentence: What the parameter does, for people.
        unit: Of the value; 'cloud' stands for the unit of the cloud.
        minimum: Smallest allowed value.
        maximum: Largest allowed value.
        odd: Whether the value must be odd.
        empty: The ROS value that stands for None.
        read_only: Whether the value is fixed once the node has started.
        of_cell: Whether it says which cell this is or where its files go, and not how parts are measured.
    """
    column = _Declaration(sentence, unit, Limits(minimum, maximum, odd), empty, read_only, of_cell)
    return dataclasses.field(default=default, metadata={_OWN: column})


@dataclass(frozen=True)
class Parameter:
    """One parameter as ROS, parameter files and the documents show it.

    Attributes:
        group: Prefix of the name; '' for parameters of the node itself.
        field: Name of the field of the settings class.
        kind: Type of `default`, which is also the declared ROS type.
        default: As a ROS value; None in Python is `empty` here.
        unit: Of the value; '' if it has none, 'cloud' for the unit of the cloud.
        limits: Which values are allowed.
        sentence: What the parameter does.
        read_only: Whether the value is fixed once the node has started.
        empty: The ROS value that stands for None in Python; None if there is no such value.
        of_cell: Whether it says which cell this is or where its files go, and not how parts are measured.
    """

    group: str
    field: str
    kind: type
    default: RosValue
    unit: str
    limits: Limits
    sentence: str
    read_only: bool
    empty: RosValue | None
    of_cell: bool

    @property
    def name(self) -> str:
        """The full name: `group.field`, or `field` without a group."""
        return f'{self.group}.{self.field}' if self.group else self.field

    @property
    def empty_text(self) -> str:
        """What `empty` means, in one word."""
        return 'automatic' if self.group == 'circle' else 'none'

    @property
    def allowed(self) -> str:
        """The allowed values, in words."""
        limits = self.limits
        if limits.choices:
            return ', '.join(limits.choices)
        if self.kind is bool:
            return 'true, false'
        if self.kind is list:
            return f'4 whole numbers, at least {limits.minimum:g}'
        words = 'odd, ' if limits.odd else ''
        if limits.minimum is not None and limits.maximum is not None:
            return f'{words}{limits.minimum:g} to {limits.maximum:g}'
        if limits.minimum is not None:
            return f'{words}at least {limits.minimum:g}'
        return words.rstrip(', ') or 'any'

    @property
    def description(self) -> str:
        """Sentence and unit as the ROS descriptor holds them; `sentence_and_unit` separates them."""
        return f'{self.sentence} [{self.unit}]' if self.unit else self.sentence

    def to_ros(self, value: object) -> RosValue:
        """Convert a Python value to the ROS value.

        Raises:
            SettingError: The value is None, and the parameter cannot be None.
        """
        if value is None:
            if self.empty is None:
                raise SettingError(f'{self.name} needs a value.')
            return self.empty
        return cast('RosValue', list(value) if isinstance(value, tuple) else value)

    def from_ros(self, value: object) -> object:
        """Convert a ROS value to the Python value; `empty` becomes None."""
        if isinstance(value, Sequence) and not isinstance(value, str):
            value = tuple(value)
            return None if self.empty is not None and list(value) == self.empty else value
        is_empty = self.empty is not None and not isinstance(value, bool) and value == self.empty
        return None if is_empty else value


@dataclass(frozen=True)
class Settings:
    """Base of the groups of settings: checks values on creation, converts from and to ROS values."""

    group: ClassVar[str] = ''

    def __post_init__(self) -> None:
        """Check every value.

        Raises:
            SettingError: A value has a wrong type or is out of range; the message says what is allowed.
        """
        hints = typing.get_type_hints(type(self))
        for field in _declared(type(self)):
            column: _Declaration = field.metadata[_OWN]
            name = f'{self.group}.{field.name}' if self.group else field.name
            value = _checked(name, getattr(self, field.name), hints[field.name], column)
            object.__setattr__(self, field.name, value)
        self._check_together()

    def _check_together(self) -> None:
        """Check rules on several values, or on None; groups with such rules override this."""

    @classmethod
    def parameters(cls) -> tuple[Parameter, ...]:
        """The parameters of this group, in the order of their declaration; a Literal type gives the choices."""
        hints = typing.get_type_hints(cls)
        rows = []
        for field in _declared(cls):
            column: _Declaration = field.metadata[_OWN]
            default = cast('RosValue | None', column.empty if field.default is None else field.default)
            if default is None:
                raise TypeError(f'{field.name} needs a default or an empty value.')
            hint = hints[field.name]
            choices = typing.get_args(hint) if typing.get_origin(hint) is Literal else ()
            rows.append(
                Parameter(
                    group=cls.group,
                    field=field.name,
                    kind=type(default),
                    default=default,
                    unit=column.unit,
                    limits=dataclasses.replace(column.limits, choices=choices),
                    sentence=column.sentence,
                    read_only=column.read_only,
                    empty=column.empty,
                    of_cell=column.of_cell,
                )
            )
        return tuple(rows)

    @classmethod
    def from_ros(cls: type['Self'], values: Mapping[str, object]) -> 'Self':
        """Make settings from values under full ROS names.

        Names of other groups are ignored; missing names get their defaults.

        Raises:
            SettingError: As on creation, or this machine lacks what they need.
        """
        settings = cls(**cls.fields_of(values))
        settings.check_machine()
        return settings

    def with_ros(self: 'Self', changes: Mapping[str, object]) -> 'Self':  # noqa: PYI019 - not in Python 3.10
        """These settings with changed values under full ROS names.

        Raises:
            SettingError: As by `from_ros`.
        """
        changed = dataclasses.replace(self, **self.fields_of(changes))
        changed.check_machine()
        return changed

    @classmethod
    def fields_of(cls, values: Mapping[str, object]) -> dict[str, object]:
        """What the fields become by values under full ROS names; names of other groups are ignored."""
        return {row.field: row.from_ros(values[row.name]) for row in cls.parameters() if row.name in values}

    @classmethod
    def check_each(cls, values: Mapping[str, object]) -> None:
        """Check values under full ROS names, each by itself; names of other groups are ignored.

        Raises:
            SettingError: A value has a wrong type or is out of range.
        """
        hints = typing.get_type_hints(cls)
        columns = {field.name: field.metadata[_OWN] for field in _declared(cls)}
        for name, value in cls.fields_of(values).items():
            if name in columns:
                _checked(f'{cls.group}.{name}' if cls.group else name, value, hints[name], columns[name])

    def check_machine(self) -> None:
        """Check that this machine has what the settings need; groups that need something override this.

        Raises:
            SettingError: It has not.
        """

    def to_ros(self) -> dict[str, RosValue]:
        """These settings as ROS values under full ROS names."""
        return {row.name: row.to_ros(getattr(self, row.field)) for row in self.parameters()}


Self = TypeVar('Self', bound=Settings)


def _declared(group: type[Settings]) -> list['dataclasses.Field[object]']:
    """The fields that are parameters."""
    return [field for field in dataclasses.fields(group) if _OWN in field.metadata]


def _checked(name: str, value: object, hint: object, column: _Declaration) -> object:
    """`value` in the exact Python type of the field.

    Raises:
        SettingError: The value is not allowed; the message says what is.
    """
    options = typing.get_args(hint) if isinstance(hint, types.UnionType) else (hint,)
    if value is None and type(None) in options:
        return None
    kind = next(option for option in options if option is not type(None))
    limits = column.limits
    if isinstance(value, _NumpyScalar) and not value.shape:
        value = value.item()  # a bool, a number or a text of NumPy is one of Python
    if typing.get_origin(kind) is Literal:
        if not isinstance(value, str) or value not in typing.get_args(kind):
            choices = ', '.join(typing.get_args(kind))
            raise SettingError(f'{name} cannot be {shown(value)}; use one of: {choices}.')
        return value
    if kind is bool:
        if not isinstance(value, bool):
            raise SettingError(f'{name} must be true or false, not {_shown_with_cure(value, bool)}.')
        return value
    if kind is str:
        if not isinstance(value, str):
            is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
            advice = f"; for this number use the text '{shown(value)}'" if is_number else ''
            raise SettingError(f'{name} must be text, not {shown(value)}{advice}.')
        return value
    if typing.get_origin(kind) is tuple:
        length = len(typing.get_args(kind))
        if isinstance(value, str) or not isinstance(value, Sequence) or len(value) != length:
            raise SettingError(f'{name} must be {length} whole numbers, not {shown(value)}.')
        return tuple(_whole(name, item, limits) for item in value)
    return _whole(name, value, limits) if kind is int else _real(name, value, limits)


def _whole(name: str, value: object, limits: Limits) -> int:
    try:
        if isinstance(value, bool):
            raise TypeError  # noqa: TRY301
        number = operator.index(cast('SupportsIndex', value))
    except TypeError:
        raise SettingError(f'{name} must be a whole number, not {_shown_with_cure(value, int)}.') from None
    if not -_INTEGERS <= number < _INTEGERS:
        raise SettingError(f'{name} is {shown(number)}, which is out of range: it must fit 64 bits.')
    if limits.odd and number % 2 == 0:
        low, high = limits.minimum or 1, limits.maximum or math.inf
        nearest = sorted({int(min(max(near, low), high)) for near in (number - 1, number + 1)})
        raise SettingError(f'{name} must be odd, not {number}; use {" or ".join(map(str, nearest))}.')
    return int(_within(name, number, limits))


def _real(name: str, value: object, limits: Limits) -> float:
    try:
        if isinstance(value, (bool, str)):
            raise TypeError  # noqa: TRY301
        number = float(cast('SupportsFloat', value))
    except OverflowError:
        raise SettingError(f'{name} must be a number that fits 64 bits, not {shown(value)}.') from None
    except (TypeError, ValueError):
        raise SettingError(f'{name} must be a number, not {_shown_with_cure(value, float)}.') from None
    if not math.isfinite(number):
        raise SettingError(f'{name} must be a finite number, not {number}.')
    return _within(name, number, limits)


def _shown_with_cure(value: object, kind: type[bool | int | float]) -> str:
    """A value of the wrong type; with advice if it is a text that would be allowed as what it spells."""
    try:
        spells = isinstance(value, str) and (
            value in ('true', 'false') if kind is bool else math.isfinite(kind(value))
        )
    except ValueError:
        spells = False
    return f'{shown(value)}: write it without quotes' if spells else shown(value)


def _within(name: str, number: float, limits: Limits) -> float:
    too_low = limits.minimum is not None and number < limits.minimum
    too_high = limits.maximum is not None and number > limits.maximum
    if too_low or too_high:
        allowed = (
            f'at least {limits.minimum:g}'
            if limits.maximum is None
            else f'between {limits.minimum or 0:g} and {limits.maximum:g}'
        )
        raise SettingError(f'{name} is {number:g}, which is out of range: it must be {allowed}.')
    return number


def sentence_and_unit(description: str) -> tuple[str, str]:
    """Split `Parameter.description` into sentence and unit; the unit is '' if there is none."""
    match = re.fullmatch(r'(.*) \[([^\[\]]+)\]', description, re.DOTALL)
    return (match[1], match[2]) if match else (description, '')


def choices_in(allowed: str) -> tuple[str, ...]:
    """The choices that `Parameter.allowed` lists for a text; none if any text is allowed."""
    return () if allowed in ('any', '') else tuple(allowed.split(', '))
