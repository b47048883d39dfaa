# SPDX-License-Identifier: Apache-2.0
"""Options, progress and messages that several commands share."""

import contextlib
import re
import shlex
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar, cast

import click

from socialcircle_ros.errors import SettingError, SocialCircleError, install_command
from socialcircle_ros.settings import PARAMETERS, RosValue
from socialcircle_ros.settings.files import read_parameter_file
from socialcircle_ros.settings.rcl_rules import RclError, rcl_value
from socialcircle_ros.settings.spelling import nearest_parameter

if TYPE_CHECKING:
    from rich.progress import Progress

    from socialcircle_ros.settings import LimitSettings

_NODE = 'socialcircle.node'
_MOST_DIGITS = 20  # of a size in bytes

Function = TypeVar('Function', bound=Callable[..., object])


def parameter_options(function: Function) -> Function:
    """Add the options --params-file, --node and -p, which work as in ROS."""
    function = click.option(
        '--node',
        metavar='NAME',
        expose_value=False,
        callback=_keep_node,
        help='Node, such as /cell1/social_circle: its parameters are read from --params-file, if the file has'
        ' different ones for several.',
    )(function)
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


def parameter_values(
    params_file: Path | None, parameters: tuple[str, ...], recording: Path | None = None
) -> dict[str, RosValue]:
    """Read parameters from a file and from -p, which overrides the file.

    Args:
        params_file: a parameter file; None for none.
        parameters: texts of the form NAME:=VALUE.
        recording: its namespaces choose among the sections of a file that has several for the node.

    Returns:
        Full names to values. Ranges are checked by the settings, not here.

    Raises:
        SettingError: a name is not a parameter, or a text or file cannot be parsed.
        SocialCircleError: the file cannot be read.
    """
    values: dict[str, RosValue] = {}
    if params_file is not None:
        context = click.get_current_context(silent=True)
        from socialcircle_ros.interface import NODE_NAME  # loads NumPy, which --help does not need

        node = context.meta.get(_NODE, NODE_NAME) if context is not None else NODE_NAME
        values |= read_parameter_file(params_file, node, lambda: _recorded_namespaces(recording))
        for name in [name for name in values if not _is_known(name)]:
            near = nearest_parameter(name)
            hint = f' Did you mean {near}?' if near else ''
            click.echo(
                f'Warning: there is no parameter {name}; its value in {params_file} has no effect.{hint}', err=True
            )
            del values[name]
    for text in parameters:
        name, separator, given = text.partition(':=')
        if not separator:
            raise SettingError(f'-p {text} is not of the form NAME:=VALUE, such as circle.radius_scale:=1.5.')
        if not _is_known(name):
            near = nearest_parameter(name)
            hint = f'did you mean {near}?' if near else f'the parameters are: {", ".join(PARAMETERS)}.'
            raise SettingError(f'There is no parameter {name}; {hint}')
        try:
            value = rcl_value(given)
        except RclError as error:
            raise SettingError(f'-p {text} cannot be read, because {error}.') from None
        if value is None:
            raise SettingError(f'-p {text} has no value, such as circle.radius_scale:=1.5.')
        values[name] = cast('RosValue', value)
    return values


def _keep_node(context: click.Context, _: click.Parameter, name: str | None) -> None:
    if name is not None:
        context.meta[_NODE] = name


def _recorded_namespaces(recording: Path | None) -> list[str]:
    """The namespaces in which a recording has input of a node."""
    from socialcircle_ros.recording import open_recording

    if recording is None:
        return []
    with open_recording(recording) as reader:
        from socialcircle_ros.interface import (
            POINTS,
            STACK_FRAMES,
            STACK_POINTS,
        )  # loads NumPy, which --help does not need

        # The first that fits: stack/points is the cloud of a stack, and not points in a namespace `stack`.
        kinds = (STACK_POINTS, STACK_FRAMES, POINTS)
        found = [
            next((n for kind in kinds if (n := kind.namespace_of(name)) is not None), None)
            for name in reader.topics
        ]
    return sorted({namespace for namespace in found if namespace is not None})


def _is_known(name: str) -> bool:
    """Whether a node has the parameter; rclpy itself declares those for QoS and simulated time."""
    return name in PARAMETERS or name.startswith(('qos_overrides', 'use_sim_time'))


@contextlib.contextmanager
def progress_bar(description: str) -> Iterator[Callable[[int, int], None]]:
    """Show a progress bar on stderr.

    Args:
        description: text in front of the bar.

    Yields:
        A function to call with the number of finished steps and the number of all steps.
    """
    with progress_display() as progress:
        task = progress.add_task(description, total=None)
        yield lambda done, total: progress.update(task, completed=done, total=total)


def progress_display() -> 'Progress':
    """A display on stderr of what is done, the rate, and the time left."""
    from rich.progress import BarColumn, MofNCompleteColumn, Task, TextColumn, TimeRemainingColumn
    from rich.text import Text

    from .console import CommandProgress

    class Rate(TextColumn):
        def __init__(self) -> None:
            super().__init__('')

        def render(self, task: Task) -> Text:
            return Text(f'{task.speed:.2f}/s' if task.speed else '')

    columns = (TextColumn('{task.description}'), BarColumn(), MofNCompleteColumn(), Rate(), TimeRemainingColumn())
    return CommandProgress(*columns, speed_estimate_period=300)


