# SPDX-License-Identifier: Apache-2.0
"""A recording filtered offline."""

from pathlib import Path

import numpy as np
import pytest
from examples import cloud

from socialcircle_ros import CircleSettings
from socialcircle_ros.errors import RecordingError
from socialcircle_ros.interface import MASK, SCORE
from socialcircle_ros.messages import diagnostics, image, point_cloud
from socialcircle_ros.messages.header import Header
from socialcircle_ros.messages.image import decode_mono8
from socialcircle_ros.messages.point_cloud import PointCloud, encode_point_cloud
from socialcircle_ros.pipeline.clouds import filter_cloud
from socialcircle_ros.recording import RecordingWriter, Topic, open_recording, ros_topic
from socialcircle_ros.recording.offline import filter_recording, source_clouds
from socialcircle_ros.settings import OutputSettings, PipelineSettings

OTHER = Topic('/cell/notes', 'odd_msgs/msg/Note', b'string text\n', 'ros2msg', 'cdr', {'by': 'someone'})


def record(path, topics, messages):
    with RecordingWriter(path) as writer:
        for topic in topics:
            writer.add_topic(topic)
        for message in messages:
            writer.write(*message)
    return path


def night(path, clouds=3, topic='/cell/points'):
    messages = []
    for number in range(clouds):
        messages.append((topic, cloud(seed=number, stamp=number), 100 * number + 7, 100 * number + 3, number))
        messages.append((OTHER.name, bytes([number]) * 9, 100 * number + 50, 100 * number + 49, number))
    return record(path, [ros_topic(topic, point_cloud.TYPE), OTHER], messages)


def run(source, target, circle=None, output=None, **options):
    settings = PipelineSettings(circle=circle or CircleSettings(), output=output or OutputSettings())
    return filter_recording(source, target, settings, **options)


def contents(path):
    with open_recording(path) as reader:
        return dict(reader.topics), list(reader.messages())


def test_what_the_recording_had_is_kept_byte_for_byte_with_its_times(tmp_path):
    source, target = night(tmp_path / 'night.mcap'), tmp_path / 'cleaned.mcap'
    summary = run(source, target)
    before, after = contents(source), contents(target)
    for name in before[0]:
        assert after[0][name] == before[0][name]
        assert [m for m in after[1] if m.topic == name] == [m for m in before[1] if m.topic == name]
    assert (summary.clouds, summary.kept, summary.refused, summary.damage) == (3, len(before[1]), {}, None)


def test_results_are_the_pipeline_s_under_the_node_s_names_at_the_cloud_s_times(tmp_path):
    source, target = night(tmp_path / 'night.mcap'), tmp_path / 'cleaned.mcap'
    circle = CircleSettings(mode='paper', radius_scale=1.5)
    run(source, target, circle)
    topics, messages = contents(target)
    names = {
        '/cell/points_filtered': point_cloud.TYPE,
        '/cell/outlier_mask': image.TYPE,
        '/cell/social_circle/measurement': diagnostics.TYPE,
    }
    assert {name: topics[name].type for name in names} == names
    by_topic = {name: [m for m in messages if m.topic == name] for name in topics}
    for number, message in enumerate(by_topic['/cell/points']):
        expected = filter_cloud(message.data, PipelineSettings(circle=circle)).messages
        for topic, data in expected.items():
            assert by_topic[topic.within('/cell')][number][1:] == (data, *message[2:])


def test_the_adaptive_mode_s_score_is_recorded_where_it_is_wanted(tmp_path):
    source, target = night(tmp_path / 'night.mcap'), tmp_path / 'cleaned.mcap'
    settings = PipelineSettings(circle=CircleSettings(mode='adaptive'), output=OutputSettings(score=True))
    filter_recording(source, target, settings)
    topics, messages = contents(target)
    assert topics['/cell/outlier_score'].type == image.TYPE
    clouds = [m for m in messages if m.topic == '/cell/points']
    scores = [m for m in messages if m.topic == '/cell/outlier_score']
    for before, score in zip(clouds, scores, strict=True):
        assert score[1:] == (filter_cloud(before.data, settings).messages[SCORE], *before[2:])


