# SPDX-License-Identifier: Apache-2.0
"""New recordings from measurement files and simulations."""

import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from socialcircle_ros.errors import ImportFileError, RecordingError, SettingError, SocialCircleError
from socialcircle_ros.interface import NODE_NAME
from socialcircle_ros.messages.image import Image
from socialcircle_ros.messages.point_cloud import PointCloud
from socialcircle_ros.recording import open_recording
from socialcircle_ros.recording.create import record_clouds, record_simulation, record_stack
from socialcircle_ros.recording.units import unit_of
from socialcircle_ros.settings import PipelineSettings
from socialcircle_ros.settings.files import read_parameter_file
from socialcircle_ros.simulation import simulate

FRAMES = np.random.default_rng(0).integers(0, 255, (4, 5, 6), np.uint8)


def messages_of(path):
    with open_recording(path) as reader:
        return list(reader.messages())


def test_clouds_follow_in_the_order_of_the_files(tmp_path):
    for number, name in enumerate('ab'):
        np.savez(tmp_path / f'{name}.npz', z=np.full((3, 4), float(number)), dx=1.0, dy=1.0)
    seen = []
    record_clouds(
        [tmp_path / 'b.npz', str(tmp_path / 'a.npz')],
        tmp_path / 'parts.mcap',
        topic='/cell/points',
        period_s=0.5,
        written=lambda path, cloud, origin: seen.append((path.name, cloud.unit, origin.unit)),
    )
    messages = messages_of(tmp_path / 'parts.mcap')
    assert [(message.topic, message.log_time) for message in messages] == [
        ('/cell/points', 500_000_000), ('/cell/points', 1_000_000_000),
    ]  # fmt: skip
    assert [PointCloud.decode(message.data).xyz()[0, 0, 2] for message in messages] == [1e-6, 0.0]
    assert PointCloud.decode(messages[0].data).header.frame_id == 'microscope'
    assert seen == [('b.npz', 'm', 'um'), ('a.npz', 'm', 'um')]


@pytest.mark.parametrize('kind', [str, Path])
def test_a_single_file_is_a_list_of_one(tmp_path, kind):
    np.savez(tmp_path / 'a.npz', z=np.zeros((2, 2)), dx=1.0, dy=1.0)
    record_clouds(kind(tmp_path / 'a.npz'), tmp_path / 'a.mcap')
    assert len(messages_of(tmp_path / 'a.mcap')) == 1


def test_no_file_makes_no_recording(tmp_path):
    with pytest.raises(ImportFileError, match=r'a\.mcap would be empty: give at least one measurement file'):
        record_clouds([], tmp_path / 'new' / 'a.mcap')
    assert not list(tmp_path.iterdir())


@settings(max_examples=20)
@given(period_us=st.integers(1, 10**7))
def test_the_stamps_are_multiples_of_the_period_to_the_nanosecond(period_us):
    with tempfile.TemporaryDirectory() as folder:
        cloud, stack = Path(folder) / 'a.npz', Path(folder) / 's.npz'
        np.savez(cloud, z=np.zeros((2, 2)), dx=1.0, dy=1.0)
        np.savez(stack, frames=FRAMES, z=np.arange(4))
        record_clouds([cloud] * 4, Path(folder) / 'a.mcap', period_s=period_us / 1e6)
        record_stack(stack, Path(folder) / 's.mcap', pitch=1e-6, z_step=1e-6, period_s=period_us / 1e6)
        clouds = [each.log_time for each in messages_of(Path(folder) / 'a.mcap')]
        frames = sorted({each.log_time for each in messages_of(Path(folder) / 's.mcap')})
    assert clouds == [number * period_us * 1000 for number in range(1, 5)]
    assert frames == [number * period_us * 20 for number in range(1, 5)]  # 50 frames in a period


@pytest.mark.parametrize(
    'period_s', [0, -1.0, float('nan'), float('inf'), 1e12, 2.0**31, pytest.param(10**400, id='digits')]
)
def test_a_period_whose_stamps_ros_does_not_hold_is_refused(tmp_path, period_s):
    np.savez(tmp_path / 's.npz', frames=FRAMES, z=np.arange(4))
    with pytest.raises(SettingError, match='must be above 0 s, and the last stamp below 2³¹ s'):
        record_clouds(['a.npz'], tmp_path / 'x.mcap', period_s=period_s)
    with pytest.raises(SettingError, match='must be above 0 s, and the last stamp below 2³¹ s'):
        record_stack(tmp_path / 's.npz', tmp_path / 'x.mcap', pitch=1e-6, z_step=1e-6, period_s=period_s * 50)
    assert [path.name for path in tmp_path.iterdir()] == ['s.npz']


@pytest.mark.parametrize('period_s', ['1', None, True])
def test_a_period_that_is_no_number_is_refused(tmp_path, period_s):
    with pytest.raises(SettingError, match=f'the period cannot be {period_s!r}\\.'):
        record_clouds(['a.npz'], tmp_path / 'x.mcap', period_s=period_s)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    'topic', [5, None, '/a//b', 'a b', 'points', '/points/', '//points', '/1/points', '/größe', '', '/']
)
def test_a_topic_that_ros_does_not_allow_is_refused(tmp_path, topic):
    with pytest.raises(SettingError, match='is not the name of a topic: .* no part of it is empty'):
        record_clouds(['a.npz'], tmp_path / 'x.mcap', topic=topic)
    assert not list(tmp_path.iterdir())


