# SPDX-License-Identifier: Apache-2.0
"""The recorder: its warning before the disk is full, and what it keeps after an error."""

import contextlib
import itertools
import re
import signal
import time
from collections import Counter
from types import SimpleNamespace

import pytest
import rclpy
from click.testing import CliRunner
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import qos_profile_sensor_data
from rclpy.serialization import deserialize_message
from recording.samples import read
from sensor_msgs.msg import Image
from storage.disks import fill, small_disk

from socialcircle_ros.clients import recorder, topic_input
from socialcircle_ros.clients.qos import reliable
from socialcircle_ros.clients.recorder import Recorder, TopicChoice, record_topics
from socialcircle_ros.commands.record import command
from socialcircle_ros.errors import RecordingError
from socialcircle_ros.node.rclpy_internals import TakenMessage
from socialcircle_ros.recording import Message, RecordingWriter, open_recording, ros_topic
from socialcircle_ros.recording.overlap import WriterBehind

RECORDED = Message('/points', b'recorded', 1_700_000_000_000_000_000, 1_700_000_000_000_000_000, 0)


def test_a_disk_with_little_space_is_told_once_and_again_after_it_had_more(tmp_path, monkeypatch):
    monkeypatch.setattr(recorder, '_DISK_PERIOD_S', 0.0)
    told = []
    with small_disk(tmp_path / 'disk', 4 << 20) as disk:
        watch = recorder._DiskWatch(disk, 2_000_000)
        watch.look(told.append)
        assert told == []
        for _ in range(2):
            fill(disk, 1_000_000)
            watch.look(told.append)
            watch.look(told.append)
            (disk / 'ballast').unlink()
            watch.look(told.append)
    assert told == [f'{disk} has only 1 MB of free space; the recording ends when it is full.'] * 2


def test_a_disk_that_cannot_be_looked_at_ends_nothing(tmp_path):
    told = []
    recorder._DiskWatch(tmp_path / 'nowhere', 1).look(told.append)
    assert told == []


def test_a_topic_that_comes_when_the_disk_is_full_ends_the_recording(tmp_path, monkeypatch):
    def subscribe(node):
        if not node._recorded:
            node._begin('/points', 'sensor_msgs/msg/PointCloud2', [])
            node._writer.write(RECORDED)
            fill(disk)
        for number in range(1000):
            node._begin(f'/topic{number}', 'sensor_msgs/msg/PointCloud2', [])

    monkeypatch.setattr(Recorder, 'subscribe_to_new_topics', subscribe)
    with small_disk(tmp_path / 'disk', 4 << 20) as disk:
        with pytest.raises(RecordingError, match='the disk is full. It holds 1 message'):
            record_topics(disk / 'night.mcap')
        messages, damage = read(disk / 'night.mcap')
        assert [message.data for message in messages] == [b'recorded']
        assert damage is None


def test_a_least_of_zero_never_warns(tmp_path, monkeypatch):
    monkeypatch.setattr(recorder, 'free_bytes', lambda folder: -1)
    told = {0: [], 1: []}
    for least, sentences in told.items():
        recorder._DiskWatch(tmp_path, least).look(sentences.append)
    assert [len(sentences) for sentences in told.values()] == [0, 1]


def test_messages_that_did_not_arrive_are_counted_and_told(tmp_path, monkeypatch):
    waiting = [TakenMessage(memoryview(b'a cloud'), b'source', number, 5) for number in (3, 4, 7)]

    def listen(*_, **options):
        options['event_callbacks'].message_lost(SimpleNamespace(total_count=1, total_count_change=1))
        return SimpleNamespace(subscription=None)

    topics = [('/points', [])]
    publisher = SimpleNamespace(topic_type='sensor_msgs/msg/PointCloud2', qos_profile=reliable())
    monkeypatch.setattr(topic_input, 'listen', listen)
    monkeypatch.setattr(topic_input, 'take', lambda subscription: waiting.pop(0) if waiting else None)
    monkeypatch.setattr(recorder, 'recorded_text', lambda publishers: '')
    monkeypatch.setattr(Recorder, 'get_topic_names_and_types', lambda node: topics)
    monkeypatch.setattr(Recorder, 'get_publishers_info_by_topic', lambda node, name: [publisher])
    done = CliRunner().invoke(command, ['-o', str(tmp_path / 'a.mcap'), '--duration', '0'])
    assert done.exit_code == 0, done.output
    assert '/points: 3, 3 lost on the way\n' in done.output
    assert '3 messages did not arrive. Give the publisher a larger depth' in done.output
    messages, damage = read(tmp_path / 'a.mcap')
    assert [(message.data, message.publish_time) for message in messages] == [(b'a cloud', 5)] * 3
    assert damage is None


