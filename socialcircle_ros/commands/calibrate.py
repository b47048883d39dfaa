# SPDX-License-Identifier: Apache-2.0
"""`socialcircle calibrate`: options and printing; the measurements are in `recording.calibration`."""

import re
from pathlib import Path

import click

from socialcircle_ros.errors import SettingError

from .options import parameter_options, parameter_values, progress_bar, quantity, tell_refusals


def _length(context: click.Context, parameter: click.Parameter, text: str) -> float:  # noqa: ARG001 - click's signature
    """Read a length with its unit, in m."""
    from socialcircle_ros.lengths import metres_per

    found = re.fullmatch(r'\s*([0-9.]+(?:[eE][-+]?[0-9]+)?)\s*(\D+)', text)
    try:
        value = float(found[1]) * metres_per(found[2]) if found else 0.0
    except (ValueError, SettingError):
        value = 0.0
    if not value > 0:
        raise click.BadParameter(f'{text!r} is no length; give a number and a unit, such as 10um.')
    return value


@click.group(
    'calibrate', epilog='Example: socialcircle calibrate latency up_and_down.mcap --params-file cell.yaml'
)
def command() -> None:
    """Measure what the parameters of an instrument must be, from its own recordings and images."""


@command.command('latency')
@click.argument('recording', type=click.Path(path_type=Path))
@parameter_options
def _latency(recording: Path, params_file: Path | None, parameters: tuple[str, ...]) -> None:
    """Measure stack.latency, the time from the position of the stage to the stamp of the frame that shows it.

    RECORDING holds the frames and the joint states of one part that does not move, scanned upward and downward,
    once or several times. The latency shifts the heights of both scans in opposite directions.
    """
    from socialcircle_ros.recording import open_recording
    from socialcircle_ros.recording.calibration import PASSES, measure_latency
    from socialcircle_ros.settings import PipelineSettings

    settings = PipelineSettings.from_ros(
        {'stack.z_source': 'joint_states', **parameter_values(params_file, parameters, recording)}
    )
    with open_recording(recording) as reader:
        total = PASSES * reader.message_count
    done = 0
    with progress_bar(f'measuring {recording.name}') as progress:

        def seen(_: int) -> None:
            nonlocal done
            done += 1
            progress(min(done, total), total)

        found = measure_latency(recording, settings, seen)
    spread = f', within {1e3 * found.spread_s:.3f} ms' if found.pairs > 1 else ''
    click.echo(f'Latency: {1e3 * found.latency_s:.3f} ms, from {quantity(found.pairs, "pair")} of scans{spread}.')
    click.echo(
        f'Heights up and down differ by {1e6 * found.before_m:.3f} µm with stack.latency'
        f' {settings.stack.latency:g} s, and by {1e6 * found.after_m:.3f} µm with the new one.'
    )
    click.echo(f'Set stack.latency: {found.latency_s:.6f}')
    tell_refusals(found.refused, found.damage)


@command.command('pitch')
@click.argument('image', type=click.Path(path_type=Path))
@click.option(
    '--period', required=True, callback=_length, help='Distance of two lines of the grating, with unit: 10um.'
)
def _pitch(image: Path, period: float) -> None:
    """Measure stack.pitch_x from the image of a grating of parallel lines, in focus, that fills the frame.

    Lines along y (upright) give the pitch along x, lines along x the pitch along y. Oblique lines give one pitch
    for both, for square pixels. Measure once for each objective, and keep one parameter file for each.
    """
    from socialcircle_ros.recording.calibration import measure_pitch, read_gray

    found = measure_pitch(read_gray(image), period)
    click.echo(
        f'Period: {found.period_px:.4f} pixels, {found.periods:.0f} of them across the image; normal of the lines'
        f' at {found.angle_deg:.2f}° from x.'
    )
    name = 'stack.pitch_y' if abs(found.angle_deg) > 80 else 'stack.pitch_x'
    click.echo(f'Set {name}: {found.pitch_m:.6e}')
