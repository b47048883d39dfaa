# SPDX-License-Identifier: Apache-2.0
"""Focus stacks through the live node."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from examples import cloud
from live import PATIENCE
from sensor_msgs.msg import Image, JointState, PointCloud2

from socialcircle_ros.clients.player import Player
from socialcircle_ros.messages import image, point_cloud
from socialcircle_ros.messages.header import Header
from socialcircle_ros.messages.image import Image as Frame
from socialcircle_ros.messages.image import encode_image
from socialcircle_ros.messages.point_cloud import PointCloud
from socialcircle_ros.recording import Message, open_recording, ros_topic
from socialcircle_ros.recording.offline import filter_recording
from socialcircle_ros.recording.topics import offered_qos
from socialcircle_ros.settings import FocusSettings, PipelineSettings, StackSettings

pytestmark = pytest.mark.live

BAG = Path(__file__).resolve().parents[2] / 'bags' / 'stack.mcap'
REASONS = (
    'no_peak',
    'scan_end',
    'saturated',
    'two_peaks',
    'low_contrast',
    'incomplete',
    'few_pixels',
    'out_of_picture',
)
INPUTS = ('/stack/image', '/stack/joint_states')


class Microscope:
    """Publishes frames and joint states, and hears what the node makes of them."""

    def __init__(self, cell):
        self.cell = cell
        self.outputs = {}
        self.publishers = {
            name: cell.peer.create_publisher(kind, name, 100)
            for name, kind in (('stack/image', Image), ('stack/joint_states', JointState))
        }
        for name, kind in (
            ('stack/points', PointCloud2), ('stack/image_in_focus', Image), ('stack/preview', PointCloud2),
        ):  # fmt: skip
            cell.peer.create_subscription(kind, name, self.keep(name), 10, raw=True)
        cell.wait_for(lambda: all(p.get_subscription_count() == 1 for p in self.publishers.values()))
        cell.wait_for(lambda: cell.peer.count_publishers('stack/points') == 1)

    def keep(self, name):
        def keep(message):
            with self.cell.changed:
                self.outputs.setdefault(name, []).append(message)
                self.cell.changed.notify_all()

        return keep

    def output(self, name):
        return self.cell.wait_for(lambda: self.outputs.get(name))[-1]

    def scan(self, count=9, shape=(40, 50), seed=0, begin=1):
        """Frames of a textured plane, sharpest in the middle."""
        texture = np.random.default_rng(seed).integers(0, 200, shape)
        for number in range(count):
            share = np.exp(-(((number - (count - 1) / 2) / 2) ** 2))
            header = Header.at((begin + number) * 20_000_000, 'camera')
            self.publishers['stack/image'].publish(encode_image(header, (texture * share).astype(np.uint8)))


@pytest.fixture
def microscope(start_cell):
    def start(**parameters):
        given = {'stack.pitch_x': '1.0e-6', 'stack.z_step': '1.0e-6', 'stack.timeout': '0.0'} | parameters
        return Microscope(start_cell(given))

    return start


def test_the_shipped_stack_becomes_the_cloud_that_the_offline_filter_makes(start_cell, tmp_path):
    parameters = BAG.with_suffix('.yaml')
    scope = Microscope(start_cell(arguments=('--params-file', str(parameters))))
    with open_recording(BAG) as reader:
        topics = [reader.topics[name] for name in INPUTS]
        player = Player(topics, lambda name: scope.cell.namespace + name, context=scope.cell.context)
        assert player.wait_for_listeners(INPUTS, PATIENCE) == []
        player.play(reader.messages(INPUTS))
    filtered, mask, _ = scope.cell.answer()
    values = yaml.safe_load(parameters.read_text())['/**']['ros__parameters']
    job = PipelineSettings(stack=StackSettings.from_ros(values), focus=FocusSettings.from_ros(values))
    filter_recording(BAG, tmp_path / 'offline.mcap', job)
    with open_recording(tmp_path / 'offline.mcap') as reader:
        offline = {message.topic: message.data for message in reader.messages() if message.topic not in INPUTS}
    assert scope.output('stack/points') == offline['/stack/points']
    assert scope.output('stack/image_in_focus') == offline['/stack/image_in_focus']
    np.testing.assert_array_equal(filtered.xyz(), PointCloud.decode(offline['/points_filtered']).xyz())
    assert mask.shape == (160, 200)
    truth = PointCloud.decode(offline['/truth/surface']).xyz()
    error = np.abs(PointCloud.decode(offline['/stack/points']).xyz()[..., 2] - truth[..., 2])
    assert np.nanmedian(error) < 0.3e-6


def test_a_stack_ends_at_the_given_number_of_frames(microscope):
    scope = microscope(**{'stack.frames': '9'})
    scope.scan()
    points = PointCloud.decode(scope.output('stack/points'))
    assert points.header.frame_id == 'camera'
    assert Frame.decode(scope.output('stack/image_in_focus')).pixels().shape == (40, 50)
    found = scope.cell.diagnosis(lambda found: found.values['stacks_finished'] == '1')
    assert found.values['frames_received'] == '9'
    assert float(found.values['stack_latency_ms']) > 0
    assert 0 <= float(found.values['stack_flicker']) < 1
    assert found.values['stack_focus_step'] == '2'


def test_diagnostics_count_the_bad_pixels_of_the_last_stack_by_reason(microscope):
    scope = microscope(**{'stack.frames': '9'})
    scope.scan()
    found = scope.cell.diagnosis(lambda found: 'stack_pixels_no_peak' in found.values)
    depths = PointCloud.decode(scope.output('stack/points')).xyz()[..., 2]
    counts = {name: int(found.values[f'stack_pixels_{name}']) for name in REASONS}
    missing = np.count_nonzero(np.isnan(depths))
    assert max(counts['no_peak'], counts['scan_end']) <= missing <= counts['no_peak'] + counts['scan_end']
    scope.cell.trigger('reset')
    scope.cell.forget()
    scope.cell.diagnosis(lambda found: 'stack_pixels_no_peak' not in found.values)


def test_a_stack_ends_on_request(microscope):
    scope = microscope()
    nothing = scope.cell.trigger('finish_stack')
    assert (nothing.success, nothing.message) == (False, 'No stack is running.')
    scope.scan()
    scope.cell.diagnosis(lambda found: found.values['frames_received'] == '9')
    done = scope.cell.trigger('finish_stack')
    assert (done.success, done.message) == (True, 'A cloud was made of 9 frames.')
    assert scope.output('stack/points')


def test_a_stack_ends_after_silence(microscope):
    scope = microscope(**{'stack.timeout': '1.0'})
    scope.scan()
    assert scope.output('stack/points')


def test_a_stack_ends_after_silence_though_the_stage_goes_on_reporting(microscope):
    scope = microscope(**{'stack.timeout': '1.0', 'stack.z_source': 'joint_states'})
    stage = JointState(name=['z'], position=[0.0])
    scope.publishers['stack/joint_states'].publish(stage)
    scope.scan()
    stage.header.stamp.nanosec = 200_000_000
    stage.position = [5e-5]

    def report():
        scope.publishers['stack/joint_states'].publish(stage)
        return scope.outputs.get('stack/points')

    assert scope.cell.wait_for(report)


def test_a_preview_is_published_when_asked_for(microscope):
    scope = microscope(**{'stack.preview': '4'})
    scope.scan()
    assert scope.output('stack/preview')


def test_a_stack_that_breaks_off_is_told_and_the_next_works(microscope):
    scope = microscope(**{'stack.frames': '9'})
    scope.scan(4, shape=(30, 30))
    scope.scan(1, begin=4)
    scope.scan(9, begin=20)
    found = scope.cell.diagnosis(lambda found: found.values['stack_refusals'] == '1')
    assert 'A stack of 4 frames broke off' in found.values['last_reason']
    assert PointCloud.decode(scope.output('stack/points')).height == 40


def test_what_must_be_set_is_told(start_cell):
    scope = Microscope(start_cell())
    scope.scan(1)
    found = scope.cell.diagnosis(lambda found: found.values['stack_refusals'] == '1')
    assert 'stack.pitch_x is not set' in found.status.message
    assert found.status.level == b'\2'
    _, _, measurement = scope.cell.clean(cloud())
    assert measurement.values['outliers'] == '26'


def test_reset_forgets_the_stack_that_runs(microscope):
    scope = microscope()
    scope.scan(5)
    scope.cell.diagnosis(lambda found: found.values['frames_received'] == '5')
    scope.cell.trigger('reset')
    assert scope.cell.trigger('finish_stack').message == 'No stack is running.'


def test_no_frame_is_lost_at_50_a_second_while_clouds_are_filtered(microscope):
    scope = microscope(**{'stack.frames': '100'})
    texture = np.random.default_rng(0).integers(0, 200, (240, 320))
    messages = []
    for number in range(100):
        time = (number + 1) * 20_000_000
        share = np.exp(-(((number - 50) / 9) ** 2))
        frame = encode_image(Header.at(time, 'camera'), (texture * share).astype(np.uint8))
        messages.append(Message('/stack/image', frame, time, time, number))
        if number % 10 == 0:
            messages.append(Message('/points', cloud(stamp=number), time, time, number))
    topics = [ros_topic('/stack/image', image.TYPE, offered_qos(50)), ros_topic('/points', point_cloud.TYPE)]
    player = Player(topics, lambda name: scope.cell.namespace + name, context=scope.cell.context)
    assert player.wait_for_listeners([topic.name for topic in topics], PATIENCE) == []
    player.play(messages)
    assert scope.output('stack/points')
    found = scope.cell.diagnosis(lambda found: found.values['stacks_finished'] == '1')
    assert found.values['frames_received'] == '100'
    assert found.values['frames_dropped'] == '0'
