# SPDX-License-Identifier: Apache-2.0
"""Starts one cell: the node with a parameter file, in a namespace, and RViz on request.

ros2 launch socialcircle_ros social_circle.launch.py namespace:=cell1 params_file:=tuned.yaml rviz:=true
"""

from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    """The node and its arguments."""
    share = FindPackageShare('socialcircle_ros')
    defaults = PathJoinSubstitution([share, 'config', 'social_circle.yaml'])
    return LaunchDescription(
        [
            DeclareLaunchArgument('namespace', default_value='', description='Namespace of the cell.'),
            DeclareLaunchArgument('params_file', default_value=defaults, description='Parameters of the node.'),
            DeclareLaunchArgument('points', default_value='points', description='Topic of the clouds.'),
            DeclareLaunchArgument('rviz', default_value='false', description='Whether to start RViz.'),
            Node(
                package='socialcircle_ros',
                executable='social_circle_node',
                namespace=LaunchConfiguration('namespace'),
                parameters=[LaunchConfiguration('params_file')],
                remappings=[('points', LaunchConfiguration('points'))],
                output='screen',
            ),
            Node(
                package='rviz2',
                executable='rviz2',
                # The configuration has relative topics, so RViz runs in the namespace of the cell.
                namespace=LaunchConfiguration('namespace'),
                arguments=['-d', PathJoinSubstitution([share, 'viewers', 'social_circle.rviz'])],
                condition=IfCondition(LaunchConfiguration('rviz')),
            ),
        ]
    )