def test_there_is_no_score_of_the_paper_s_mode_and_an_earlier_one_gives_way(tmp_path):
    source = night(tmp_path / 'night.mcap')
    output = OutputSettings(score=True)
    run(source, tmp_path / 'once.mcap', CircleSettings(mode='adaptive'), output)
    summary = run(tmp_path / 'once.mcap', tmp_path / 'twice.mcap', CircleSettings(mode='paper'), output)
    assert '/cell/outlier_score' in summary.replaced
    assert '/cell/outlier_score' not in contents(tmp_path / 'twice.mcap')[0]


def test_the_same_recording_gives_the_same_bytes(tmp_path):
    source = night(tmp_path / 'night.mcap')
    for folder in ('first', 'second'):
        (tmp_path / folder).mkdir()
        run(source, tmp_path / folder / 'cleaned.mcap')
    first, second = (tmp_path / folder / 'cleaned.mcap' for folder in ('first', 'second'))
    assert first.read_bytes() == second.read_bytes()


def test_a_rosbag2_directory_goes_in_and_out(tmp_path):
    source, target = night(tmp_path / 'night'), tmp_path / 'cleaned'
    assert run(source, target).clouds == 3
    assert {path.name for path in target.iterdir()} == {'cleaned_0.mcap', 'metadata.yaml'}


def test_results_of_an_earlier_run_give_way(tmp_path):
    source = night(tmp_path / 'night.mcap')
    run(source, tmp_path / 'once.mcap')
    summary = run(tmp_path / 'once.mcap', tmp_path / 'twice.mcap', CircleSettings(mode='paper', radius_scale=100))
    assert summary.replaced == ['/cell/outlier_mask', '/cell/points_filtered', '/cell/social_circle/measurement']
    _, messages = contents(tmp_path / 'twice.mcap')
    masks = [decode_mono8(message.data) for message in messages if message.topic == '/cell/outlier_mask']
    assert len(masks) == 3
    assert not any(np.any(mask == image.OUTLIER) for mask in masks)


def test_a_bad_cloud_is_kept_counted_and_ends_nothing(tmp_path):
    bad, again = (encode_point_cloud(Header(stamp, 7), np.zeros((1, 9, 3), np.float32)) for stamp in (5, 8))
    messages = [('/points', data, time) for time, data in enumerate([cloud(), bad, cloud(), again])]
    source = record(tmp_path / 'night.mcap', [ros_topic('/points', point_cloud.TYPE)], messages)
    summary = run(source, tmp_path / 'cleaned.mcap')
    assert summary.clouds == 2
    ((reason, count),) = summary.refused.items()
    assert count == 2
    assert 'not organized' in reason
    assert summary.first_refused == {reason: '/points 1'}
    _, after = contents(tmp_path / 'cleaned.mcap')
    assert [m.data for m in after if m.topic == '/points'] == [data for _, data, _ in messages]


