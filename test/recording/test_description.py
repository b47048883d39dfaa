# SPDX-License-Identifier: Apache-2.0
"""What `socialcircle info` says."""

import numpy as np
import pytest

from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.formats import MeasuredSurface, write_cloud_file, write_surface
from socialcircle_ros.recording import RecordingWriter, open_recording, ros_topic
from socialcircle_ros.recording.create import record_clouds, record_stack
from socialcircle_ros.recording.description import TopicDescription, describe
from socialcircle_ros.recording.topics import Attachment, MetadataRecord

HEIGHTS = np.array([[1e-6, 2e-6, np.nan], [3e-6, 4e-6, 5e-6]])
CLOUD = 'sensor_msgs/msg/PointCloud2'


def surface(path, **changes):
    write_surface(path, MeasuredSurface(HEIGHTS, (5e-7, 2.5e-7), 'm', **changes))
    return path


def test_a_measurement_file(tmp_path):
    found = describe(surface(tmp_path / 'a.npz', fields={'quality': np.ones((2, 3), np.uint8)}))
    assert (found.kind, found.damage) == ('NumPy archive, height map file', None)
    assert {key: text for key, text in found.facts.items() if key != 'size'} == {
        'points': '2 rows × 3 columns, float64',
        'measured': '5 of 6',
        'unit': 'm',
        'pitch': '500 × 250 nm (x × y)',
        'heights': '1 to 5 µm',
        'fields': 'quality (uint8)',
    }


def test_the_kind_is_that_of_the_file_and_not_of_its_suffix(tmp_path):
    (tmp_path / 'a.txt').write_text('\n'.join(f'{x} {y} {x + y}' for x in range(3) for y in range(4)))
    assert describe(tmp_path / 'a.txt').kind == 'text file with x, y and z per line'
    assert describe(surface(tmp_path / 'a.sdf')).kind == 'ISO 25178-71 file'
    assert describe(surface(tmp_path / 'a.csv')).kind == 'text file'


@pytest.mark.parametrize('target', ['a.mcap', 'bag'])
def test_a_recording(tmp_path, target):
    record_clouds([surface(tmp_path / 'a.x3p')] * 3, tmp_path / target)
    found = describe(tmp_path / target)
    assert found.kind == ('MCAP file' if target == 'a.mcap' else 'rosbag2 directory')
    assert (found.facts['messages'], found.facts['duration']) == ('3', '2.000 s')
    assert found.facts['start'] == 'no time'  # imported clouds have no date
    assert found.facts['imported'] == '; '.join(['a.x3p (m, stated in the file)'] * 3)
    assert found.topics == [TopicDescription('/points', CLOUD, 3, '2 rows × 3 columns (x, y, z)', 'm')]
    assert found.damage is None


def test_a_topic_in_micrometres_is_told_with_their_sign(tmp_path):
    record_clouds([surface(tmp_path / 'a.npz')], tmp_path / 'a.mcap')
    (topic,) = describe(tmp_path / 'a.mcap').topics
    assert topic._replace(unit='um').text() == f'/points  {CLOUD}  1, 2 rows × 3 columns (x, y, z), in µm'


def test_units_attachments_and_records_are_listed(tmp_path):
    record_clouds([surface(tmp_path / 'a.x3p')], tmp_path / 'a.mcap')
    with open_recording(tmp_path / 'a.mcap') as reader, RecordingWriter(tmp_path / 'b.mcap') as writer:
        writer.add_attachment(Attachment('calibration.yaml', 'text/yaml', b'1', 0, 0))
        writer.add_metadata(MetadataRecord('site', {'a': 'b'}))
        for topic in ('/points', '/other'):
            writer.add_topic(ros_topic(topic, CLOUD))
            writer.write(topic, next(iter(reader.messages())).data, 1)
    found = describe(tmp_path / 'b.mcap')
    assert found.facts['also'] == 'attachment calibration.yaml, metadata site'
    assert found.topics[0].text() == f'/other  {CLOUD}  1, 2 rows × 3 columns (x, y, z), unit not known'


def test_a_damaged_recording(tmp_path):
    record_clouds([surface(tmp_path / 'a.x3p')] * 3, tmp_path / 'a.mcap')
    content = (tmp_path / 'a.mcap').read_bytes()
    (tmp_path / 'a.mcap').write_bytes(content[: len(content) // 2])
    assert 'is damaged' in describe(tmp_path / 'a.mcap').damage


def test_a_stack_and_its_recording(tmp_path):
    frames = np.zeros((4, 5, 6), np.uint8)
    np.savez(tmp_path / 's.npz', frames=frames, z=np.arange(4) - 1.5)
    found = describe(tmp_path / 's.npz')
    assert (found.kind, found.facts) == (
        'focus stack',
        {
            'frames': '4',
            'z': '−1.5 to 1.5 in its own unit, which is not stated',
            'image': '5 rows × 6 columns, uint8',
        },
    )
    record_stack(tmp_path / 's.npz', tmp_path / 's.mcap', pitch=1e-6, z_step=1e-6)
    rows = {row.name: row for row in describe(tmp_path / 's.mcap').topics}
    assert rows['/stack/image'][2:] == (4, '5 rows × 6 columns mono8', None)


def test_a_cloud_off_a_grid_has_no_pitch(tmp_path):
    points = MeasuredSurface(HEIGHTS, (5e-7, 2.5e-7), 'm').cloud()
    points.points[1, 1, 0] *= 1.2
    write_cloud_file(tmp_path / 'a.ply', points)
    assert describe(tmp_path / 'a.ply').facts['pitch'].startswith('none: The points are off a regular grid')


@pytest.mark.parametrize('name', ['nowhere.mcap', 'nowhere.al3d', 'nowhere.npz', 'nowhere'])
def test_a_file_that_does_not_exist(tmp_path, name):
    with pytest.raises(SocialCircleError, match='does not exist'):
        describe(tmp_path / name)
