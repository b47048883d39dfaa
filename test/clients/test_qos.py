# SPDX-License-Identifier: Apache-2.0
"""QoS profiles to and from the text that rosbag2 records."""

from types import SimpleNamespace

import pytest
import yaml
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from socialcircle_ros.clients.qos import recorded_text, recording_qos, replay_qos
from socialcircle_ros.recording.topics import offered_qos

LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
LOSSY = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT, durability=DurabilityPolicy.VOLATILE)


def publishers(*profiles):
    return [SimpleNamespace(qos_profile=profile) for profile in profiles]


def policies(profile):
    return (profile.history.name, profile.depth, profile.reliability.name, profile.durability.name)


def profile_text(**values):
    profile = {'history': 'keep_last', 'depth': 7, 'reliability': 'reliable', 'durability': 'volatile'}
    return yaml.safe_dump([{**profile, **values}])


@pytest.mark.parametrize(
    ('recorded', 'expected'),
    [
        (offered_qos(50), ('KEEP_LAST', 50, 'RELIABLE', 'VOLATILE')),
        (profile_text(reliability='best_effort'), ('KEEP_LAST', 7, 'BEST_EFFORT', 'VOLATILE')),
        (profile_text(durability='transient_local'), ('KEEP_LAST', 7, 'RELIABLE', 'TRANSIENT_LOCAL')),
        (profile_text(history='unknown', depth=0), ('KEEP_LAST', 1, 'RELIABLE', 'VOLATILE')),
        (profile_text(history=1, reliability=2, durability=1), ('KEEP_LAST', 7, 'BEST_EFFORT', 'TRANSIENT_LOCAL')),
        (profile_text(reliability='best_available'), ('KEEP_LAST', 7, 'RELIABLE', 'VOLATILE')),
        (profile_text(reliability='odd'), ('KEEP_LAST', 10, 'RELIABLE', 'VOLATILE')),
        (profile_text(reliability=77), ('KEEP_LAST', 10, 'RELIABLE', 'VOLATILE')),
        ('', ('KEEP_LAST', 10, 'RELIABLE', 'VOLATILE')),
        ('[: ??', ('KEEP_LAST', 10, 'RELIABLE', 'VOLATILE')),
        ('- &a {reliability: best_effort, depth: *a}', ('KEEP_LAST', 10, 'RELIABLE', 'VOLATILE')),
        ('[' * 5000, ('KEEP_LAST', 10, 'RELIABLE', 'VOLATILE')),
    ],
)
def test_a_topic_is_played_with_the_recorded_policies(recorded, expected):
    assert policies(replay_qos(recorded)) == expected


def test_keep_all_is_played_as_keep_all():
    assert replay_qos(profile_text(history='keep_all')).history == HistoryPolicy.KEEP_ALL


@pytest.mark.parametrize(
    ('offered', 'expected'),
    [
        ((LATCHED, LATCHED), ('RELIABLE', 'TRANSIENT_LOCAL')),
        ((LATCHED, LOSSY), ('BEST_EFFORT', 'VOLATILE')),
        ((LOSSY,), ('BEST_EFFORT', 'VOLATILE')),
    ],
)
def test_a_recording_subscribes_with_what_all_publishers_offer(offered, expected):
    assert policies(recording_qos(publishers(*offered)))[2:] == expected


def test_the_recorded_text_has_the_keys_of_rosbag2_and_is_played_the_same():
    (written,) = yaml.safe_load(recorded_text(publishers(LOSSY)))
    (expected,) = yaml.safe_load(offered_qos(5))
    assert list(written) == list(expected)
    assert policies(replay_qos(recorded_text(publishers(LOSSY)))) == policies(LOSSY)
