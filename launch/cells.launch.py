"""Several cells on one machine: a node for each, in a namespace, with its own parameter file where there is one.

ros2 launch socialcircle_ros cells.launch.py cells:=cell1,cell2 params_folder:=/etc/cells

The parameters of cell1 are those of /etc/cells/cell1.yaml; a cell without a file has the defaults.
"""

from pathlib import Path

from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction
from launch.launch_context import LaunchContext
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.substitutions import FindPackageShare

from launch import LaunchDescription


def include(context: LaunchContext) -> list[IncludeLaunchDescription]:
    """One cell for each name."""
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
            DeclareLaunchArgument('cells', default_value='cell1,cell2', description='Their names, with commas.'),
            DeclareLaunchArgument(
                'params_folder', default_value='', description='Where NAME.yaml is for a cell; empty: nowhere.'
            ),
            OpaqueFunction(function=include),
        ]
    )
