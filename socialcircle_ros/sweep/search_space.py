# SPDX-License-Identifier: Apache-2.0
"""The search space of a sweep: which parameters are varied, and over which values."""

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import cast

from socialcircle_ros.errors import SettingError, shown
from socialcircle_ros.settings import PARAMETERS, CircleSettings, FocusSettings, Parameter, RosValue
from socialcircle_ros.settings.effects import MODE, has_effect, needing
from socialcircle_ros.settings.plain_yaml import PlainYamlError, load_plain_yaml

ParameterValues = dict[str, RosValue]
"""Full names of parameters to their values."""

GROUPS = (FocusSettings, CircleSettings)
"""The groups that can be varied. A change in the first group makes the clouds of all stacks anew."""


MAX_GRID = 100_000
"""Most settings of a grid."""


@dataclass(frozen=True)
class Choice:
    """A parameter that takes one of some values.

    Args:
        name: full name of the parameter.
        values: the values in order, or a single one; repeated values are dropped.

    Raises:
        SettingError: the parameter cannot be swept, it cannot have a value, or there is no value.
    """

    name: str
    values: Sequence[RosValue]

    def __post_init__(self) -> None:
        """Check the values, and convert them to the types that ROS has for the parameter."""
        parameter = _swept(self.name)
        # A text is a sequence, too: of letters.
        is_single = isinstance(self.values, (str, bytes)) or not isinstance(self.values, Iterable)
        values = [cast('RosValue', self.values)] if is_single else self.values
        checked = [_checked(parameter, value) for value in values]
        if not checked:
            raise SettingError(f'{self.name} has no value to try.')
        object.__setattr__(self, 'values', tuple({repr(value): value for value in checked}.values()))


@dataclass(frozen=True)
class Range:
    """A number that takes any value of an interval, both ends included.

    Args:
        name: full name of the parameter.
        low: the lowest value.
        high: the highest value.

    Raises:
        SettingError: the parameter is not a number, it cannot be swept, or it cannot have these values.
    """

    name: str
    low: float
    high: float

    def __post_init__(self) -> None:
        """Check both ends."""
        parameter = _swept(self.name)
        try:
            given = f'{0.0 + self.low:g}:{0.0 + self.high:g}'  # a text is no number here
        except (TypeError, ValueError, OverflowError):
            raise SettingError(f'The ends of the range of {self.name} must be numbers that fit 64 bits.') from None
        _check_ends(parameter, given, self.low, self.high)
        if parameter.limits.odd:
            raise SettingError(f'{self.name} must be odd; give a step, such as {self.name}={given}:2.')
        for end in (self.low, self.high):
            _checked(parameter, int(end) if self.is_whole else end)

    @property
    def is_whole(self) -> bool:
        """Whether the parameter takes whole numbers only."""
        return PARAMETERS[self.name].kind is int


SearchDimension = Choice | Range
"""One dimension of a search space: a parameter and its values."""


def parse_dimension(text: str) -> SearchDimension:
    """Parse a search dimension as the option `--param` has it.

    Args:
        text: NAME=LOW:HIGH:STEP or NAME=VALUE,VALUE for a `Choice`, NAME=LOW:HIGH for a `Range`.

    Raises:
        SettingError: the text has none of these forms, or the parameter cannot have these values.

    Example:
        >>> parse_dimension('circle.window=3,5')
        Choice(name='circle.window', values=(3, 5))
    """
    name, separator, given = text.partition('=')
    name, given = name.strip(), given.strip()
    if not separator or not given:
        raise SettingError(
            f'--param {text} is not of the form NAME=VALUES, such as circle.radius_scale=0.5:3:0.1.'
        )
    parameter = _swept(name)
    return _parse_interval(parameter, given) if ':' in given else _parse_list(parameter, given)


def _parse_interval(parameter: Parameter, given: str) -> SearchDimension:
    name = parameter.name
    try:
        low, high, *rest = [float(part) for part in given.split(':')]
        if len(rest) > 1:
            raise ValueError  # noqa: TRY301 - one message for all
    except ValueError:
        raise _not_a_range(name, given) from None
    if not rest:
        return Range(name, low, high)
    step = rest[0]
    _check_ends(parameter, given, low, high, step)
    count = math.floor((high - low) / step * (1 + 1e-12) + 1e-9) + 1
    if count > MAX_GRID:
        raise SettingError(f'{name}={given} has {count} values; take a larger step, or a search.')
    # Twelve digits, because 0.5 + 3 × 0.1 in floating point is not 0.8.
    values = [float(f'{low + number * step:.12g}') for number in range(count)]
    return Choice(name, [int(value) if parameter.kind is int else value for value in values])


def _parse_list(parameter: Parameter, given: str) -> Choice:
    try:
        values = cast('list[RosValue]', load_plain_yaml(f'[{given}]'))
    except PlainYamlError:
        raise SettingError(f'{parameter.name}={given}: the values are not YAML.') from None
    if parameter.kind is float:
        values = [_number_if_text(value) for value in values]
    return Choice(parameter.name, values)


def _number_if_text(value: RosValue) -> RosValue:
    """YAML 1.1 reads 1e-6 as text; such a text becomes a number."""
    try:
        return float(value) if isinstance(value, str) else value
    except ValueError:
        return value


def _swept(name: str) -> Parameter:
    """The parameter of a name, if it can be swept."""
    names = [parameter.name for group in GROUPS for parameter in group.parameters()]
    if name not in names:
        raise SettingError(f'{name} cannot be swept; these parameters can: {", ".join(names)}.')
    return PARAMETERS[name]


