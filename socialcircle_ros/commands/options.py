"""Options, progress and messages that several commands share."""

import contextlib
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TypeVar

import click

from socialcircle_ros.errors import SettingError, SocialCircleError
from socialcircle_ros.settings import PARAMETERS, RosValue
from socialcircle_ros.settings.files import as_ros_reads, read_parameter_file

Function = TypeVar('Function', bound=Callable[..., object])


def parameter_options(function: Function) -> Function:
    """Add the options --params-file and -p, which work as in ROS."""
    function = click.option(
        '-p',
        'parameters',
        multiple=True,
        metavar='NAME:=VALUE',
        help='Set one parameter, such as -p circle.radius_scale:=1.5. Overrides --params-file. May be repeated.',
    )(function)
    return click.option(
        '--params-file',
        type=click.Path(path_type=Path),
        help='Parameter file (YAML) as the service ~/save_parameters writes it. Other parameters keep their'
        ' defaults.',
    )(function)


def parameter_values(params_file: Path | None, parameters: tuple[str, ...]) -> dict[str, RosValue]:
    """Read parameters from a file and from -p, which overrides the file.

    Args:
        params_file: a parameter file; None for none.
        parameters: texts of the form NAME:=VALUE.

    Returns:
        Full names to values. Ranges are checked by the settings, not here.

    Raises:
        SettingError: a name is not a parameter, or a text or file cannot be parsed.
        SocialCircleError: the file cannot be read.
    """
    import yaml

    values: dict[str, RosValue] = {}
    if params_file is not None:
        values |= read_parameter_file(params_file)
    for text in parameters:
        name, separator, given = text.partition(':=')
        if not separator:
            raise SettingError(f'-p {text} is not of the form NAME:=VALUE, such as circle.radius_scale:=1.5.')
        try:
            values[name] = yaml.safe_load(given)
        except yaml.YAMLError:
            raise SettingError(f'-p {text}: the value is not YAML.') from None
    for name, value in values.items():
        values[name] = as_ros_reads(name, value)
        if name not in PARAMETERS and not name.startswith(('qos_overrides', 'use_sim_time')):
            raise SettingError(f'There is no parameter {name}; the parameters are: {", ".join(PARAMETERS)}.')
    return values


@contextlib.contextmanager
def progress_bar(description: str) -> Iterator[Callable[[int, int], None]]:
    """Show a progress bar on stderr.

    Args:
        description: text in front of the bar.

    Yields:
        A function to call with the number of finished steps and the number of all steps.
    """
    from rich.console import Console
    from rich.progress import MofNCompleteColumn, Progress

    columns = (*Progress.get_default_columns(), MofNCompleteColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(description, total=None)
        yield lambda done, total: progress.update(task, completed=done, total=total)


def size_in_bytes(ctx: click.Context, param: click.Parameter, value: str) -> int:
    """The number of bytes of an option such as 500M: a number alone, or with k, M, G or T for 10³ to 10¹².

    Raises:
        click.BadParameter: the value is no size.
    """
    found = re.fullmatch(r'(\d+(?:\.\d+)?)([kKMGT]?)', value.strip())
    if found is None:
        raise click.BadParameter(
            f'{value!r} is no size; give bytes, or a number with k, M, G or T: 500M.', ctx, param
        )
    return int(float(found[1]) * 1000 ** ' KMGT'.index(found[2].upper() or ' '))


def quantity(count: int, noun: str) -> str:
    """A number with its noun: 1 cloud, 2 clouds."""
    return f'{count} {noun}' if count == 1 else f'{count} {noun}s'


def tell_refusals(refused: Mapping[str, int], damage: str | None) -> None:
    """Print on stderr what was refused and why, and where the recording is damaged."""
    for reason, count in refused.items():
        click.echo(f'Refused, {count} times: {reason}' if count > 1 else f'Refused: {reason}', err=True)
    if damage:
        click.echo(f'Warning: {damage}', err=True)


def require_ros() -> None:
    """Check that ROS 2 can be imported.

    Raises:
        SocialCircleError: it cannot; the message says how to install it.
    """
    try:
        import rclpy  # noqa: F401
    except ImportError:
        raise SocialCircleError(
            'This command needs ROS 2: source Jazzy, or pip install "socialcircle_ros[ros]".'
        ) from None
