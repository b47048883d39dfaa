# SPDX-License-Identifier: Apache-2.0
"""The demo: the node in its own process, and recordings that are played into it over DDS."""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from socialcircle_ros import interface
from socialcircle_ros.arguments import OneOrSeveral, several
from socialcircle_ros.cloud import measured_only
from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.interface import STAGE_TIME, MeasurementValues
from socialcircle_ros.messages import diagnostics
from socialcircle_ros.messages.image import NOT_MEASURED, OUTLIER, decode_mono8
from socialcircle_ros.messages.point_cloud import PointCloud
from socialcircle_ros.metrics.scores import Scores, score
from socialcircle_ros.pictures.drawings import before_and_after
from socialcircle_ros.recording import RecordingReader, RecordingWriter, open_recording, ros_topic
from socialcircle_ros.recording.offline import clouds_of, stacks_of
from socialcircle_ros.recording.truth import RecordedTruth, truths_of
from socialcircle_ros.recording.units import unit_of

from .cloud_client import Client, Response
from .process import NodeProcess

NAMESPACE = '/socialcircle_demo'
"""Namespace of the demo's node; no cell uses it."""

SHIPPED = ('metal_groove.mcap', 'parts.mcap', 'padded.mcap', 'stack.mcap')
"""Recordings of the package, with known truth."""

_MODE = 'circle.mode'
_OTHER = {'adaptive': 'paper', 'paper': 'adaptive'}
_STACK_PARAMETERS = 'stack.yaml'
_START_TIMEOUT_S = 180.0
_COMPILE_TIMEOUT_S = 120.0  # for the first cloud in another mode, which may compile
_LISTENER_TIMEOUT_S = 30.0


@dataclass(frozen=True)
class DemoCloud:
    """What the node made of one cloud.

    Attributes:
        name: recording and number of the cloud, such as `parts 3`.
        mode: mode of the filter.
        measurement: counts, seed and radius.
        unit: of the cloud; None: not known.
        warning: the sentences of the measurement if it warns; else empty.
        total_ms: time of all work of the node on the cloud.
        latency_ms: time from the publication of the cloud, or of the last frame, to the filtered cloud.
        scores: scores against the truth; None where it is not known.
    """

    name: str
    mode: str
    measurement: MeasurementValues
    unit: str | None
    warning: str
    total_ms: float
    latency_ms: float
    scores: Scores | None


@dataclass(frozen=True)
class RefusedCloud:
    """A cloud that the node refused, and the reason."""

    name: str
    mode: str
    reason: str


@dataclass
class Demo:
    """What the demo did.

    Attributes:
        clouds: the filtered and the refused clouds, in their order.
        written: the recordings and pictures that were written.
        damage: one sentence per damaged recording.
    """

    clouds: list[DemoCloud | RefusedCloud] = field(default_factory=list)
    written: list[Path] = field(default_factory=list)
    damage: list[str] = field(default_factory=list)


def run_demo(
    files: OneOrSeveral[str | Path],
    output: Path,
    *,
    params_file: Path | None = None,
    status: Callable[[str], None] = lambda text: None,
) -> Demo:
    """Start the node, play recordings into it, and write and draw the results.

    Args:
        files: recordings or measurement files; empty: the recordings of the package.
        output: an existing folder for the results and the node's log.
        params_file: parameters of the node; None: the defaults, or those of the shipped stack if `files` is empty.
        status: called with a sentence before each step.

    Raises:
        SocialCircleError: a file cannot be read, the node does not start, or matplotlib is not installed.
    """
    given = [Path(each) for each in several(files)]
    recordings = given or shipped_recordings()
    for recording in recordings:  # what cannot be read is told before the node starts
        with open_recording(recording):
            pass
    if params_file is None and not given:
        params_file = _shared_folder('bags') / _STACK_PARAMETERS
    arguments = () if params_file is None else ('--params-file', str(params_file))
    demo = Demo()
    status('Starting the node. The first start compiles the filter, which takes up to half a minute on two cores.')
    with NodeProcess(NAMESPACE, output / 'node.log', arguments=arguments) as process, Client(NAMESPACE) as client:
        client.wait_for_node(process, _START_TIMEOUT_S)
        for recording in recordings:
            status(f'Playing {recording.name} into the node.')
            play_into_node(recording, client, output, demo)
    return demo


def play_into_node(recording: Path, client: Client, output: Path, demo: Demo) -> None:
    """Play one recording into a node, one cloud and one stack at a time.

    The node filters the first cloud, and each stack, in the other mode as well. Writes the filtered recording, and
    a picture of both modes.

    Args:
        recording: an MCAP file, a rosbag2 directory, or a measurement file.
        client: a client of the node.
        output: the folder of the results.
        demo: takes up the results.
    """
    name = Path(recording.name.removesuffix('.zstd').removesuffix('.zst')).stem
    filtered = output / f'{name}_cleaned.mcap'
    with (
        open_recording(recording) as reader,
        RecordingWriter(filtered, compression='zstd', overwrite=True, source=recording) as writer,
    ):
        demo.written.append(filtered)
        session = _Session(name, reader, writer, client, output, demo)
        for topic in clouds_of(reader):
            session.play_clouds(topic)
        for namespace in stacks_of(reader):
            session.play_stack(namespace)
        if reader.damage:
            demo.damage.append(reader.damage)


