# SPDX-License-Identifier: Apache-2.0
"""Starts a launch file as `ros2 launch` does, or with the stand-in if `launch` is not installed; ends with Ctrl-C.

python run.py FILE name:=value ...
"""

import contextlib
import signal
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))


def main(file, *given):
    arguments = [tuple(text.split(':=', 1)) for text in given]
    try:
        from launch.actions import IncludeLaunchDescription
        from launch.launch_description_sources import PythonLaunchDescriptionSource

        from launch import LaunchService
    except ImportError:
        return stand_in(file, arguments)
    service = LaunchService()
    source = PythonLaunchDescriptionSource(file)
    service.include_launch_description(IncludeLaunchDescription(source, launch_arguments=arguments))
    return service.run()


def stand_in(file, arguments):
    from stand_in import commands

    processes = [subprocess.Popen(command) for command in commands(file, arguments)]
    with contextlib.suppress(KeyboardInterrupt):
        for process in processes:
            process.wait()
    for process in processes:
        process.send_signal(signal.SIGINT)
    return max((process.wait() for process in processes), default=0)


if __name__ == '__main__':
    sys.exit(main(*sys.argv[1:]))