def test_a_recording_that_is_cut_off_gives_what_came_before(tmp_path):
    source = night(tmp_path / 'night.mcap', clouds=20)
    data = source.read_bytes()
    source.write_bytes(data[: len(data) // 2])
    summary = run(source, tmp_path / 'cleaned.mcap')
    assert 0 < summary.clouds < 20
    assert 'night.mcap' in summary.damage
    _, messages = contents(tmp_path / 'cleaned.mcap')
    assert sum(message.topic == '/cell/points_filtered' for message in messages) == summary.clouds


def test_the_only_topic_of_clouds_is_filtered_whatever_its_name(tmp_path):
    source = night(tmp_path / 'night.mcap', topic='/zivid/xyz')
    run(source, tmp_path / 'cleaned.mcap')
    assert '/zivid/points_filtered' in contents(tmp_path / 'cleaned.mcap')[0]


@pytest.mark.parametrize(
    ('names', 'chosen', 'sentence'),
    [
        (
            [],
            (),
            r'has neither clouds \(sensor_msgs/msg/PointCloud2\) nor frames \(stack/image\); it has: /cell/notes',
        ),
        (['/a/raw', '/b/raw'], (), 'several topics of clouds; choose with --topic: /a/raw, /b/raw'),
        (['/points'], ('/cell/notes',), 'has no topic /cell/notes of clouds'),
        (['/points'], ('/nowhere',), 'has no topic /nowhere of clouds'),
    ],
)
def test_a_topic_that_is_not_there_is_told_with_those_that_are(tmp_path, names, chosen, sentence):
    topics = [OTHER, *(ros_topic(name, point_cloud.TYPE) for name in names)]
    source = record(tmp_path / 'night.mcap', topics, [(topic.name, b'\0\1\0\0', 5) for topic in topics])
    with pytest.raises(RecordingError, match=sentence):
        run(source, tmp_path / 'cleaned.mcap', topics=chosen)
    assert not (tmp_path / 'cleaned.mcap').exists()


def test_every_chosen_topic_is_filtered_in_its_own_namespace(tmp_path):
    topics = [ros_topic(name, point_cloud.TYPE) for name in ('/a/points', '/b/points')]
    source = record(tmp_path / 'n.mcap', topics, [(topic.name, cloud(), 5) for topic in topics])
    assert run(source, tmp_path / 'c.mcap').clouds == 2
    assert {'/a/points_filtered', '/b/points_filtered'} <= contents(tmp_path / 'c.mcap')[0].keys()


def test_the_papers_mode_filters_shipped_recordings_nearly_without_error(request):
    settings = PipelineSettings(circle=CircleSettings(mode='paper'))
    for path in sorted((Path(request.config.rootpath) / 'bags').glob('*.mcap')):
        with open_recording(path) as reader:
            messages = list(reader.messages())
        truths = {message.log_time: message.data for message in messages if message.topic == '/truth/outlier_mask'}
        for message in (message for message in messages if message.topic == '/points'):
            outputs = filter_cloud(message.data, settings).messages
            truth, mask = decode_mono8(truths[message.log_time]), decode_mono8(outputs[MASK])
            certain = truth != image.NOT_MEASURED
            wrong = np.count_nonzero((truth != mask) & certain)
            assert wrong <= 0.001 * np.count_nonzero(certain), path.name
            assert (
                not np.isfinite(PointCloud.decode(message.data).xyz()[mask == image.NOT_MEASURED])
                .all(axis=1)
                .any()
            )


def test_a_result_of_the_filter_is_not_filtered_again(tmp_path):
    run(night(tmp_path / 'night.mcap'), tmp_path / 'cleaned.mcap')
    with pytest.raises(RecordingError, match='points_filtered is an output of this filter'):
        run(tmp_path / 'cleaned.mcap', tmp_path / 'again.mcap', topics=('/cell/points_filtered',))


def test_the_clouds_that_would_be_filtered_come_in_their_order_with_their_messages(tmp_path):
    source = night(tmp_path / 'night.mcap')
    seen = []
    with open_recording(source) as reader:
        clouds = list(source_clouds(reader, PipelineSettings(), seen=seen.append))
        messages = list(reader.messages())
    assert [cloud.message for cloud in clouds] == [m for m in messages if m.topic == '/cell/points']
    assert [(cloud.namespace, cloud.topic, cloud.image) for cloud in clouds] == [
        ('/cell', '/cell/points', None)
    ] * 3
    assert seen == [*messages, None]


def test_a_single_topic_may_be_given_by_its_name(tmp_path):
    source = night(tmp_path / 'night.mcap', 1)
    summary = run(source, tmp_path / 'cleaned.mcap', topics='/cell/points')
    assert (summary.clouds, summary.kept) == (1, len(contents(source)[1]))
