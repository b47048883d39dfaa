"""Options that several commands share, made from the table of parameters."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import click

from socialcircle_ros.errors import SettingError, SocialCircleError
from socialcircle_ros.settings import PARAMETERS
from socialcircle_ros.settings.files import as_ros_reads, read_parameter_file


def parameter_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """Add --params-file and -p, as ROS has them."""
    function = click.option(
        '-p',
        'parameters',
        multiple=True,
        metavar='NAME:=VALUE',
        help='Set one parameter, as with ROS: -p circle.radius_scale:=1.5. May be repeated.',
    )(function)
    return click.option(
        '--params-file',
        type=click.Path(path_type=Path),
        help='A parameter file of the node, such as ~/save_parameters writes.',
    )(function)


def parameter_values(params_file: Path | None, parameters: tuple[str, ...]) -> dict[str, Any]:
    """Full names to values, from a file and from single ones, which win.

    Raises:
        SettingError: a name that is no parameter, or what cannot be read.
    """
    import yaml

    values: dict[str, Any] = {}
    if params_file is not None:
        values |= read_parameter_file(params_file)
    for text in parameters:
        name, separator, value = text.partition(':=')
        if not separator:
            raise SettingError(f'-p {text} is not of the form NAME:=VALUE, such as circle.radius_scale:=1.5.')
        try:
            values[name] = yaml.safe_load(value)
        except yaml.YAMLError:
            raise SettingError(f'-p {text}: the value is not YAML.') from None
    for name, value in values.items():
        values[name] = as_ros_reads(name, value)
        if name not in PARAMETERS and not name.startswith(('qos_overrides', 'use_sim_time')):
            raise SettingError(f'There is no parameter {name}; the parameters are: {", ".join(PARAMETERS)}.')
    return values


def quantity(count: int, noun: str) -> str:
    """A number with its noun: 1 cloud, 2 clouds."""
    return f'{count} {noun}' if count == 1 else f'{count} {noun}s'


def tell_refusals(refused: Mapping[str, int], damage: str | None) -> None:
    """Say on stderr what of a recording could not be used, and why."""
    for reason, count in refused.items():
        click.echo(f'Refused, {count} times: {reason}' if count > 1 else f'Refused: {reason}', err=True)
    if damage:
        click.echo(f'Warning: {damage}', err=True)


def require_ros() -> None:
    """See that ROS 2 is here.

    Raises:
        SocialCircleError: it is not; says how to get it.
    """
    try:
        import rclpy  # noqa: F401
    except ImportError:
        raise SocialCircleError(
            'This command needs ROS 2: source Jazzy, or pip install "socialcircle_ros[ros]".'
        ) from None