def test_a_stack_is_recorded_with_the_parameters_that_measure_it(tmp_path):
    np.savez(tmp_path / 's.npz', frames=FRAMES, z=np.arange(4))
    written = record_stack(tmp_path / 's.npz', tmp_path / 's.mcap', pitch=2e-6, z_step=1e-5)
    assert written == (4, tmp_path / 's.yaml', (2e-6, 2e-6))
    frames = [message for message in messages_of(tmp_path / 's.mcap') if message.topic == '/stack/image']
    assert [message.log_time for message in frames] == [20_000_000, 40_000_000, 60_000_000, 80_000_000]
    np.testing.assert_array_equal([Image.decode(message.data).pixels() for message in frames], FRAMES)
    settings = PipelineSettings.from_ros(read_parameter_file(written.parameters, NODE_NAME))
    assert (settings.stack.pitch_x, settings.stack.frames, settings.stack.z_source) == (2e-6, 4, 'joint_states')


@pytest.mark.parametrize('lengths', [{'pitch': None, 'z_step': 1e-6}, {'pitch': 1e-6, 'z_step': 0.0}])
def test_a_stack_without_its_pitch_or_step_is_refused(tmp_path, lengths):
    np.savez(tmp_path / 's.npz', frames=FRAMES, z=np.arange(4))
    with pytest.raises(ImportFileError, match=r'give (--pitch|--z-step) in metres'):
        record_stack(tmp_path / 's.npz', tmp_path / 's.mcap', **lengths)
    assert not (tmp_path / 's.mcap').exists()


def test_frames_of_different_shapes_are_refused(tmp_path):
    pillow = pytest.importorskip('PIL.Image')
    (tmp_path / 'frames').mkdir()
    for number, frame in enumerate((FRAMES[0], FRAMES[1], FRAMES[2, :4])):
        pillow.fromarray(frame).save(tmp_path / 'frames' / f'{number}.png')
    with pytest.raises(
        ImportFileError,
        match=r'2\.png is 4 rows × 6 columns gray, 8 bits, but 0\.png is 5 rows × 6 columns gray, 8 bits',
    ):
        record_stack(tmp_path / 'frames', tmp_path / 's.mcap', pitch=1e-6, z_step=1e-6)


def test_a_simulation_is_recorded_with_its_parameters(tmp_path):
    simulation, seen = simulate('flat', 20, 30, frames=5, seed=3), []
    written = record_simulation(
        simulation, tmp_path / 's.mcap', progress=lambda done, total: seen.append((done, total))
    )
    assert written == (5, tmp_path / 's.yaml', (1e-6, 1e-6))
    assert seen == [(number, 5) for number in range(1, 6)]
    topics = {message.topic for message in messages_of(tmp_path / 's.mcap')}
    assert topics == {'/stack/image', '/stack/joint_states', '/truth/surface', '/truth/description'}
    with open_recording(tmp_path / 's.mcap') as reader:
        assert unit_of(reader, '/truth/surface') == 'm'


def test_a_parameter_file_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / 's.yaml').mkdir()
    told = r's\.yaml, where the parameters of the stack in s\.mcap are written, exists already: give another name'
    with pytest.raises(SocialCircleError, match=told):
        record_simulation(simulate('flat', 20, 30, frames=3), tmp_path / 's.mcap')
    with pytest.raises(SocialCircleError, match=r's\.db3 cannot be a recording'):  # told before its parameters
        record_simulation(simulate('flat', 20, 30, frames=3), tmp_path / 's.db3')


def test_a_missing_folder_is_created_and_stays_only_with_a_recording(tmp_path):
    np.savez(tmp_path / 'a.npz', z=np.zeros((3, 4)), dx=1.0, dy=1.0)
    np.savez(tmp_path / 's.npz', frames=FRAMES, z=np.arange(4))
    with pytest.raises(ImportFileError):
        record_clouds([tmp_path / 'none.npz'], tmp_path / 'bad/1/a.mcap')
    with pytest.raises(RecordingError):
        record_stack(tmp_path / 's.npz', tmp_path / 'bad/2/s.png', pitch=1e-6, z_step=1e-6)
    assert not (tmp_path / 'bad').exists()
    record_clouds([tmp_path / 'a.npz'], tmp_path / 'good/1/a.mcap')
    record_stack(tmp_path / 's.npz', tmp_path / 'good/2/s.mcap', pitch=1e-6, z_step=1e-6)
    record_simulation(simulate('flat', 20, 30, frames=3), tmp_path / 'good/3/s.mcap')
    names = [str(path.relative_to(tmp_path)) for path in sorted(tmp_path.rglob('good/*/*'))]
    assert names == ['good/1/a.mcap', 'good/2/s.mcap', 'good/2/s.yaml', 'good/3/s.mcap', 'good/3/s.yaml']
