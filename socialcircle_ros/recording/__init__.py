"""Recordings: MCAP files and rosbag2 directories in and out, imported measurement files, and the offline filter.

Messages stay serialized here; `messages` reads and writes their bytes.
"""

from .importers import ImportedCloud, import_cloud
from .reader import RecordingReader, open_recording
from .schemas import schema_text, type_hash
from .topics import DEFAULT_QOS, Message, Topic, ros_topic
from .writer import RecordingWriter

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
