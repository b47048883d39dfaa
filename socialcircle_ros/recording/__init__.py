# SPDX-License-Identifier: Apache-2.0
"""Recordings: MCAP files and rosbag2 directories in and out, imported measurement files, and the offline filter.

Messages stay serialized here; `messages` reads and writes their bytes.
"""

from .any_file import open_recording
from .importers import ImportedCloud, import_cloud
from .reader import RecordingReader
from .schemas import schema_text, type_hash
from .surfaces import read_surface
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
    'read_surface',
    'ros_topic',
    'schema_text',
    'type_hash',
]
