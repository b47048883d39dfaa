# SPDX-License-Identifier: Apache-2.0
"""Message definitions as recordings hold them: the schema text of rosbag2, and the RIHS01 hash of a type.

`definitions/` holds the types that this package writes, copied from ROS 2 Jazzy, so that a recording can be
written without ROS. Other types are read from the installed ROS packages.
"""

import json
import os
import re
import sys
from functools import cache
from importlib.resources import files
from pathlib import Path

from socialcircle_ros.errors import RecordingError

_SHIPPED = files('socialcircle_ros.recording') / 'definitions'
_TYPE_NAME = re.compile(r'([A-Za-z]\w*)/(msg|srv|action)/([A-Za-z]\w*)')
_FIELD_TYPE = re.compile(r'^\s*([A-Za-z0-9_/]+)(?:\[[^\]]*\])?\s', re.MULTILINE)
_PRIMITIVES = frozenset(
    [
        'bool',
        'byte',
        'char',
        'float32',
        'float64',
        'int8',
        'uint8',
        'int16',
        'uint16',
        'int32',
        'uint32',
        'int64',
        'uint64',
        'string',
        'wstring',
    ]
)


@cache
def schema_text(type_name: str) -> str:
    """The text that rosbag2 stores as the schema of a message type.

    Args:
        type_name: such as `sensor_msgs/msg/PointCloud2`.

    Returns:
        The `.msg` text, then the text of each dependency once, sorted and depth first, each after a line of 80 `=`
        and a line `MSG: package/Type`.

    Raises:
        RecordingError: the type, or one that it contains, is neither shipped nor installed.
    """
    seen: set[str] = set()

    def full_text(name: str) -> str:
        text = _definition(name)
        package = name.split('/', maxsplit=1)[0]
        parts = [text]
        for dependency in _dependencies(text, package):
            if dependency not in seen:
                seen.add(dependency)
                inner = full_text(dependency.replace('/', '/msg/'))
                parts.append(f'{"=" * 80}\nMSG: {dependency}\n{inner}')
        return '\n'.join(parts)

    return full_text(type_name)


@cache
def type_hash(type_name: str) -> str:
    """The RIHS01 hash of a message type: `RIHS01_` and 64 hexadecimal digits.

    Raises:
        RecordingError: the type is neither shipped nor installed.
    """
    shipped: dict[str, str] = json.loads((_SHIPPED / 'hashes.json').read_text(encoding='utf-8'))
    if type_name in shipped:
        return shipped[type_name]
    description = json.loads(_installed(type_name, '.json'))
    hashes = {entry['type_name']: entry['hash_string'] for entry in description['type_hashes']}
    return str(hashes[type_name])


def _dependencies(text: str, package: str) -> list[str]:
    """The message types among the fields of a `.msg` text, as `package/Type`, sorted."""
    types = set(_FIELD_TYPE.findall(text)) - _PRIMITIVES
    return sorted(name if '/' in name else f'{package}/{name}' for name in types)


def _definition(type_name: str) -> str:
    package, _, name = _split(type_name)
    shipped = _SHIPPED / f'{package}.{name}.msg'
    if '/msg/' in type_name and shipped.is_file():
        return shipped.read_text(encoding='utf-8')
    return _installed(type_name, '.msg')


def _installed(type_name: str, ending: str) -> str:
    """Read a file of a type from the first ROS prefix that has it.

    Raises:
        RecordingError: no prefix has it.
    """
    package, kind, name = _split(type_name)
    prefixes = [*filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)), sys.prefix]
    for prefix in prefixes:
        path = Path(prefix, 'share', package, kind, f'{name}{ending}')
        if path.is_file():
            return path.read_text(encoding='utf-8')
    raise RecordingError(
        f'The definition of {type_name} is not installed here: source the workspace that has the package '
        f'{package}, so that AMENT_PREFIX_PATH names it.'
    )


def _split(type_name: str) -> tuple[str, str, str]:
    match = _TYPE_NAME.fullmatch(type_name)
    if match is None:
        raise RecordingError(f'{type_name!r} is not the name of a ROS type: write package/msg/Type.')
    return match[1], match[2], match[3]