def test_a_duration_below_zero_is_refused_before_anything_is_written(tmp_path):
    done = CliRunner().invoke(command, ['-o', str(tmp_path / 'a.mcap'), '--duration', '-1'])
    assert done.exit_code == 2
    assert '-1.0 is not in the range x>=0' in done.output
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def peer():
    """Makes nodes beside the recorder, each of which may give a topic a type of its own."""
    nodes = []

    def make():
        context = Context()
        rclpy.init(context=context)
        nodes.append(rclpy.create_node('peer', context=context))
        return nodes[-1]

    yield make
    for node in nodes:
        node.destroy_node()
        node.context.shutdown()


def test_messages_that_wait_when_the_recording_ends_are_recorded(peer, tmp_path):
    source = peer()
    publishers = [source.create_publisher(Image, name, reliable(50)) for name in ('/a', '/b')]
    numbers = iter(range(1, 1000))
    ended = False

    def publish_and_end(_, topics):
        nonlocal ended
        if ended:
            return
        for _ in range(1 if topics < 2 else 20):
            for publisher in publishers:
                publisher.publish(Image(height=next(numbers)))
        if topics == 2:
            assert all(publisher.wait_for_all_acked(Duration(seconds=20)) for publisher in publishers)
            ended = True
            signal.raise_signal(signal.SIGINT)

    recorded = record_topics(tmp_path / 'a.mcap', TopicChoice(['/a', '/b']), progress=publish_and_end)
    messages, damage = read(tmp_path / 'a.mcap')
    heights = [deserialize_message(message.data, Image).height for message in messages]
    last = next(numbers) - 1
    assert sorted(heights)[-40:] == list(range(last - 39, last + 1))
    assert len(messages) == recorded.counts.total()
    assert (recorded.lost.total(), damage) == (0, None)


@contextlib.contextmanager
def started(path, topics):
    """A recorder that writes to a path; and what makes it look and receive until a condition holds."""
    context = Context()
    rclpy.init(context=context)
    executor = SingleThreadedExecutor(context=context)
    with RecordingWriter(path) as writer, WriterBehind(writer, bundle=1) as behind:
        recorder = Recorder(behind, TopicChoice(topics), context=context)
        executor.add_node(recorder)

        def spin_until(condition):
            end = time.monotonic() + 120
            while time.monotonic() < end:
                if condition():
                    return
                executor.spin_once(timeout_sec=0.05)
            raise AssertionError('the condition did not hold')

        try:
            yield recorder, spin_until
        finally:
            recorder.destroy_node()
            context.shutdown()


def test_a_topic_is_recorded_with_the_type_of_its_publishers_whatever_its_subscribers_want(peer, tmp_path):
    peer().create_subscription(DiagnosticArray, '/typed', print, 10)
    with started(tmp_path / 'a.mcap', ['/typed']) as (recorder, spin_until):
        wrong = ['diagnostic_msgs/msg/DiagnosticArray']
        spin_until(lambda: ('/typed', wrong) in recorder.get_topic_names_and_types())
        publisher = peer().create_publisher(Image, '/typed', reliable(50))
        spin_until(publisher.get_subscription_count)
        assert recorder.left_out == {}
    with open_recording(tmp_path / 'a.mcap') as reader:
        assert reader.topics['/typed'].type == 'sensor_msgs/msg/Image'


