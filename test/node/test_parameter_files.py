# SPDX-License-Identifier: Apache-2.0
"""The same parameter files give the node and the offline commands the same settings, or both refuse."""

from pathlib import Path

import pytest
import rclpy
from rclpy.exceptions import InvalidParameterTypeException, ParameterException

from socialcircle_ros.commands.options import parameter_values
from socialcircle_ros.errors import SettingError
from socialcircle_ros.interface import NODE_NAME
from socialcircle_ros.node.parameter_files import files_for_other_nodes
from socialcircle_ros.node.parameters import LiveParameters
from socialcircle_ros.settings import PipelineSettings

SECTION = '/**:\n  ros__parameters:\n    '
FILES = {
    'nested namespace': 'cell1:\n  social_circle:\n    ros__parameters:\n      circle.radius_scale: 1.5\n',
    'namespace in the name': '/cell1/social_circle: {ros__parameters: {circle.radius_scale: 1.5}}\n',
    'wildcard for a name': '/cell1/*: {ros__parameters: {circle.radius_scale: 1.5}}\n',
    'wildcard for a namespace': '/*/social_circle: {ros__parameters: {circle.radius_scale: 1.5}}\n',
    'wildcard for all nodes': '/**: {ros__parameters: {circle: {radius_scale: 1.5, window: 5}}}\n',
    'other nodes too': 'cell1:\n  rviz: {ros__parameters: {fixed_frame: map}}\n'
    '  social_circle: {ros__parameters: {circle.radius_scale: 1.5}}\n',
    'a later section': f'{SECTION}circle.window: 5\n/cell1/*:\n  ros__parameters: {{circle.window: 7}}\n',
    'an earlier section': f'/cell1/*:\n  ros__parameters: {{circle.window: 7}}\n{SECTION}circle.window: 5\n',
    'two documents': f'{SECTION}circle.window: 5\n---\n{SECTION}circle.window: 7\n',
    'parameters of other nodes': f'{SECTION}fixed_frame: map\n    use_sim_time: true\n    circle.window: 5\n',
}
VALUES = [
    'circle.radius_scale: "1.5"', 'circle.radius_scale: 2', 'circle.radius_scale: 1e0', 'circle.radius_scale: 0x2',
    'circle.radius_scale: !!str 1.5', 'circle.radius_scale: 1_5', 'circle.radius_scale: 1:30',
    'circle.radius_scale: .inf', 'circle.radius_scale: nan', 'circle.radius_scale: yes', 'circle.radius: 1e-6',
    'circle.window: 05', 'circle.window: 5.0', 'circle.window: "5"', 'circle.window: 4',
    'circle.window: |\n      5',
    'circle.vote_region: [0, 0, 61, 62]', 'circle.vote_region: [0.0, 0.0, 61.0, 62.0]', 'circle.vote_region: []',
    'circle.vote_region: [1, 2, 3, 4.0]', 'circle.vote_region: 5', 'stack.joint: 5', 'stack.joint: "5"',
    'stack.joint: yes', 'stack.joint: ~', 'stack.joint:', 'stack.joint: ""', 'stack.joint: 2024-05-03',
    'circle.mode: paper', 'circle.mode: "paper"', 'circle.mode: other', 'output.mask: no', 'output.mask: "no"',
    'output.mask: 0', 'circle: &a {window: 5}\n    stack.joint: *a',
]  # fmt: skip
FILES |= {value: f'{SECTION}{value}\n' for value in VALUES}


def settings_of_a_node(path):
    """The settings with which a node in the namespace /cell1 starts; None: it does not start."""
    context = rclpy.Context()
    try:
        rclpy.init(args=['--ros-args', '--params-file', str(path)], context=context)
    except RuntimeError:
        return None
    node = rclpy.create_node(NODE_NAME, namespace='/cell1', context=context)
    try:
        return settings_in(LiveParameters(node, lambda _: None).configuration.to_ros())
    except (SettingError, ParameterException, InvalidParameterTypeException, ValueError):
        return None
    finally:
        node.destroy_node()
        rclpy.shutdown(context=context)


def settings_offline(path):
    """The settings with which the commands filter; None: they refuse."""
    try:
        return settings_in(PipelineSettings.from_ros(parameter_values(Path(path), ())).to_ros())
    except SettingError:
        return None


def settings_in(values):
    return {name: value for name, value in values.items() if name in PipelineSettings().to_ros()}


@pytest.mark.parametrize('name', FILES)
def test_a_file_means_the_same_to_the_node_and_to_the_commands(name, tmp_path):
    path = tmp_path / 'cell.yaml'
    path.write_text(FILES[name])
    assert settings_offline(path) == settings_of_a_node(path)


@pytest.mark.live
def test_a_running_node_and_the_commands_take_the_same_file(start_cell, tmp_path):
    path = tmp_path / 'cell.yaml'
    path.write_text(
        '"/*": {social_circle: {ros__parameters: {circle.radius_scale: 1.5}}}\nrviz: {ros__parameters: {a: 1}}'
    )
    assert start_cell(arguments=('--params-file', str(path))).get('circle.radius_scale') == 1.5
    assert settings_offline(path)['circle.radius_scale'] == 1.5


def test_a_file_for_other_nodes_only_is_told(start_cell, tmp_path):
    path = tmp_path / 'other.yaml'
    path.write_text('/cell7/social_circle: {ros__parameters: {circle.mode: paper}}\n')
    cell = start_cell(arguments=('--params-file', str(path)))
    assert cell.get('circle.mode') == 'adaptive'
    log = cell.node_process.log.read_text()
    assert f'{path} has no effect: it holds no parameters for {cell.name}, only for /cell7/social_circle.' in log


@pytest.mark.parametrize(
    'text',
    [
        '',
        '/**: {ros__parameters: {circle.mode: paper}}\n',
        '/cell7/social_circle: {ros__parameters: {circle.mode: paper}}\n/*/*: {ros__parameters: {a: 1}}\n',
        '/cell1/social_circle: {ros__parameters: {circle.mode: paper}}\n',
        '/cell7/social_circle: {ros__parameters: {}}\n',
        'no: [yaml',
    ],
)
def test_no_other_file_is(tmp_path, text):
    path = tmp_path / 'own.yaml'
    path.write_text(text)
    assert files_for_other_nodes(['--ros-args', '--params-file', str(path)], '/cell1/social_circle') == []
