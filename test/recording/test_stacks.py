# SPDX-License-Identifier: Apache-2.0
"""Focus stacks from files and from the simulator."""

import numpy as np
import pytest

from socialcircle_ros.errors import ImportFileError
from socialcircle_ros.messages.image import Image
from socialcircle_ros.messages.joint_state import JointState
from socialcircle_ros.messages.point_cloud import PointCloud
from socialcircle_ros.recording import RecordingWriter, open_recording
from socialcircle_ros.recording.simulated import pitch_of, write_simulation
from socialcircle_ros.recording.stacks import import_stack, is_stack
from socialcircle_ros.simulation import simulate

FRAMES = np.random.default_rng(0).integers(0, 255, (4, 5, 6), np.uint8)


def test_an_archive_of_frames_is_a_stack(tmp_path):
    np.savez(tmp_path / 's.npz', frames=FRAMES, z=[1.0, 2.5, 3.0, 4.0])
    assert is_stack(tmp_path / 's.npz')
    stack = import_stack(tmp_path / 's.npz')
    assert stack.z.tolist() == [1.0, 2.5, 3.0, 4.0]
    np.testing.assert_array_equal(list(stack.frames()), FRAMES)


def test_a_folder_of_images_is_a_stack_in_the_order_of_their_names(tmp_path):
    pillow = pytest.importorskip('PIL.Image')
    for number, name in enumerate(['f8.png', 'f9.png', 'f10.png', 'f11.png']):
        pillow.fromarray(FRAMES[number]).save(tmp_path / name)
    (tmp_path / 'notes.txt').write_text('not an image')
    assert is_stack(tmp_path)
    stack = import_stack(tmp_path)
    assert stack.z.tolist() == [0, 1, 2, 3]
    np.testing.assert_array_equal(list(stack.frames()), FRAMES)


def test_16_bit_images_stay_16_bit(tmp_path):
    pillow = pytest.importorskip('PIL.Image')
    deep = FRAMES.astype(np.uint16) * 257
    for number, frame in enumerate(deep):
        pillow.fromarray(frame).save(tmp_path / f'{number}.png')
    np.testing.assert_array_equal(list(import_stack(tmp_path).frames()), deep)


@pytest.mark.parametrize(
    ('arrays', 'sentence'),
    [
        ({'frames': FRAMES[0], 'z': [0.0]}, r'needs an array frames \(N, rows, columns\)'),
        ({'frames': FRAMES.astype(float), 'z': np.arange(4)}, 'uint8 or uint16'),
        ({'frames': FRAMES}, 'needs an array z: one finite number for each of its 4 frames'),
        ({'frames': FRAMES, 'z': np.arange(3)}, 'needs an array z: one finite number'),
        ({'frames': FRAMES, 'z': [0, 1, np.nan, 2]}, 'needs an array z: one finite number'),
    ],
)
def test_an_archive_without_a_stack_is_refused_with_the_reason(tmp_path, arrays, sentence):
    np.savez(tmp_path / 's.npz', **arrays)
    with pytest.raises(ImportFileError, match=sentence):
        import_stack(tmp_path / 's.npz')


def test_a_folder_with_too_few_images_is_refused(tmp_path):
    with pytest.raises(ImportFileError, match='holds 0 images'):
        import_stack(tmp_path)
    (tmp_path / 'a.png').touch()
    with pytest.raises(ImportFileError, match=r'holds 1 image \('):
        import_stack(tmp_path)


def test_an_unreadable_image_is_named(tmp_path):
    pytest.importorskip('PIL.Image')
    for number in range(3):
        (tmp_path / f'{number}.png').write_bytes(b'no image')
    with pytest.raises(ImportFileError, match=r'0\.png is damaged, or no image'):
        list(import_stack(tmp_path).frames())


def test_a_simulation_is_written_with_frames_joint_states_and_truth(tmp_path):
    simulation = simulate('flat', 20, 30, frames=7, seed=3)
    with RecordingWriter(tmp_path / 's.mcap') as writer:
        write_simulation(simulation, writer)
    with open_recording(tmp_path / 's.mcap') as reader:
        messages = list(reader.messages())
    frames = [Image.decode(message.data) for message in messages if message.topic == '/stack/image']
    np.testing.assert_array_equal(
        [frame.pixels() for frame in frames], [frame.image for frame in simulation.frames()]
    )
    joints = [JointState.decode(message.data) for message in messages if message.topic == '/stack/joint_states']
    stamps, z = [state.header.stamp for state in joints], [state.positions[0] for state in joints]
    at_frames = np.interp([frame.header.stamp for frame in frames], stamps, z)
    np.testing.assert_allclose(at_frames, [frame.z * 1e-6 for frame in simulation.frames()], atol=1e-7)
    (surface,) = (message.data for message in messages if message.topic == '/truth/surface')
    xyz = PointCloud.decode(surface).xyz()
    np.testing.assert_allclose(xyz[..., 2], simulation.truth.depth * 1e-6)
    assert xyz[0, 1, 0] == pitch_of(simulation)[0]