def _check_ends(parameter: Parameter, given: str, low: float, high: float, step: float | None = None) -> None:
    numbers = [low, high] if step is None else [low, high, step]
    if parameter.kind not in (int, float) or not all(map(math.isfinite, numbers)):
        raise _not_a_range(parameter.name, given)
    ascending = low <= high and (step is None or step > 0)
    must_be_whole = parameter.kind is int
    if not ascending or (must_be_whole and any(number != int(number) for number in numbers)):
        wanted = 'whole numbers, ' if must_be_whole else ''
        raise SettingError(f'{parameter.name}={given}: give {wanted}LOW ≤ HIGH, and a STEP above 0.')


def _not_a_range(name: str, given: str) -> SettingError:
    return SettingError(
        f'{name}={given} is not a range of numbers; give LOW:HIGH:STEP, LOW:HIGH for a search, or values separated'
        ' by commas.'
    )


def _checked(parameter: Parameter, value: RosValue) -> RosValue:
    """The value in the type that ROS has for the parameter.

    Raises:
        SettingError: the parameter cannot have it.
    """
    group = next(group for group in GROUPS if group.group == parameter.group)
    return group.from_ros({parameter.name: value}).to_ros()[parameter.name]


def check_search_space(search_space: Sequence[SearchDimension]) -> None:
    """Check that a search space is one, and that it varies something, and each parameter only once.

    Raises:
        SettingError: it is not, or does not.
    """
    if not isinstance(search_space, Sequence) or not all(
        isinstance(each, SearchDimension) for each in search_space
    ):
        raise SettingError(
            f'The search space must be a list of Choice(...) and Range(...), not {shown(search_space)}.'
        )
    names = [dimension.name for dimension in search_space]
    if not names:
        raise SettingError('A sweep needs at least one parameter to vary.')
    for name in names:
        if names.count(name) > 1:
            raise SettingError(f'{name} is given twice; give all its values with one --param.')


def with_mode(search_space: Sequence[SearchDimension], base: Mapping[str, RosValue]) -> list[SearchDimension]:
    """The search space, in the mode 'paper' if a parameter varies that only this mode uses.

    Args:
        search_space: the parameters to vary.
        base: all parameters as given.
    """
    names = [dimension.name for dimension in search_space]
    switched = base[MODE] != 'paper' and MODE not in names and not set(names).isdisjoint(needing('paper'))
    return [*([Choice(MODE, ['paper'])] if switched else []), *search_space]


def setting_as_given(search_space: Sequence[SearchDimension], base: Mapping[str, RosValue]) -> ParameterValues:
    """The given values of the parameters that vary; if the given mode is not tried, of those that it uses.

    Args:
        search_space: the parameters to vary.
        base: all parameters as given.
    """
    names = [dimension.name for dimension in search_space]
    if switched_mode(search_space, base):
        names = [name for name in names if has_effect(name, base)]
    return {name: base[name] for name in names}


def switched_mode(search_space: Sequence[SearchDimension], base: Mapping[str, RosValue]) -> bool:
    """Whether the search space has another mode only than the one that is given."""
    return any(
        isinstance(each, Choice) and each.name == MODE and base[MODE] not in each.values for each in search_space
    )


def grid(search_space: Sequence[SearchDimension]) -> list[ParameterValues]:
    """List every combination of values; parameters that make clouds of stacks anew change last.

    Args:
        search_space: one `Choice` per parameter.

    Raises:
        SettingError: a `Range` has no step, a parameter is given twice, or there are too many combinations.
    """
    check_search_space(search_space)
    for dimension in search_space:
        if isinstance(dimension, Range):
            given = f'{dimension.name}={dimension.low:g}:{dimension.high:g}'
            raise SettingError(
                f'{given} has no step, and a grid needs one: add it, such as {given}:{_usual_step(dimension)}, or'
                ' search with --search 50.'
            )
    groups = [group.group for group in GROUPS]
    ordered = sorted(search_space, key=lambda dimension: groups.index(PARAMETERS[dimension.name].group))
    values = [dimension.values for dimension in ordered if isinstance(dimension, Choice)]
    count = math.prod(map(len, values))
    if count > MAX_GRID:
        raise SettingError(f'The grid has {count} settings, and at most {MAX_GRID} are tried: use --search.')
    names = [dimension.name for dimension in ordered]
    return [dict(zip(names, combination, strict=True)) for combination in itertools.product(*values)]


def _usual_step(dimension: Range) -> str:
    return '1' if dimension.is_whole else f'{(dimension.high - dimension.low) / 10 or 1:g}'


def contains(search_space: Sequence[SearchDimension], values: Mapping[str, RosValue]) -> bool:
    """Whether a setting is a point of the search space."""
    if {dimension.name for dimension in search_space} != values.keys():
        return False
    return all(_has(dimension, values[dimension.name]) for dimension in search_space)


def _has(dimension: SearchDimension, value: RosValue) -> bool:
    if isinstance(dimension, Choice):
        return value in dimension.values
    return isinstance(value, (int, float)) and dimension.low <= value <= dimension.high


def described(search_space: Sequence[SearchDimension]) -> Iterator[str]:
    """Describe each dimension in words."""
    for dimension in search_space:
        if isinstance(dimension, Range):
            yield f'{dimension.name} from {dimension.low:g} to {dimension.high:g}'
        elif len(dimension.values) > 8:
            first, last = dimension.values[0], dimension.values[-1]
            yield f'{dimension.name} in {len(dimension.values)} steps from {first} to {last}'
        else:
            yield f'{dimension.name} {", ".join(map(str, dimension.values))}'
