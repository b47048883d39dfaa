# SPDX-License-Identifier: Apache-2.0
"""Starts a cell and plays a recording into it. The node keeps running at the end, for tuning on the last cloud.

ros2 launch socialcircle_ros replay.launch.py recording:=night.mcap rate:=0.5 loop:=true rviz:=true
"""

from launch.actions import DeclareLaunchArgument, ExecuteProcess, IncludeLaunchDescription, OpaqueFunction
from launch.launch_context import LaunchContext
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.substitutions import ExecutableInPackage, FindPackageShare

from launch import LaunchDescription

PASSED_ON = ('namespace', 'params_file', 'rviz')


def play(context: LaunchContext) -> list[ExecuteProcess]:
    """The player, with the given arguments."""
    given = {
        name: LaunchConfiguration(name).perform(context) for name in ('recording', 'namespace', 'rate', 'loop')
    }
    options = ['--namespace', given['namespace'], '--rate', given['rate'], '--wait', '60']
    if given['loop'].lower() in ('true', '1'):
        options.append('--loop')
    player = ExecutableInPackage(package='socialcircle_ros', executable='socialcircle')
    return [ExecuteProcess(cmd=[player, 'play', given['recording'], *options], output='screen')]


def generate_launch_description() -> LaunchDescription:
    """The cell, the player and their arguments."""
    share = FindPackageShare('socialcircle_ros')
    cell = PathJoinSubstitution([share, 'launch', 'social_circle.launch.py'])
    defaults = PathJoinSubstitution([share, 'config', 'social_circle.yaml'])
    return LaunchDescription(
        [
            DeclareLaunchArgument('recording', description='An MCAP file or a rosbag2 directory.'),
            DeclareLaunchArgument('namespace', default_value='replay', description='Namespace of the cell.'),
            DeclareLaunchArgument('params_file', default_value=defaults, description='Parameters of the node.'),
            DeclareLaunchArgument('rviz', default_value='false', description='Whether to start RViz.'),
            DeclareLaunchArgument(
                'rate', default_value='1.0', description='Speed; 2.0 is twice as fast as recorded.'
            ),
            DeclareLaunchArgument('loop', default_value='false', description='Whether to repeat the recording.'),
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(cell),
                launch_arguments=[(name, LaunchConfiguration(name)) for name in PASSED_ON],
            ),
            OpaqueFunction(function=play),
        ]
    )
