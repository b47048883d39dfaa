# SPDX-License-Identifier: Apache-2.0
"""The metadata of rosbag2, version 9 (Jazzy), as metadata.yaml and the metadata record of a file hold it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import yaml

from socialcircle_ros.settings.plain_yaml import PlainYamlError, load_plain_yaml

from .topics import Topic

QosProfile = dict[str, object]
"""One profile of `offered_qos_profiles`."""

# Metadata before version 9 (Jazzy) holds QoS policies as numbers: the places of these words.
_POLICY_NAMES = {
    'history': ['system_default', 'keep_last', 'keep_all', 'unknown'],
    'reliability': ['system_default', 'reliable', 'best_effort', 'unknown', 'best_available'],
    'durability': ['system_default', 'transient_local', 'volatile', 'unknown', 'best_available'],
    'liveliness': [
        'system_default',
        'automatic',
        'manual_by_node',
        'manual_by_topic',
        'unknown',
        'best_available',
    ],
}


@dataclass(frozen=True)
class FileContents:
    """What one file of a recording holds.

    Attributes:
        name: of the file.
        counts: the number of messages by topic.
        start: the earliest log time, ns.
        end: the latest log time, ns.
    """

    name: str
    counts: Mapping[str, int]
    start: int
    end: int

    @property
    def message_count(self) -> int:
        """The number of messages."""
        return sum(self.counts.values())

    def times(self) -> dict[str, object]:
        """Start and duration, as metadata.yaml writes them."""
        start, end = (self.start, self.end) if self.message_count else (0, 0)
        return {
            'starting_time': {'nanoseconds_since_epoch': start},
            'duration': {'nanoseconds': end - start},
        }


def bag_information(topics: Mapping[str, Topic], files: Sequence[FileContents]) -> dict[str, object]:
    """The metadata of a recording, with its keys in the order of rosbag2.

    Args:
        topics: all topics, also those without messages, by the names under which their messages are counted.
        files: at least one.
    """
    written = [file for file in files if file.message_count]
    counts = {name: sum(file.counts.get(name, 0) for file in files) for name in topics}
    whole = FileContents(
        '',
        counts,
        min((file.start for file in written), default=0),
        max((file.end for file in written), default=0),
    )
    times = whole.times()
    return {
        'version': 9,
        'storage_identifier': 'mcap',
        'duration': times['duration'],
        'starting_time': times['starting_time'],
        'message_count': whole.message_count,
        'topics_with_message_count': [
            {'topic_metadata': _topic_metadata(topic), 'message_count': counts[name]}
            for name, topic in topics.items()
        ],
        'compression_format': '',
        'compression_mode': '',
        'relative_file_paths': [file.name for file in files],
        'files': [{'path': file.name, **file.times(), 'message_count': file.message_count} for file in files],
        'custom_data': None,
        'ros_distro': 'jazzy',
    }


def to_yaml(information: Mapping[str, object]) -> str:
    """Metadata as YAML, in its order."""
    return yaml.safe_dump(dict(information), sort_keys=False)


def channel_metadata(topic: Topic) -> dict[str, str]:
    """The metadata of a channel: the topic's, with QoS policies in words, because Jazzy reads only words."""
    metadata = dict(topic.metadata)
    if (profiles := _qos_in_words(topic.qos)) != _load_qos(topic.qos):
        metadata['offered_qos_profiles'] = yaml.safe_dump(profiles, sort_keys=False)
    return metadata


def _topic_metadata(topic: Topic) -> dict[str, object]:
    return {
        'name': topic.name,
        'type': topic.type,
        'serialization_format': topic.encoding,
        'offered_qos_profiles': _qos_in_words(topic.qos),
        'type_description_hash': topic.type_hash,
    }


def _load_qos(text: str) -> list[QosProfile]:
    """Parse QoS profiles from the YAML of rosbag2; none if it is invalid."""
    try:
        profiles = load_plain_yaml(text)
    except PlainYamlError:
        return []
    return [profile for profile in profiles if isinstance(profile, dict)] if isinstance(profiles, list) else []


def _qos_in_words(text: str) -> list[QosProfile]:
    """Parse QoS profiles, and replace the numbers of policies by words."""
    return [{key: _policy_name(key, value) for key, value in profile.items()} for profile in _load_qos(text)]


def _policy_name(key: str, value: object) -> object:
    names = _POLICY_NAMES.get(key, [])
    return names[value] if isinstance(value, int) and 0 <= value < len(names) else value
