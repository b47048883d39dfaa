"""`socialcircle demo`."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .options import require_ros

if TYPE_CHECKING:
    from rich.table import Table

    from socialcircle_ros.clients.cloud_client import Client, Response
    from socialcircle_ros.recording.truth import RecordedTruth

NAMESPACE = '/socialcircle_demo'
SHIPPED = ('metal_groove.mcap', 'parts.mcap', 'padded.mcap', 'stack.mcap')
STACK_PARAMETERS = 'stack.yaml'
_COMPILED = 120.0  # s that a first answer by another mode may take


@click.command('demo', epilog='Example: socialcircle demo measurement.npz')
@click.argument('files', nargs=-1, type=click.Path(path_type=Path))
@click.option(
    '-o', '--output', type=click.Path(path_type=Path), default=Path('out/demo'), show_default=True,
    help='Directory of the results.',
)  # fmt: skip
@click.option(
    '--params-file',
    type=click.Path(path_type=Path),
    help='Parameters of the node, such as those of a focus stack.',
)
def command(files: tuple[Path, ...], output: Path, params_file: Path | None) -> None:
    """See it work: the node as its own process, a recording played into it over DDS, and what it answers.

    FILES are recordings, or measurements as .npz, .ply or .pcd; without any, simulated clouds of known truth
    are cleaned, with precision and recall. Prints one table, and writes the cleaned recording and a picture of
    each file's first cloud. Works in a namespace of its own, so that it disturbs no cell.
    """
    require_ros()
    import os

    # The demo talks to itself only; what listens beyond this machine is the user's choice.
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    from socialcircle_ros.node.transport import prepare_process

    prepare_process()
    from rich.console import Console

    from socialcircle_ros.clients.cloud_client import Client
    from socialcircle_ros.clients.process import NodeProcess
    from socialcircle_ros.errors import SocialCircleError

    console = Console()
    if not console.is_terminal:
        console = Console(width=100)
    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SocialCircleError(f'{output} cannot be made: {error.strerror}; choose another with -o.') from None
    recordings = [_as_recording(path, output) for path in files or _shipped()]
    table = _table()
    written: list[Path] = []
    given = ('--params-file', str(_share('bags') / STACK_PARAMETERS)) if not files else ()
    if params_file is not None:
        given = ('--params-file', str(params_file))
    with NodeProcess(NAMESPACE, output / 'node.log', arguments=given) as process, Client(NAMESPACE) as client:
        with console.status('Starting the node (the very first start compiles the filter: about 20 s) ...'):
            client.wait_for_node(process, 180.0)
        for recording in recordings:
            with console.status(f'Playing {recording.name} into the node ...'):
                written += _run(recording, client, output, table)
    console.print(table)
    console.print('What was written:')
    for path in written:
        console.print(f'  {path}', soft_wrap=True, highlight=False)
    console.print('Next: look at the pictures, then: socialcircle filter --help', highlight=False)


def _shipped() -> list[Path]:
    """The recordings of the package."""
    return [_share('bags') / name for name in SHIPPED]


def _share(folder: str) -> Path:
    """A folder of the package: in a checkout, or installed under share/.

    Raises:
        SocialCircleError: it is not there.
    """
    import os
    import sys

    from socialcircle_ros.errors import SocialCircleError

    prefixes = [*os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep), sys.prefix]
    places = [Path(__file__).resolve().parents[2] / folder]
    places += [Path(prefix) / 'share/socialcircle_ros' / folder for prefix in prefixes if prefix]
    for place in places:
        if (place / SHIPPED[0]).is_file():
            return place
    raise SocialCircleError('The recordings of the package are not installed here; name a recording of your own.')


def _as_recording(path: Path, output: Path) -> Path:
    """A recording as it is; a measurement file imported into one."""
    if path.is_dir() or path.suffix == '.mcap':
        return path
    from socialcircle_ros.messages import point_cloud
    from socialcircle_ros.messages.header import Header
    from socialcircle_ros.recording import RecordingWriter, import_cloud, ros_topic

    cloud = import_cloud(path)
    target = output / f'{path.stem}.mcap'
    with RecordingWriter(target, overwrite=True) as writer:
        writer.add_topic(ros_topic('/points', point_cloud.TYPE))
        frame = f'{path.stem} [{cloud.unit}]' if cloud.unit else path.stem
        message = point_cloud.encode_point_cloud(Header.at(1_000_000_000, frame), cloud.points, cloud.fields)
        writer.write('/points', message, 1_000_000_000)
    return target


def _run(recording: Path, client: 'Client', output: Path, table: 'Table') -> list[Path]:
    """Play one recording, cloud by cloud and stack by stack; the files that were written."""
    from socialcircle_ros.errors import SocialCircleError
    from socialcircle_ros.messages import diagnostics, image, point_cloud
    from socialcircle_ros.recording import RecordingWriter, open_recording, ros_topic
    from socialcircle_ros.recording.offline import (
        FILTERED,
        FRAMES,
        JOINT_STATES,
        MASK,
        MEASUREMENT,
        STACK_IMAGE,
        STACK_POINTS,
        clouds_of,
        stacks_of,
    )
    from socialcircle_ros.recording.truth import truths_of

    kinds = {
        FILTERED: point_cloud.TYPE,
        MASK: image.TYPE,
        MEASUREMENT: diagnostics.TYPE,
        STACK_POINTS: point_cloud.TYPE,
        STACK_IMAGE: image.TYPE,
    }
    cleaned, picture = output / f'{recording.stem}_cleaned.mcap', output / f'{recording.stem}.png'
    drawn: list[Path] = []
    with (
        open_recording(recording) as reader,
        RecordingWriter(cleaned, compression='zstd', overwrite=True, source=recording) as writer,
    ):
        truth = truths_of(reader)

        def keep(name: str, namespace: str, time: int, cloud: bytes | None, answer: 'Response') -> None:
            before = cloud or answer.stack_points or b''
            results = (
                answer.filtered,
                answer.mask,
                answer.measurement.encode(),
                answer.stack_points,
                answer.stack_image,
            )
            for (result, kind), data in zip(kinds.items(), results, strict=True):
                if data is not None:
                    writer.add_topic(ros_topic(f'{namespace}/{result}', kind))
                    writer.write(f'{namespace}/{result}', data, time)
            table.add_row(*_row(name, answer, truth(namespace, before)))
            if not drawn:
                _draw(picture, recording.stem, before, answer)
                drawn.append(picture)

        def refuse(name: str, refusal: SocialCircleError) -> None:
            table.add_row(name, 'refused')
            click.echo(f'{name} was refused: {refusal}', err=True)  # the table has no room for a sentence

        for topic in clouds_of(reader):
            writer.add_topic(reader.topics[topic])
            for number, message in enumerate(reader.messages([topic])):
                writer.write(*message)
                name = f'{recording.stem} {number}'
                try:
                    answer = client.clean(message.data)
                except SocialCircleError as refusal:
                    refuse(name, refusal)
                    continue
                keep(name, topic.rpartition('/')[0], message.log_time, message.data, answer)
        for namespace in stacks_of(reader):
            names = [
                name for name in (f'{namespace}/{FRAMES}', f'{namespace}/{JOINT_STATES}') if name in reader.topics
            ]
            player = client.player([reader.topics[name] for name in names])
            player.wait_for_listeners(names, 30.0)
            messages = list(reader.messages(names))
            try:
                answer = client.measure(player, messages)
            except SocialCircleError as refusal:
                refuse(f'{recording.stem} (stack)', refusal)
                continue
            keep(f'{recording.stem} (stack)', namespace, messages[-1].log_time, None, answer)
            if answer.measurement.values['circle.mode'] == 'paper':
                # The last cloud stays in the node, and is filtered again when a parameter changes.
                # Twice, because a very first start compiles the adaptive mode only now, which is not its time.
                try:
                    for _ in range(2):
                        again = client.change('circle.mode', 'adaptive', _COMPILED)
                        client.change('circle.mode', 'paper')
                except SocialCircleError as refusal:
                    refuse('… adaptive', refusal)
                    continue
                points = answer.stack_points or b''
                table.add_row(*_row('… adaptive', again, truth(namespace, points)))
                drawn.append(output / f'{recording.stem}_adaptive.png')
                _draw(drawn[-1], f'{recording.stem}, adaptive', points, again)
        if reader.damage:
            click.echo(f'Warning: {reader.damage}', err=True)
    return [cleaned, *drawn]


def _table() -> 'Table':
    from rich.table import Table

    table = Table(title='Clouds through the live node', box=None, padding=(0, 1, 0, 0))
    table.add_column('cloud')
    for name in (
        'points',
        'measured',
        'outliers',
        'seed',
        'radius',
        'vote',
        'radius',
        'grow',
        'total',
        'trip',
        'prec.',
        'recall',
    ):
        table.add_column(name, justify='right')
    table.caption = (
        'vote, radius, grow: the steps of the filter, total: all that the node does with a cloud, trip: from'
        ' publishing it (of a stack: the last frame) to receiving the filtered one; all in ms; … adaptive: the'
        ' same cloud, after circle.mode was changed in the running node'
    )
    return table


def _row(name: str, answer: 'Response', truth: 'RecordedTruth | None') -> list[str]:
    """One line of the table; precision and recall where the recording knows the truth."""
    from socialcircle_ros.messages.image import OUTLIER, decode_mono8
    from socialcircle_ros.metrics.scores import score

    values: dict[str, Any] = dict(answer.measurement.values)
    known = ['', '']
    if truth is not None:
        scores = score(decode_mono8(answer.mask) == OUTLIER, truth.outlier, truth.counted)
        known = [f'{scores.precision:.3f}', f'{scores.recall:.3f}']
    return [
        name,
        values['points'],
        values['measured'],
        values['outliers'],
        f'{values["seed_row"]},{values["seed_column"]}',
        f'{float(values["radius"]):.3g}',
        *(_milliseconds(values.get(f'time_{stage}_ms')) for stage in ('vote', 'radius', 'expansion', 'total')),
        f'{answer.latency_ms:.1f}',
        *known,
    ]


def _milliseconds(text: str | None) -> str:
    """A time; nothing for a step that the mode does not have."""
    return '' if text is None else f'{float(text):.1f}'


def _draw(path: Path, name: str, cloud: bytes, answer: 'Response') -> None:
    """The picture of one cloud, before and after."""
    from socialcircle_ros.messages.image import OUTLIER, decode_mono8
    from socialcircle_ros.messages.point_cloud import PointCloud
    from socialcircle_ros.report.pictures import before_and_after

    xyz = PointCloud.decode(cloud).xyz()
    before_and_after(path, xyz, decode_mono8(answer.mask) == OUTLIER, f'{name}: {answer.measurement.message}')
