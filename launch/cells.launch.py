# SPDX-License-Identifier: Apache-2.0
"""Starts several cells on one machine: one node per cell, in the namespace of the cell.

ros2 launch socialcircle_ros cells.launch.py cells:=cell1,cell2 params_folder:=/etc/cells

The node of cell1 gets the parameters of /etc/cells/cell1.yaml, or the defaults if that file does not exist.
"""

from pathlib import Path

from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction
from launch.launch_context import LaunchContext
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.substitutions import FindPackageShare

from launch import LaunchDescription


def include(context: LaunchContext) -> list[IncludeLaunchDescription]:
    """The launch files of the cells."""
    share = FindPackageShare('socialcircle_ros')
    cell = PathJoinSubstitution([share, 'launch', 'social_circle.launch.py'])
    names = [name.strip() for name in LaunchConfiguration('cells').perform(context).split(',')]
    folder = LaunchConfiguration('params_folder').perform(context)
    included = []
    for name in filter(None, names):
        own = Path(folder) / f'{name}.yaml'
        defaults = PathJoinSubstitution([share, 'config', 'social_circle.yaml'])
        parameters = str(own) if folder and own.is_file() else defaults
        arguments = [('namespace', name), ('params_file', parameters)]
        included.append(IncludeLaunchDescription(PythonLaunchDescriptionSource(cell), launch_arguments=arguments))
    return included


def generate_launch_description() -> LaunchDescription:
    """The cells and their arguments."""
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'cells', default_value='cell1,cell2', description='Names of the cells, with commas.'
            ),
            DeclareLaunchArgument(
                'params_folder', default_value='', description='Folder with NAME.yaml for a cell; empty: none.'
            ),
            OpaqueFunction(function=include),
        ]
    )