def test_publishers_of_a_second_type_are_told(peer, tmp_path):
    publisher = peer().create_publisher(Image, '/twice', reliable(50))
    with started(tmp_path / 'a.mcap', ['/twice']) as (recorder, spin_until):
        spin_until(publisher.get_subscription_count)
        peer().create_publisher(DiagnosticArray, '/twice', reliable(50))
        spin_until(lambda: recorder.left_out)
    assert list(recorder.left_out.values()) == [
        '/twice is not recorded as diagnostic_msgs/msg/DiagnosticArray: it is recorded as sensor_msgs/msg/Image.'
    ]


def test_a_publisher_that_starts_again_as_best_effort_is_recorded_and_each_message_once(peer, tmp_path):
    heights = itertools.count()
    lost = Counter()

    def publish(publisher):
        for _ in range(5):
            publisher.publish(Image(height=next(heights)))

    with started(tmp_path / 'a.mcap', ['/again']) as (recorder, spin_until):
        received = Counter()
        recorder._received, recorder._lost = (
            lambda name: received.update([name]),
            lambda name, n: lost.update({name: n}),
        )
        first, second = peer(), peer()
        publisher = first.create_publisher(Image, '/again', reliable(50))
        spin_until(publisher.get_subscription_count)
        publish(publisher)
        spin_until(lambda: received['/again'] == 5)
        first.destroy_publisher(publisher)
        sensor = second.create_publisher(Image, '/again', qos_profile_sensor_data)
        spin_until(sensor.get_subscription_count)
        publish(sensor)
        spin_until(lambda: received['/again'] == 10)
        # Both subscriptions hear a reliable publisher.
        publisher = first.create_publisher(Image, '/again', reliable(50))
        spin_until(lambda: publisher.get_subscription_count() == 2)
        publish(publisher)
        spin_until(lambda: received['/again'] == 15)
        recorder.take_waiting()
    messages, damage = read(tmp_path / 'a.mcap')
    assert [deserialize_message(message.data, Image).height for message in messages] == list(range(15))
    assert (lost, damage) == (Counter(), None)


@pytest.mark.parametrize('name', ['night.mcap', 'night'])
def test_an_error_keeps_what_was_recorded_and_is_one_sentence(tmp_path, name, monkeypatch):
    def record(node):
        node._writer.add_topic(ros_topic('/points', 'sensor_msgs/msg/PointCloud2'))
        node._writer.write(RECORDED)
        raise ZeroDivisionError('a fault')

    monkeypatch.setattr(Recorder, 'subscribe_to_new_topics', record)
    told = r'has ended early \(ZeroDivisionError: a fault\)\. It holds 1 message, the last of 2023'
    with pytest.raises(RecordingError, match=told):
        record_topics(tmp_path / name)
    messages, damage = read(tmp_path / name)
    assert [message.data for message in messages] == [b'recorded']
    assert damage is None


def test_an_error_before_the_first_message_leaves_nothing(tmp_path, monkeypatch):
    def fail(_):
        raise ZeroDivisionError('a fault')

    monkeypatch.setattr(Recorder, 'subscribe_to_new_topics', fail)
    with pytest.raises(RecordingError, match='It holds no message'):
        record_topics(tmp_path / 'night.mcap')
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ('choice', 'recorded'),
    [
        (TopicChoice(), {'/cell1/points', '/cell1/outlier_mask', '/clock'}),
        (TopicChoice(['points']), {'/cell1/points'}),
        (TopicChoice(['/clock'], pattern=re.compile('mask')), {'/cell1/outlier_mask', '/clock'}),
        (TopicChoice(pattern=re.compile('^/cell')), {'/cell1/points', '/cell1/outlier_mask'}),
        (TopicChoice(every=True, excluded=re.compile('points$')), {'/cell1/outlier_mask', '/clock'}),
        (TopicChoice(['points'], every=True), {'/cell1/points', '/cell1/outlier_mask', '/clock'}),
        (TopicChoice(['points'], excluded=re.compile('points')), set()),
    ],
)
def test_topics_are_chosen_as_ros2_bag_record_chooses_them(choice, recorded):
    names = ['/cell1/points', '/cell1/outlier_mask', '/clock', '/move/_action/status']
    resolve = {'points': '/cell1/points'}
    assert {name for name in names if choice.holds(name, lambda name: resolve.get(name, name))} == recorded
