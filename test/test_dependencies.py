# SPDX-License-Identifier: Apache-2.0
"""setup.py declares what the package imports, and no more."""

import ast
import re
import sys
from importlib.metadata import packages_distributions
from pathlib import Path
from unittest import mock

import pytest
import setuptools

import socialcircle_ros

PACKAGE = Path(socialcircle_ros.__file__).parent
ROS = {'rclpy', 'sensor_msgs', 'std_msgs', 'std_srvs', 'diagnostic_msgs', 'rcl_interfaces', 'lifecycle_msgs',
       'rosgraph_msgs', 'builtin_interfaces', 'ament_index_python', 'launch', 'launch_ros'}  # fmt: skip
PEERS = {'cv2': 'opencv-python-headless', 'open3d': 'open3d', 'scipy': 'scipy'}
"""Peers of the benchmarks: each is measured where it is installed."""


def name_of(requirement):
    return re.split(r'[<>=!~\[; ]', requirement, maxsplit=1)[0].lower().replace('_', '-')


@pytest.fixture(scope='module')
def declared():
    """The distributions that setup.py declares: for the base install, and with every extra of the product."""
    with mock.patch.object(setuptools, 'setup') as setup:
        source = (PACKAGE.parent / 'setup.py').read_text(encoding='utf-8')
        exec(compile(source, 'setup.py', 'exec'), {'__file__': str(PACKAGE.parent / 'setup.py')})  # noqa: S102
    base = {name_of(each) for each in setup.call_args.kwargs['install_requires']}
    extras = setup.call_args.kwargs['extras_require']
    product = {
        name_of(each)
        for extra in ('pictures', 'tuning', 'panel', 'formats', 'measurements', 'batch', 'train')
        for each in extras[extra]
    }
    return base, base | product


def imported(tree, *, at_the_top):
    """Top-level names of the modules that a module imports from other distributions."""
    for node in tree.body if at_the_top else ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition('.')[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield node.module.partition('.')[0]


ON_DEMAND = {
    PACKAGE / 'panel' / 'server.py',
    *(
        PACKAGE / 'studies' / 'learned' / f'{name}.py'
        for name in ('network', 'training', 'export', 'integers', 'run', 'teacher')
    ),
}
"""Modules that need an extra at their import: for the tuning page, and the training of the network."""


def distributions(*, at_the_top):
    names = set()
    for path in PACKAGE.rglob('*.py'):
        if at_the_top and path in ON_DEMAND:
            continue
        names |= set(imported(ast.parse(path.read_text(encoding='utf-8')), at_the_top=at_the_top))
    names -= {*sys.stdlib_module_names, 'socialcircle_ros', *ROS, *PEERS}
    known = packages_distributions()
    # A distribution that is not installed is told by the name of its module.
    return {name_of(known.get(name, [name])[0]) for name in names}


def test_what_is_imported_is_declared(declared):
    _, product = declared
    assert distributions(at_the_top=False) <= product


def test_the_base_install_declares_no_more_than_is_imported(declared):
    base, _ = declared
    assert base - distributions(at_the_top=False) == {'setuptools'}  # colcon needs it


def test_what_a_module_needs_at_its_import_is_in_the_base_install(declared):
    base, _ = declared
    assert distributions(at_the_top=True) <= base
