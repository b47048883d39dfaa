# SPDX-License-Identifier: Apache-2.0
"""The parts of a recording: topics and messages."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from .schemas import schema_text, type_hash

_FOREVER = 'sec: 9223372036\n    nsec: 854775807'


def offered_qos(depth: int) -> str:
    """The QoS reliable, keep last `depth`, volatile, as the YAML of rosbag2 in Jazzy."""
    return f"""\
- history: keep_last
  depth: {depth}
  reliability: reliable
  durability: volatile
  deadline:
    {_FOREVER}
  lifespan:
    {_FOREVER}
  liveliness: automatic
  liveliness_lease_duration:
    {_FOREVER}
  avoid_ros_namespace_conventions: false"""


DEFAULT_QOS = offered_qos(1)
"""The QoS of the topics that this package writes: only the newest message is kept."""


@dataclass(frozen=True)
class Topic:
    """One topic as a recording stores it.

    Attributes:
        name: with its leading slash.
        type: the message type, such as `sensor_msgs/msg/PointCloud2`; empty if the recording does not name it.
        schema: the definition of the type, byte for byte.
        schema_encoding: `ros2msg` or `ros2idl`.
        encoding: the serialization of the messages; `cdr` in every recording of ROS 2.
        metadata: of the MCAP channel; rosbag2 keeps the offered QoS and the type hash there.
    """

    name: str
    type: str
    schema: bytes
    schema_encoding: str
    encoding: str
    metadata: Mapping[str, str]

    @property
    def qos(self) -> str:
        """The offered QoS profiles, as recorded YAML; empty if unknown."""
        return self.metadata.get('offered_qos_profiles', '')

    @property
    def type_hash(self) -> str:
        """The RIHS01 hash of the type; empty if unknown."""
        return self.metadata.get('topic_type_hash', '')


class Attachment(NamedTuple):
    """A file that is kept in a recording.

    Attributes:
        name: of the file.
        media_type: such as `text/yaml`; may be empty.
        data: its content.
        log_time: when it was recorded, ns since 1970.
        create_time: when it was made, ns since 1970; 0 if unknown.
    """

    name: str
    media_type: str
    data: bytes
    log_time: int
    create_time: int


class MetadataRecord(NamedTuple):
    """A record of texts that belongs to a recording as a whole.

    Attributes:
        name: of the record.
        entries: texts by their names.
    """

    name: str
    entries: dict[str, str]


class Message(NamedTuple):
    """One recorded message.

    Attributes:
        topic: name of the topic.
        data: the serialized message.
        log_time: when it was recorded, ns since 1970.
        publish_time: when it was published, ns since 1970.
        sequence: the number that the publisher gave it; 0 if unknown.
    """

    topic: str
    data: bytes
    log_time: int
    publish_time: int
    sequence: int


class CheckedMessage(Message):
    """A message whose data has a known checksum. `_replace` gives one whose checksum is not known.

    Attributes:
        checksum: CRC-32 of the data; None: not known.
    """

    checksum: int | None = None


def ros_topic(name: str, type_name: str, qos: str = DEFAULT_QOS) -> Topic:
    """A topic of a ROS type, for a `RecordingWriter`.

    Args:
        name: with its leading slash.
        type_name: such as `sensor_msgs/msg/PointCloud2`.
        qos: the offered QoS profiles, as the YAML of rosbag2 in Jazzy.

    Raises:
        RecordingError: the type is neither shipped nor installed.
    """
    return Topic(
        name=name,
        type=type_name,
        schema=schema_text(type_name).encode(),
        schema_encoding='ros2msg',
        encoding='cdr',
        metadata={'offered_qos_profiles': qos, 'topic_type_hash': type_hash(type_name)},
    )