class _Session:
    """Plays the topics of one recording, and passes the results on."""

    def __init__(
        self,
        name: str,
        reader: RecordingReader,
        writer: RecordingWriter,
        client: Client,
        output: Path,
        demo: Demo,
    ) -> None:
        self._name, self._reader, self._writer = name, reader, writer
        self._client, self._output, self._demo = client, output, demo
        self._truths = truths_of(reader)
        self._drawn = False

    def play_clouds(self, topic: str) -> None:
        self._writer.add_topic(self._reader.topics[topic])
        for number, message in enumerate(self._reader.messages([topic])):
            self._writer.write(*message)
            name = f'{self._name} {number}'
            try:
                response = self._client.clean(message.data)
            except SocialCircleError as error:
                self._demo.clouds.append(RefusedCloud(name, '', str(error)))
                continue
            unit = unit_of(self._reader, topic)
            self._take(name, topic.rpartition('/')[0], message.log_time, message.data, unit, response)

    def play_stack(self, namespace: str) -> None:
        name = f'{self._name} (stack)'
        inputs = (interface.STACK_FRAMES, interface.STACK_JOINT_STATES)
        topics = [topic.within(namespace) for topic in inputs if topic.within(namespace) in self._reader.topics]
        player = self._client.player([self._reader.topics[topic] for topic in topics])
        player.wait_for_listeners(topics, _LISTENER_TIMEOUT_S)
        messages = list(self._reader.messages(topics))
        try:
            response = self._client.measure(player, messages)
        except SocialCircleError as error:
            self._demo.clouds.append(RefusedCloud(name, '', str(error)))
            return
        self._take(name, namespace, messages[-1].log_time, response.stack_points or b'', 'm', response)

    def _take(
        self, name: str, namespace: str, log_time: int, cloud: bytes, unit: str | None, response: Response
    ) -> None:
        """Write and describe what the node published, and draw the first cloud in both modes."""
        for topic, data in _published(response):
            full_name = topic.within(namespace)
            self._writer.add_topic(ros_topic(full_name, topic.type))
            self._writer.write(full_name, data, log_time)
        truth = self._truths(namespace, cloud)
        self._demo.clouds.append(_described(name, unit, truth, response))
        if self._drawn:
            return
        self._drawn = True
        responses = [response]
        mode = response.measurement.values[_MODE]
        try:
            responses.append(self._in_other_mode(mode))
            self._demo.clouds.append(_described(name, unit, truth, responses[-1]))
        except SocialCircleError as error:
            self._demo.clouds.append(RefusedCloud(name, _OTHER[mode], str(error)))
        self._draw(cloud, unit, truth, responses)

    def _in_other_mode(self, mode: str) -> Response:
        """Filter the node's last cloud again in the other mode, as a change of the parameter does."""
        # Twice, because the first change may compile, which its time should not contain.
        for _ in range(2):
            response = self._client.change(_MODE, _OTHER[mode], _COMPILE_TIMEOUT_S)
            self._client.change(_MODE, mode)
        return response

    def _draw(
        self, cloud: bytes, unit: str | None, truth: RecordedTruth | None, responses: Sequence[Response]
    ) -> None:
        masks = {response.measurement.values[_MODE]: decode_mono8(response.mask) for response in responses}
        found = {mode: mask == OUTLIER for mode, mask in masks.items()}
        xyz = measured_only(PointCloud.decode(cloud).xyz(), next(iter(masks.values())) != NOT_MEASURED)
        file = self._output / f'{self._name}.png'
        undecided = None if truth is None else ~truth.counted
        title = f'{self._name}: circle.mode {" and ".join(found)}'
        outliers = next(iter(found.values()))
        before_and_after(file, xyz, outliers, title, unit, found, undecided)
        self._demo.written.append(file)


def _described(name: str, unit: str | None, truth: RecordedTruth | None, response: Response) -> DemoCloud:
    scores = None
    if truth is not None:
        scores = score(decode_mono8(response.mask) == OUTLIER, truth.outlier, truth.counted)
    measurement = response.measurement
    return DemoCloud(
        name=name,
        mode=measurement.values[_MODE],
        measurement=MeasurementValues.from_text(measurement.values),
        unit=unit,
        warning=measurement.message if measurement.level != diagnostics.OK else '',
        total_ms=float(measurement.values[STAGE_TIME.format(stage='total')]),
        latency_ms=response.latency_ms,
        scores=scores,
    )


def _published(response: Response) -> Iterator[tuple[interface.NodeTopic, bytes]]:
    yield interface.FILTERED, response.filtered
    yield interface.MASK, response.mask
    yield interface.MEASUREMENT, response.measurement.encode()
    if response.stack_points is not None:
        yield interface.STACK_POINTS, response.stack_points
    if response.stack_image is not None:
        yield interface.STACK_IMAGE, response.stack_image


def shipped_recordings() -> list[Path]:
    """The recordings of the package.

    Raises:
        SocialCircleError: they are not installed.
    """
    return [_shared_folder('bags') / name for name in SHIPPED]


def _shared_folder(name: str) -> Path:
    """A folder of the package: of the checkout, or of an installation under share/."""
    prefixes = [*os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep), sys.prefix]
    places = [Path(__file__).resolve().parents[2] / name]
    places += [Path(prefix) / 'share/socialcircle_ros' / name for prefix in prefixes if prefix]
    for place in places:
        if (place / SHIPPED[0]).is_file():
            return place
    raise SocialCircleError('The recordings of the package are not installed here; give a recording of your own.')
