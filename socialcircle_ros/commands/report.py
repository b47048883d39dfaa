"""`socialcircle report`."""

import contextlib
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

import click

from .options import parameter_options, parameter_values, quantity, tell_refusals

if TYPE_CHECKING:
    from collections.abc import Iterator

    from socialcircle_ros.pipeline.stacks import Refusal
    from socialcircle_ros.recording.offline import SourceCloud


@click.command('report', epilog='Example: socialcircle report bags/parts.mcap -o report.html')
@click.argument('recording', type=click.Path(path_type=Path))
@click.option(
    '-o', '--output', type=click.Path(path_type=Path), default=Path('report.html'), show_default=True,
    help='The page; one that is there is replaced.',
)  # fmt: skip
@click.option('--topic', 'topics', multiple=True, help='A topic of clouds; default: those named points.')
@parameter_options
def command(
    recording: Path,
    output: Path,
    topics: tuple[str, ...],
    params_file: Path | None,
    parameters: tuple[str, ...],
) -> None:
    """Filter a RECORDING and write one HTML page about it, which needs no other file and can be printed.

    Of each cloud, and each focus stack: height maps before and after, the outlier mask, counts, seed and radius,
    Sa, Sq and Sz before and after, times, settings and warnings; precision and recall where the recording knows
    the truth. What a node said of the same cloud when it was recorded is compared.
    """
    from rich.console import Console
    from rich.progress import Progress

    from socialcircle_ros.errors import SocialCircleError
    from socialcircle_ros.kernels.ordered import in_order
    from socialcircle_ros.pipeline.clouds import filter_cloud
    from socialcircle_ros.pipeline.stacks import Refusal
    from socialcircle_ros.recording import open_recording
    from socialcircle_ros.recording.offline import STACK_POINTS, SourceCloud, measurements_of, source_clouds
    from socialcircle_ros.recording.truth import truths_of
    from socialcircle_ros.report.entry import ReportEntry, make_entry, report_page
    from socialcircle_ros.report.page import prepare, save
    from socialcircle_ros.report.thumbnails import colour_bar
    from socialcircle_ros.settings import OutputSettings, PipelineSettings

    job = PipelineSettings.from_ros(parameter_values(params_file, parameters))
    wanted = OutputSettings(mask=True, repaired=job.output.repaired)
    colour_bar()  # says that matplotlib is missing now, not after minutes
    if output.is_dir():
        raise SocialCircleError(f'{output} is a directory; give the name of a page, such as {output}/report.html.')
    prepare(output.parent)
    refused: Counter[str] = Counter()
    with open_recording(recording) as reader:
        truths, recorded = truths_of(reader), measurements_of(reader)
        counts: Counter[str] = Counter()

        def one(event: 'tuple[str, SourceCloud] | Refusal') -> ReportEntry | str:
            """A measurement, or why there is none."""
            if isinstance(event, Refusal):
                return event.reason
            name, cloud = event
            try:
                result = filter_cloud(cloud.points, job.circle, wanted, job.repair, cloud.depth_of_field)
            except SocialCircleError as refusal:
                return str(refusal)
            truth = truths(cloud.namespace, cloud.points)
            return make_entry(
                name,
                cloud.points,
                result,
                unit='' if cloud.image is None else 'm',
                warning=cloud.warning,
                truth=None if truth is None else (truth.outlier, truth.counted),
                recorded=recorded.get((cloud.namespace, result.status.values['stamp'])),
            )

        measurements: list[ReportEntry] = []
        with Progress(console=Console(stderr=True), transient=True) as progress:
            task = progress.add_task(f'looking at {recording.name}', total=reader.message_count)

            def named() -> 'Iterator[tuple[str, SourceCloud] | Refusal]':
                for event in source_clouds(reader, job, topics=topics, seen=lambda _: progress.advance(task)):
                    if isinstance(event, SourceCloud):
                        if not counts:
                            with contextlib.suppress(SocialCircleError):
                                filter_cloud(
                                    event.points, job.circle, wanted, job.repair
                                )  # loads what is compiled
                        yield f'{event.topic} {counts[event.topic]}', event
                        counts[event.topic] += 1
                    else:
                        yield event

            for found in in_order(one, named()):
                if isinstance(found, str):
                    refused[found] += 1
                else:
                    measurements.append(found)
        damage = reader.damage
    if not measurements:
        reasons = ' '.join(refused) or damage or 'It holds no message on its topics.'
        raise SocialCircleError(f'{recording} gave no measurement: {reasons}')
    groups = [job.circle, *([job.repair] if job.output.repaired else [])]
    groups += [job.focus, job.stack] if any(topic.endswith(STACK_POINTS) for topic in counts) else []
    save(output, report_page(recording.name, measurements, groups, refused, damage))
    outliers = sum(found.result.outliers for found in measurements)
    points = sum(found.result.measured for found in measurements)
    click.echo(
        f'{quantity(len(measurements), "measurement")}, {outliers} of {points} measured points are outliers'
        f' ({outliers / points:.2%}).'
    )
    warned = sum(bool(found.warnings) for found in measurements)
    if warned:
        click.echo(f'{quantity(warned, "measurement")} with warnings: see the page.', err=True)
    tell_refusals(refused, damage)
    click.echo(f'Next: open {output}')
