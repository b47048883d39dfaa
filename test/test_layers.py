# SPDX-License-Identifier: Apache-2.0
"""The rooms: imports point downward only, and only node/ and clients/ need ROS."""

import ast
import pkgutil
import re
import subprocess
import sys
from pathlib import Path

import socialcircle_ros

PACKAGE = Path(socialcircle_ros.__file__).parent

# A room may import from the rooms on lines below its own, and from itself.
LEVELS = [
    {'commands'},
    {'studies'},
    {'clients'},
    {'node', 'panel', 'sweep'},
    {'archive', 'teaching'},
    {'report'},
    {'recording', 'measurements'},
    {'pipeline'},
    {'interface'},
    {'simulation', 'messages', 'formats', 'pictures'},
    {'circle', 'focus', 'repair', 'baselines', 'metrics'},
    {'cloud', 'engine'},
    {'arguments', 'settings', 'kernels', 'storage', 'lengths'},
    {'errors', 'onnx_runtime', 'digits', 'terminal'},
]
LEVEL = {room: level for level, rooms in enumerate(LEVELS) for room in rooms}
NEED_ROS = {'node', 'clients'}

ROS = {'rclpy', 'sensor_msgs', 'std_msgs', 'std_srvs', 'diagnostic_msgs', 'rcl_interfaces', 'lifecycle_msgs',
       'rosgraph_msgs', 'builtin_interfaces', 'ament_index_python'}  # fmt: skip


def modules():
    return [path for path in PACKAGE.rglob('*.py') if path != PACKAGE / '__init__.py']


def modules_without_ros():
    return [path for path in modules() if room_of(path) not in NEED_ROS]


def room_of(path):
    return path.relative_to(PACKAGE).parts[0].removesuffix('.py')


def imported_rooms(path):
    """The rooms that a module imports from, relative imports resolved."""
    package = ('socialcircle_ros', *path.relative_to(PACKAGE).parent.parts)
    for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = '.'.join(package[: len(package) - node.level + 1]) if node.level else ''
            module = '.'.join(part for part in (base, node.module or '') if part)
            names = [f'{module}.{alias.name}' for alias in node.names]
        for name in names:
            parts = name.split('.')
            if parts[0] == 'socialcircle_ros' and len(parts) > 1:
                yield parts[1]


def test_imports_point_downward_only():
    upward = [
        f'{path.relative_to(PACKAGE)} imports from {other}'
        for path in modules()
        for other in imported_rooms(path)
        if other != room_of(path) and LEVEL[other] <= LEVEL[room_of(path)]
    ]
    assert not upward


def imported_at_import(path):
    """The packages that a module imports when it is imported itself."""
    for node in ast.parse(path.read_text(encoding='utf-8')).body:
        if isinstance(node, ast.Import):
            yield from (alias.name.split('.')[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield (node.module or '').split('.')[0]


def test_only_node_and_clients_know_ros_at_import():
    assert not [str(path) for path in modules_without_ros() if ROS & set(imported_at_import(path))]


# Modules that open files for writing: `storage` and the files of a recording in its unfinished folder.
WRITERS = {'storage/unfinished.py', 'recording/writer.py'}
# These write in a temporary folder.
WRITERS |= {'baselines/peers.py', 'formats/sdf.py', 'formats/archive.py', 'formats/points.py'}
WRITING = {'write_text', 'write_bytes', 'touch', 'NamedTemporaryFile', 'mkstemp'}


def writes_files(path):
    """Whether a module opens files for writing by itself, instead of with `storage`."""
    calls = [node for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))) if isinstance(node, ast.Call)]
    for call in calls:
        name = getattr(call.func, 'attr', getattr(call.func, 'id', ''))
        values = [value.value for value in call.args if isinstance(value, ast.Constant)]
        keywords = {keyword.arg: getattr(keyword.value, 'value', None) for keyword in call.keywords}
        mode = str(keywords.get('mode', '')) or ''.join(str(value) for value in values)
        opens = name in {'open', 'fdopen'} and re.fullmatch('[rwxabt+]{1,3}', mode) and set(mode) & set('wxa+')
        if name in WRITING or opens or (name == 'savefig' and 'format' not in keywords):
            return True
    return False


def test_files_are_written_with_storage():
    writing = {str(path.relative_to(PACKAGE)) for path in modules() if writes_files(path)}
    assert writing <= set(WRITERS), 'use write_file or Unfinished'


TRAINED_WITH = 'socialcircle_ros.studies.learned.'
"""Modules of the training need PyTorch, ONNX and SciPy at their import; the others there do not."""
WITHOUT_TRAINING = {
    f'{TRAINED_WITH}{name}'
    for name in ('drawings', 'evaluation', 'leave_out', 'options', 'scenes', 'surfaces', 'visible', '__main__')
}


def test_every_other_room_imports_on_a_machine_without_ros():
    names = [
        info.name
        for info in pkgutil.walk_packages([str(PACKAGE)], 'socialcircle_ros.')
        if not any(f'{info.name}.'.startswith(f'socialcircle_ros.{room}.') for room in NEED_ROS)
        and (not info.name.startswith(TRAINED_WITH) or info.name in WITHOUT_TRAINING)
    ]
    assert set(names) >= WITHOUT_TRAINING
    program = (
        'import importlib, sys\n'
        f'for name in {sorted(ROS | {"torch", "onnx", "scipy"})!r}: sys.modules[name] = None\n'
        f'for name in {names!r}: importlib.import_module(name)\n'
    )
    done = subprocess.run([sys.executable, '-c', program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
