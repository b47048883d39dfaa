# SPDX-License-Identifier: Apache-2.0
import yaml

from socialcircle_ros.recording import DEFAULT_QOS, ros_topic, schema_text, type_hash


def test_a_topic_has_schema_hash_and_qos_as_rosbag2_records_them():
    topic = ros_topic('/points', 'sensor_msgs/msg/PointCloud2')
    assert topic.schema.decode() == schema_text('sensor_msgs/msg/PointCloud2')
    assert topic.type_hash == type_hash('sensor_msgs/msg/PointCloud2')
    assert topic.qos == DEFAULT_QOS
    assert (topic.encoding, topic.schema_encoding) == ('cdr', 'ros2msg')


def test_the_default_qos_is_reliable_keep_last_1_volatile():
    (profile,) = yaml.safe_load(DEFAULT_QOS)
    assert profile['reliability'] == 'reliable'
    assert (profile['history'], profile['depth']) == ('keep_last', 1)
    assert profile['durability'] == 'volatile'
    assert profile['deadline'] == {'sec': 9223372036, 'nsec': 854775807}
