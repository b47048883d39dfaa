"""The parameters that a sweep varies, and over what: `circle.radius_scale=0.5:3:0.1`, `circle.window=3,5`."""

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import yaml

from socialcircle_ros.errors import SettingError
from socialcircle_ros.settings import PARAMETERS, CircleSettings, FocusSettings, Parameter, RosValue

Values = dict[str, RosValue]
"""Full names of parameters to their values."""

GROUPS = (FocusSettings, CircleSettings)
"""What can be varied: what decides which points are outliers. A change of the first group measures stacks anew."""

MOST = 100_000
"""Settings that a grid may have."""


@dataclass(frozen=True)
class Choice:
    """Some values of one parameter."""

    name: str
    values: Sequence[RosValue]


@dataclass(frozen=True)
class Range:
    """All values of a number between two, both included."""

    name: str
    low: float
    high: float
    whole: bool


SearchDimension = Choice | Range


def parse_dimension(text: str) -> SearchDimension:
    """What `--param` says: NAME=LOW:HIGH:STEP, NAME=LOW:HIGH, or NAME=VALUE,VALUE.

    Raises:
        SettingError: it says none of these, or a value that the parameter cannot have.
    """
    name, separator, given = text.partition('=')
    name = name.strip()
    swept = [row.name for group in GROUPS for row in group.parameters()]
    if not separator or not given.strip():
        raise SettingError(
            f'--param {text} is not of the form NAME=VALUES, such as circle.radius_scale=0.5:3:0.1.'
        )
    if name not in swept:
        raise SettingError(f'{name} cannot be swept; these can: {", ".join(swept)}.')
    row = PARAMETERS[name]
    return _range(row, given) if ':' in given else _choice(row, given)


def _range(row: Parameter, given: str) -> SearchDimension:
    try:
        low, high, *rest = numbers = [float(part) for part in given.split(':')]
        if len(rest) > 1 or not all(map(math.isfinite, numbers)) or row.kind not in (int, float):
            raise ValueError  # noqa: TRY301
    except ValueError:
        raise SettingError(
            f'--param {row.name}={given} is no range of numbers; give LOW:HIGH:STEP, LOW:HIGH for a search, or'
            ' values with commas.'
        ) from None
    whole = row.kind is int
    if high < low or (rest and rest[0] <= 0) or (whole and any(number != int(number) for number in numbers)):
        wanted = 'whole numbers, ' if whole else ''
        raise SettingError(f'--param {row.name}={given}: give {wanted}LOW ≤ HIGH, and a STEP above 0.')
    if not rest:
        if row.limits.odd:
            raise SettingError(f'{row.name} must be odd; give a step, such as {row.name}={given}:2.')
        for end in (low, high):
            _check(row, int(end) if whole else end)
        return Range(row.name, low, high, whole)
    step = rest[0]
    count = math.floor((high - low) / step * (1 + 1e-12) + 1e-9) + 1
    if count > MOST:
        raise SettingError(f'--param {row.name}={given} has {count} values; take a larger step, or a search.')
    # 0.5 + 3 × 0.1 is meant to be 0.8.
    values = [float(f'{low + number * step:.12g}') for number in range(count)]
    return Choice(row.name, [_check(row, int(value) if whole else value) for value in values])


def _choice(row: Parameter, given: str) -> Choice:
    try:
        values = yaml.safe_load(f'[{given}]')
    except yaml.YAMLError:
        raise SettingError(f'--param {row.name}={given}: the values are not YAML.') from None
    if row.kind is float:
        values = [float(value) if _is_number(value) else value for value in values]
    if not values:
        raise SettingError(f'--param {row.name}={given} has no value.')
    return Choice(row.name, list({repr(value): _check(row, value) for value in values}.values()))


def _is_number(value: Any) -> bool:
    try:
        float(value)
    except (TypeError, ValueError):
        return False
    return not isinstance(value, bool)


def _check(row: Parameter, value: Any) -> RosValue:
    """The value as ROS holds it.

    Raises:
        SettingError: the parameter cannot have it.
    """
    group = next(group for group in GROUPS if group.group == row.group)
    return group.from_ros({row.name: value}).to_ros()[row.name]


def grid(search_space: Sequence[SearchDimension]) -> list[Values]:
    """Every combination, those that measure stacks anew changing last.

    Raises:
        SettingError: a range without a step, a parameter that is given twice, or too many combinations.
    """
    _check_names(search_space)
    for each in search_space:
        if isinstance(each, Range):
            raise SettingError(
                f'{each.name}={each.low:g}:{each.high:g} has no step, which a grid needs: add one, such as'
                f' {each.name}={each.low:g}:{each.high:g}:{_step(each)}, or search with --search 50.'
            )
    order = [group.group for group in GROUPS]
    slowest_first = sorted(search_space, key=lambda each: order.index(PARAMETERS[each.name].group))
    choices = [each.values for each in slowest_first if isinstance(each, Choice)]
    count = math.prod(map(len, choices))
    if count > MOST:
        raise SettingError(f'The grid has {count} settings; at most {MOST} are tried: use --search instead.')
    names = [each.name for each in slowest_first]
    return [dict(zip(names, values, strict=True)) for values in itertools.product(*choices)]


def contains(search_space: Sequence[SearchDimension], values: Mapping[str, RosValue]) -> bool:
    """Whether a setting is one of those that the search_space span."""
    if {each.name for each in search_space} != values.keys():
        return False
    return all(
        each.low <= float(values[each.name]) <= each.high  # type: ignore[arg-type]
        if isinstance(each, Range)
        else values[each.name] in each.values
        for each in search_space
    )


def _check_names(search_space: Sequence[SearchDimension]) -> None:
    names = [each.name for each in search_space]
    for name in names:
        if names.count(name) > 1:
            raise SettingError(f'{name} is given twice; give all its values with one --param.')


def _step(each: Range) -> str:
    return '1' if each.whole else f'{(each.high - each.low) / 10 or 1:g}'


def words(search_space: Sequence[SearchDimension]) -> Iterator[str]:
    """What is varied, a phrase for each."""
    for each in search_space:
        if isinstance(each, Range):
            yield f'{each.name} from {each.low:g} to {each.high:g}'
        elif len(each.values) > 8:
            yield f'{each.name} in {len(each.values)} steps from {each.values[0]} to {each.values[-1]}'
        else:
            yield f'{each.name} {", ".join(map(str, each.values))}'
