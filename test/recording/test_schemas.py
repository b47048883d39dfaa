# SPDX-License-Identifier: Apache-2.0
import json
import sys
from pathlib import Path

import pytest

from socialcircle_ros.errors import RecordingError
from socialcircle_ros.recording import schema_text, schemas, type_hash

SHIPPED = Path(schemas.__file__).with_name('definitions')
INSTALLED = Path(sys.prefix, 'share')
RULE = '=' * 80


@pytest.fixture(autouse=True)
def _forget():
    yield
    schema_text.cache_clear()
    type_hash.cache_clear()


def test_the_text_is_the_definition_then_each_dependency_once_sorted_and_depth_first():
    text = schema_text('sensor_msgs/msg/PointCloud2')
    parts = text.split(f'\n{RULE}\nMSG: ')
    assert parts[0] == (SHIPPED / 'sensor_msgs.PointCloud2.msg').read_text()
    assert [part.splitlines()[0] for part in parts[1:]] == [
        'sensor_msgs/PointField',
        'std_msgs/Header',
        'builtin_interfaces/Time',
    ]
    assert parts[1] == 'sensor_msgs/PointField\n' + (SHIPPED / 'sensor_msgs.PointField.msg').read_text()


def test_a_type_that_is_contained_twice_is_written_once():
    text = schema_text('diagnostic_msgs/msg/DiagnosticArray')
    assert text.count('MSG: diagnostic_msgs/KeyValue') == 1
    assert text.index('MSG: diagnostic_msgs/DiagnosticStatus') < text.index('MSG: diagnostic_msgs/KeyValue')


@pytest.mark.skipif(not (INSTALLED / 'sensor_msgs').is_dir(), reason='ROS is not installed in this environment')
@pytest.mark.parametrize('path', sorted(SHIPPED.glob('*.msg')), ids=lambda path: path.name)
def test_shipped_definitions_equal_those_of_ros(path):
    package, name, _ = path.name.split('.')
    folder = INSTALLED / package / 'msg'
    description = json.loads((folder / f'{name}.json').read_text())
    hashes = {entry['type_name']: entry['hash_string'] for entry in description['type_hashes']}
    assert path.read_bytes() == (folder / f'{name}.msg').read_bytes()
    assert type_hash(f'{package}/msg/{name}') == hashes[f'{package}/msg/{name}']


def test_an_installed_type_is_found_in_the_prefixes_of_ament(tmp_path, monkeypatch):
    folder = tmp_path / 'share' / 'my_msgs' / 'msg'
    folder.mkdir(parents=True)
    (folder / 'Part.msg').write_text('# a part\nstd_msgs/Header header\nBolt[<=4] bolts\nwstring<=3 name\n')
    (folder / 'Bolt.msg').write_text('float32 size 1.0\nint32 MAX=3\n')
    hashes = [{'type_name': 'my_msgs/msg/Part', 'hash_string': 'RIHS01_1'}]
    (folder / 'Part.json').write_text(json.dumps({'type_hashes': hashes}))
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'/nowhere:{tmp_path}')
    names = [line for line in schema_text('my_msgs/msg/Part').splitlines() if line.startswith('MSG: ')]
    assert names == ['MSG: my_msgs/Bolt', 'MSG: std_msgs/Header', 'MSG: builtin_interfaces/Time']
    assert type_hash('my_msgs/msg/Part') == 'RIHS01_1'


@pytest.mark.parametrize('function', [schema_text, type_hash])
def test_an_unknown_type_is_refused_with_advice(function):
    with pytest.raises(RecordingError, match=r'no_msgs/msg/None .* source the workspace .* no_msgs'):
        function('no_msgs/msg/None')


def test_an_invalid_type_name_is_refused():
    with pytest.raises(RecordingError, match=r"'PointCloud2' is not the name of a ROS type"):
        schema_text('PointCloud2')
