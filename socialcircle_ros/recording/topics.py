"""What a recording is made of: topics and their messages."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from .schemas import schema_text, type_hash

_FOREVER = 'sec: 9223372036\n    nsec: 854775807'


def offered_qos(depth: int) -> str:
    """Reliable, keep last `depth`, volatile, as the YAML of rosbag2 in Jazzy."""
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
"""What our topics offer: the newest message counts."""


@dataclass(frozen=True)
class Topic:
    """One topic as a recording stores it.

    Attributes:
        name: With its leading slash.
        type: The message type, `sensor_msgs/msg/PointCloud2`; empty where the recording names none.
        schema: The definition of the type, byte for byte.
        schema_encoding: `ros2msg`, or `ros2idl`.
        encoding: How messages are serialized: `cdr` in every recording of ROS 2.
        metadata: The channel's metadata; rosbag2 keeps the offered QoS and the type hash there.
    """

    name: str
    type: str
    schema: bytes
    schema_encoding: str
    encoding: str
    metadata: Mapping[str, str]

    @property
    def schema_text(self) -> str:
        """The definition of the type as text."""
        return self.schema.decode('utf-8', errors='replace')

    @property
    def qos(self) -> str:
        """The offered QoS profiles, YAML as recorded; empty where unknown."""
        return self.metadata.get('offered_qos_profiles', '')

    @property
    def type_hash(self) -> str:
        """The RIHS01 hash of the type; empty where unknown."""
        return self.metadata.get('topic_type_hash', '')


class Message(NamedTuple):
    """One recorded message: its topic's name, its serialized bytes, and its times in ns."""

    topic: str
    data: bytes
    log_time: int
    publish_time: int
    sequence: int


def ros_topic(name: str, type_name: str, qos: str = DEFAULT_QOS) -> Topic:
    """Describe a topic of a ROS type for a `RecordingWriter`.

    Args:
        name: With its leading slash.
        type_name: As ROS writes it, `sensor_msgs/msg/PointCloud2`.
        qos: The offered QoS profiles, as the YAML of rosbag2 in Jazzy.

    Raises:
        RecordingError: The type is neither shipped nor installed.
    """
    return Topic(
        name=name,
        type=type_name,
        schema=schema_text(type_name).encode(),
        schema_encoding='ros2msg',
        encoding='cdr',
        metadata={'offered_qos_profiles': qos, 'topic_type_hash': type_hash(type_name)},
    )
