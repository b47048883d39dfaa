# SPDX-License-Identifier: Apache-2.0
"""`socialcircle node`."""

import click


@click.command(
    'node',
    context_settings={'ignore_unknown_options': True, 'help_option_names': ['-h', '--help']},
    epilog='Example: socialcircle node --ros-args -r __ns:=/cell1 --params-file config/social_circle.yaml',
)
@click.argument('ros_arguments', nargs=-1, type=click.UNPROCESSED, metavar='[--ros-args ...]')
def command(ros_arguments: tuple[str, ...]) -> None:
    """Run the filter as a ROS 2 node until Ctrl-C.

    The node filters each cloud on `points`, and publishes the filtered cloud, the outlier mask, a measurement and
    diagnostics. All arguments are passed to ROS. `ros2 run socialcircle_ros social_circle_node` does the same.
    """
    import sys

    if ros_arguments and ros_arguments[0] != '--ros-args':
        raise click.UsageError(
            f'{ros_arguments[0]!r} is not an argument of this command; arguments for ROS follow --ros-args.'
        )
    from socialcircle_ros.node.main import main

    sys.exit(main(list(ros_arguments)))
