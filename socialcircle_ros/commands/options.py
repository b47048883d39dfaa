"""Options that several commands share, made from the table of parameters."""

import contextlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import click

from socialcircle_ros.errors import SettingError, SocialCircleError
from socialcircle_ros.settings import PARAMETERS


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
        try:
            content = yaml.safe_load(params_file.read_text(encoding='utf-8'))
        except OSError as error:
            raise SocialCircleError(f'{params_file} cannot be read: {error.strerror}.') from None
        except (yaml.YAMLError, UnicodeDecodeError):
            raise SettingError(f'{params_file} is not YAML; see config/social_circle.yaml for the form.') from None
        values |= _ros_parameters(params_file, content)
    for text in parameters:
        name, separator, value = text.partition(':=')
        if not separator:
            raise SettingError(f'-p {text} is not of the form NAME:=VALUE, such as circle.radius_scale:=1.5.')
        try:
            values[name] = yaml.safe_load(value)
        except yaml.YAMLError:
            raise SettingError(f'-p {text}: the value is not YAML.') from None
    for name, value in values.items():
        if name in PARAMETERS and PARAMETERS[name].kind is float and isinstance(value, str):
            # YAML 1.1 takes 1e-6 for a text; ROS takes it for a number.
            with contextlib.suppress(ValueError):
                values[name] = float(value)
        if name not in PARAMETERS and not name.startswith(('qos_overrides', 'use_sim_time')):
            raise SettingError(f'There is no parameter {name}; the parameters are: {", ".join(PARAMETERS)}.')
    return values


def _ros_parameters(path: Path, content: Any) -> dict[str, Any]:
    """The parameters of every node in a ROS parameter file, nested or dotted, under dotted names."""
    found: dict[str, Any] = {}

    def walk(prefix: str, item: Any) -> None:
        if isinstance(item, dict):
            for key, value in item.items():
                walk(f'{prefix}.{key}' if prefix else str(key), value)
        else:
            found[prefix] = item

    for node in (content or {}).values() if isinstance(content, dict) else ():
        if isinstance(node, dict):
            walk('', node.get('ros__parameters', {}))
    if not found:
        raise SettingError(f'{path} holds no ros__parameters; see config/social_circle.yaml for the form.')
    return found


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
