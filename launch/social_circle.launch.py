"""One cell: the node with a parameter file, in a namespace, with what makes large clouds fast.

ros2 launch socialcircle_ros social_circle.launch.py namespace:=cell1 params_file:=tuned.yaml
"""

from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    """The node and its arguments."""
    defaults = PathJoinSubstitution([FindPackageShare('socialcircle_ros'), 'config', 'social_circle.yaml'])
    return LaunchDescription(
        [
            DeclareLaunchArgument('namespace', default_value='', description='The cell: put before every topic.'),
            DeclareLaunchArgument('params_file', default_value=defaults, description='Parameters of the node.'),
            DeclareLaunchArgument('points', default_value='points', description='The topic of the clouds.'),
            Node(
                package='socialcircle_ros',
                executable='social_circle_node',
                namespace=LaunchConfiguration('namespace'),
                parameters=[LaunchConfiguration('params_file')],
                remappings=[('points', LaunchConfiguration('points'))],
                output='screen',
            ),
        ]
    )
