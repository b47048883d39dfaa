"""`socialcircle demo`."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .options import require_ros

if TYPE_CHECKING:
    from rich.table import Table

    from socialcircle_ros.node.process import Answer, Client
    from socialcircle_ros.recording import Message

NAMESPACE = '/socialcircle_demo'
TRUTH = 'truth/outlier_mask'
SHIPPED = ('metal_groove.mcap', 'parts.mcap', 'padded.mcap')


@click.command('demo', epilog='Example: socialcircle demo measurement.npz')
@click.argument('files', nargs=-1, type=click.Path(path_type=Path))
@click.option(
    '-o', '--output', type=click.Path(path_type=Path), default=Path('out/demo'), show_default=True,
    help='Directory of the results.',
)  # fmt: skip
def command(files: tuple[Path, ...], output: Path) -> None:
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

    from socialcircle_ros.errors import SocialCircleError
    from socialcircle_ros.node.process import Client, NodeProcess

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
    with NodeProcess(NAMESPACE, output / 'node.log') as process, Client(NAMESPACE) as client:
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
    """The recordings of the package: in a checkout, or installed under share/.

    Raises:
        SocialCircleError: they are not there.
    """
    import os
    import sys

    from socialcircle_ros.errors import SocialCircleError

    prefixes = [*os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep), sys.prefix]
    folders = [Path(__file__).resolve().parents[2] / 'bags']
    folders += [Path(prefix) / 'share/socialcircle_ros/bags' for prefix in prefixes if prefix]
    for folder in folders:
        if all((folder / name).is_file() for name in SHIPPED):
            return [folder / name for name in SHIPPED]
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
    """Play one recording cloud by cloud; the files that were written."""
    from socialcircle_ros.errors import SocialCircleError
    from socialcircle_ros.messages import diagnostics, image, point_cloud
    from socialcircle_ros.node.process import stamp_of
    from socialcircle_ros.recording import RecordingWriter, open_recording, ros_topic
    from socialcircle_ros.recording.offline import FILTERED, MASK, MEASUREMENT, clouds_of

    cleaned = output / f'{recording.stem}_cleaned.mcap'
    picture: list[Path] = []
    with open_recording(recording) as reader:
        (topic, *_) = clouds_of(reader)
        namespace = topic.rpartition('/')[0]
        truths = {stamp_of(message.data): message.data for message in reader.messages([f'{namespace}/{TRUTH}'])}
        results = {FILTERED: point_cloud.TYPE, MASK: image.TYPE, MEASUREMENT: diagnostics.TYPE}
        with RecordingWriter(cleaned, compression='zstd', overwrite=True, source=recording) as writer:
            writer.add_topic(reader.topics[topic])
            for name, kind in results.items():
                writer.add_topic(ros_topic(f'{namespace}/{name}', kind))
            for number, message in enumerate(reader.messages([topic])):
                writer.write(*message)
                try:
                    answer = client.clean(message.data)
                except SocialCircleError as refusal:
                    table.add_row(f'{recording.stem} {number}', f'refused: {refusal}')
                    continue
                for name, data in zip(
                    results, (answer.filtered, answer.mask, answer.measurement.encode()), strict=True
                ):
                    writer.write(f'{namespace}/{name}', data, message.log_time, message.publish_time)
                table.add_row(*_row(f'{recording.stem} {number}', message, answer, truths))
                if not picture:
                    picture = _draw(output / f'{recording.stem}.png', recording.stem, message, answer)
        if reader.damage:
            click.echo(f'Warning: {reader.damage}', err=True)
    return [cleaned, *picture]


def _table() -> 'Table':
    from rich.table import Table

    table = Table(title='Clouds through the live node', box=None, padding=(0, 1, 0, 0))
    table.add_column('cloud')
    for name in (
        'points',
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
        ' publishing it to receiving the filtered one; all in ms'
    )
    return table


def _row(name: str, message: 'Message', answer: 'Answer', truths: dict[int, bytes]) -> list[str]:
    """One line of the table; precision and recall where the recording knows the truth."""
    from socialcircle_ros.evaluation.scores import score
    from socialcircle_ros.messages.image import NOT_MEASURED, OUTLIER, decode_mono8
    from socialcircle_ros.node.process import stamp_of

    values: dict[str, Any] = dict(answer.measurement.values)
    known = ['', '']
    truth = truths.get(stamp_of(message.data))
    if truth is not None:
        true = decode_mono8(truth)
        scores = score(decode_mono8(answer.mask) == OUTLIER, true == OUTLIER, true != NOT_MEASURED)
        known = [f'{scores.precision:.3f}', f'{scores.recall:.3f}']
    return [
        name,
        values['points'],
        values['outliers'],
        f'{values["seed_row"]},{values["seed_column"]}',
        f'{float(values["radius"]):.3g}',
        *(f'{float(values[f"time_{stage}_ms"]):.1f}' for stage in ('vote', 'radius', 'expansion', 'total')),
        f'{1e3 * answer.latency:.1f}',
        *known,
    ]


def _draw(path: Path, name: str, message: 'Message', answer: 'Answer') -> list[Path]:
    """The picture of one cloud, before and after."""
    from socialcircle_ros.evaluation.pictures import before_and_after
    from socialcircle_ros.messages.image import OUTLIER, decode_mono8
    from socialcircle_ros.messages.point_cloud import PointCloud

    cloud = PointCloud.decode(message.data)
    before_and_after(
        path, cloud.xyz(), decode_mono8(answer.mask) == OUTLIER, f'{name}: {answer.measurement.message}'
    )
    return [path]