class Number(click.FloatRange):
    """A number of an option, in a range if one is given. NaN and infinite or excessive numbers are refused."""

    _LARGEST = 1e12

    def convert(self, value: float, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """The number; click calls this."""
        number = super().convert(value, param, ctx)
        if not abs(number) <= self._LARGEST:  # NaN compares as false
            self.fail(f'{number} is no number up to {self._LARGEST:g}.', param, ctx)
        return number

    def _describe_range(self) -> str:
        # For the help of click, which expects that a bound is given.
        return '' if self.min is None and self.max is None else super()._describe_range()


def size_in_bytes(ctx: click.Context, param: click.Parameter, value: str) -> int:
    """The number of bytes of an option such as 500M: a number alone, or with k, M, G or T for 10³ to 10¹².

    Raises:
        click.BadParameter: the value is no size.
    """
    found = re.fullmatch(r'(\d+(?:\.\d+)?)([kKMGT]?)', value.strip())
    if found is None or len(found[1]) > _MOST_DIGITS:
        raise click.BadParameter(
            f'{value!r} is no size; give bytes, or a number with k, M, G or T: 500M.', ctx, param
        )
    return int(float(found[1]) * 1000 ** ' KMGT'.index(found[2].upper() or ' '))


def quantity(count: int, noun: str, plural: str = '') -> str:
    """A number with its noun: 1 cloud, 2 clouds."""
    return f'{count} {noun}' if count == 1 else f'{count} {plural or noun + "s"}'


def shell_words(*words: object) -> str:
    """Words of a command as a person types them in a shell, with quotes where they need some."""
    return shlex.join(map(str, words))


def place_text(output: Path) -> str:
    """Where a result was written; the name of a directory looks like that of a file."""
    return f'the directory {output}' if output.is_dir() else str(output)


def stack_text(output: Path, parameters: Path) -> str:
    """Where a focus stack and its parameters were written, and the command that filters it."""
    given = shell_words(output, '--params-file', parameters, '-o', 'cleaned.mcap')
    return f'written to {place_text(output)}, parameters to {parameters}.\nNext: socialcircle filter {given}'


def tell_refusals(refused: Mapping[str, int], damage: str | None, first: Mapping[str, str] | None = None) -> None:
    """Print on stderr what was refused and why, and where the recording is damaged.

    Args:
        refused: how often, by reason.
        damage: where the recording breaks off; None: it is sound.
        first: name of the first refused cloud, by reason, as far as it is known.
    """
    for reason, count in refused.items():
        times = f', {count} times' if count > 1 else ''
        name = (first or {}).get(reason)
        where = '' if name is None else f', {"first " if times else ""}{name}'
        click.echo(f'Refused{times}{where}: {reason}', err=True)
    if damage:
        click.echo(f'Warning: {damage}', err=True)


LIMITS_FAILED = 3
"""Exit code if a measurement failed its limits; everything is written by then."""


def tell_failures(
    failures: Sequence[str], judged: int, refused: int, limits: 'LimitSettings', units: Iterable[str | None]
) -> None:
    """Print which measurements failed their limits, and end with `LIMITS_FAILED` if any did.

    Args:
        failures: one sentence for each measurement that failed.
        judged: number of measurements that were held to limits; 0: no limit is set.
        refused: number of clouds and frames that could not be measured; where limits are set, they fail as well.
        limits: the limits.
        units: those of the clouds; None among them: not known.
    """
    if not judged:
        return
    for failure in failures:
        click.echo(f'Failed: {failure}', err=True)
    if refused:
        click.echo(f'Failed: {quantity(refused, "refused cloud or frame", "refused clouds or frames")}.', err=True)
    passed = f'{judged - len(failures)} of {quantity(judged, "measurement")} passed the limits.'
    click.echo(f'{passed} {_limits_text(limits, units)}')
    if failures or refused:
        raise click.exceptions.Exit(LIMITS_FAILED)


def _limits_text(limits: 'LimitSettings', units: Iterable[str | None]) -> str:
    """The limits with their unit, as a sentence."""
    from socialcircle_ros.digits import share_text
    from socialcircle_ros.lengths import length_text

    known = set(units)
    unit = known.pop() if len(known) == 1 else None
    texts = []
    if limits.outlier_share_max is not None:
        texts.append(f'at most {share_text(limits.outlier_share_max, padded=False)} outliers')
    if limits.measured_share_min is not None:
        texts.append(f'at least {share_text(limits.measured_share_min, padded=False)} measured')
    for name, low, high in limits.of_texture:
        for bound, value in (('at least', low), ('at most', high)):
            if value is not None:
                texts.append(f'{name} {bound} {length_text(value, unit)}')
    return f'Limits: {"; ".join(texts)}.'


def require_ros() -> None:
    """Check that ROS 2 can be imported.

    Raises:
        SocialCircleError: it cannot; the message says how to install it.
    """
    try:
        import rclpy  # noqa: F401
    except ImportError:
        raise SocialCircleError(f'This command needs ROS 2: source Jazzy, or {install_command("ros")}.') from None


topics_option = click.option(
    '--topic',
    'topics',
    multiple=True,
    help='Topic of clouds to filter. May be repeated. Default: all topics named points, and all focus stacks.',
)
"""The option of the commands that filter recordings."""
