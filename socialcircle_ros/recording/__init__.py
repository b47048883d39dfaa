"""MCAP files and rosbag2 directories in and out, and the offline pipeline over them."""

from socialcircle_ros.recording.importers import ImportedCloud, import_cloud
from socialcircle_ros.recording.reader import RecordingReader, open_recording
from socialcircle_ros.recording.schemas import schema_text, type_hash
from socialcircle_ros.recording.topics import DEFAULT_QOS, Message, Topic, ros_topic
from socialcircle_ros.recording.writer import RecordingWriter

__all__ = [
    'DEFAULT_QOS',
    'ImportedCloud',
    'Message',
    'RecordingReader',
    'RecordingWriter',
    'Topic',
    'import_cloud',
    'open_recording',
    'ros_topic',
    'schema_text',
    'type_hash',
]
