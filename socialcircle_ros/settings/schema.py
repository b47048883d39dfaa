"""What a parameter is: name, type, default, unit, range and sentence, declared as fields of frozen dataclasses.

A settings object is valid once it exists: its creation checks each value, then the values together.
"""

import dataclasses
import math
import operator
import re
import types
import typing
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, TypeVar

from socialcircle_ros.errors import SettingError

RosValue = bool | int | float | str | list[int]
"""What a ROS parameter can hold, of the kinds that are used here."""

_OWN = 'socialcircle'


@dataclass(frozen=True)
class Limits:
    """What a value may be, beside its type."""

    minimum: float | None = None
    maximum: float | None = None
    odd: bool = False
    choices: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Column:
    """What a dataclass field cannot say by itself."""

    sentence: str
    unit: str
    limits: Limits
    empty: RosValue | None  # what stands for None on ROS's side, where a parameter cannot be None
    read_only: bool


def setting(
    default: Any,
    sentence: str,
    *,
    unit: str = '',
    minimum: float | None = None,
    maximum: float | None = None,
    odd: bool = False,
    choices: tuple[str, ...] = (),
    empty: RosValue | None = None,
    read_only: bool = False,
) -> Any:
    """A row of the table: a dataclass field with its default and all that is to be said of it."""
    column = _Column(sentence, unit, Limits(minimum, maximum, odd, choices), empty, read_only)
    return dataclasses.field(default=default, metadata={_OWN: column})


@dataclass(frozen=True)
class Parameter:
    """One parameter as the outside sees it: ROS, YAML and the README.

    `kind` is the type of `default`, and the type that ROS declares; `default` is on ROS's side,
    where None is written as `empty` (0: chosen).
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

    @property
    def name(self) -> str:
        """The full name, `group.field`; without a group the field alone."""
        return f'{self.group}.{self.field}' if self.group else self.field

    @property
    def allowed(self) -> str:
        """In words, which values are accepted."""
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
        """Sentence and unit, as ROS's descriptor holds them; `sentence_and_unit` takes them apart."""
        return f'{self.sentence} [{self.unit}]' if self.unit else self.sentence

    def to_ros(self, value: Any) -> RosValue:
        """The Python value as ROS holds it."""
        if value is None:
            if self.empty is None:
                raise SettingError(f'{self.name} needs a value.')
            return self.empty
        ros: RosValue = list(value) if isinstance(value, tuple) else value
        return ros

    def from_ros(self, value: Any) -> Any:
        """The ROS value as Python holds it; `empty` becomes None."""
        if isinstance(value, Sequence) and not isinstance(value, str):
            value = tuple(value)
            return None if self.empty is not None and list(value) == self.empty else value
        is_empty = self.empty is not None and not isinstance(value, bool) and value == self.empty
        return None if is_empty else value


@dataclass(frozen=True)
class Settings:
    """Base of the groups of settings: checks values on creation, converts from and to ROS's side."""

    group: ClassVar[str] = ''

    def __post_init__(self) -> None:
        """Check every value.

        Raises:
            SettingError: a value is of a wrong type or out of its range; says which would do.
        """
        hints = typing.get_type_hints(type(self))
        for field in dataclasses.fields(self):
            column: _Column = field.metadata[_OWN]
            name = f'{self.group}.{field.name}' if self.group else field.name
            value = _checked(name, getattr(self, field.name), hints[field.name], column)
            object.__setattr__(self, field.name, value)
        self._check_together()

    def _check_together(self) -> None:
        """Check what single values cannot tell; groups that have such a rule override this."""

    @classmethod
    def parameters(cls) -> tuple[Parameter, ...]:
        """This group's rows of the table."""
        rows = []
        for field in dataclasses.fields(cls):
            column: _Column = field.metadata[_OWN]
            default: Any = column.empty if field.default is None else field.default
            if default is None:
                raise TypeError(f'{field.name} needs a default or an empty value.')
            rows.append(
                Parameter(
                    group=cls.group,
                    field=field.name,
                    kind=type(default),
                    default=default,
                    unit=column.unit,
                    limits=column.limits,
                    sentence=column.sentence,
                    read_only=column.read_only,
                    empty=column.empty,
                )
            )
        return tuple(rows)

    @classmethod
    def from_ros(cls: type['Self'], values: Mapping[str, Any]) -> 'Self':
        """Settings from full ROS names to values; names of other groups are passed over.

        Raises:
            SettingError: as on creation.
        """
        return cls(**{row.field: row.from_ros(values[row.name]) for row in cls.parameters() if row.name in values})

    def to_ros(self) -> dict[str, RosValue]:
        """These settings under their full ROS names."""
        return {row.name: row.to_ros(getattr(self, row.field)) for row in self.parameters()}


Self = TypeVar('Self', bound=Settings)


def _checked(name: str, value: Any, hint: Any, column: _Column) -> Any:
    """`value` in its exact Python type, or a SettingError that says what would do."""
    options = typing.get_args(hint) if isinstance(hint, types.UnionType) else (hint,)
    if value is None and type(None) in options:
        return None
    kind = next(option for option in options if option is not type(None))
    limits = column.limits
    if typing.get_origin(kind) is Literal:
        if value not in typing.get_args(kind):
            raise SettingError(f'{name} cannot be {value!r}; use one of: {", ".join(typing.get_args(kind))}.')
        return value
    if kind is bool:
        if not isinstance(value, bool):
            raise SettingError(f'{name} must be true or false, not {value!r}.')
        return value
    if kind is str:
        if not isinstance(value, str):
            raise SettingError(f'{name} must be a text, not {value!r}.')
        return value
    if typing.get_origin(kind) is tuple:
        length = len(typing.get_args(kind))
        if isinstance(value, str) or not isinstance(value, Sequence) or len(value) != length:
            raise SettingError(f'{name} must be {length} whole numbers, not {value!r}.')
        return tuple(_whole(name, item, limits) for item in value)
    return _whole(name, value, limits) if kind is int else _real(name, value, limits)


def _whole(name: str, value: Any, limits: Limits) -> int:
    try:
        if isinstance(value, bool):
            raise TypeError  # noqa: TRY301
        number = operator.index(value)
    except TypeError:
        raise SettingError(f'{name} must be a whole number, not {value!r}.') from None
    if limits.odd and number % 2 == 0:
        near = max(number - 1, int(limits.minimum or 1))
        raise SettingError(f'{name} must be odd, not {number}; {near} or {number + 1} would do.')
    return int(_within(name, number, limits))


def _real(name: str, value: Any, limits: Limits) -> float:
    try:
        if isinstance(value, (bool, str)):
            raise TypeError  # noqa: TRY301
        number = float(value)
    except (TypeError, ValueError):
        raise SettingError(f'{name} must be a number, not {value!r}.') from None
    if not math.isfinite(number):
        raise SettingError(f'{name} must be a finite number, not {number}.')
    return _within(name, number, limits)


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
    """The sentence and the unit of `Parameter.description`; a description without a unit gives ''."""
    match = re.fullmatch(r'(.*) \[([^\[\]]+)\]', description, re.DOTALL)
    return (match[1], match[2]) if match else (description, '')


def choices_in(allowed: str) -> tuple[str, ...]:
    """The choices of a text that `Parameter.allowed` lists; none where any text is allowed."""
    return () if allowed in ('any', '') else tuple(allowed.split(', '))
