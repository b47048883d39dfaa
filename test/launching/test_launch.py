# SPDX-License-Identifier: Apache-2.0
"""The launch files: the commands that they start, and live runs of them."""

import contextlib
import importlib.util
import os
import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from launching.stand_in import commands

TOP = Path(__file__).resolve().parents[2]
LAUNCH = TOP / 'launch'
NODE = [sys.executable, '-m', 'socialcircle_ros.node.main', '--ros-args']
DEFAULTS = str(TOP / 'config/social_circle.yaml')
POINTS = ['-r', 'points:=points']


def cell(namespace, parameters=DEFAULTS):
    return [*NODE, '-r', f'__ns:=/{namespace}', '--params-file', str(parameters), *POINTS]


def test_the_launch_file_of_one_cell_starts_a_node_in_its_namespace():
    assert commands(LAUNCH / 'social_circle.launch.py', {'namespace': 'cell1'}) == [cell('cell1')]
    given = {'params_file': 'tuned.yaml', 'points': '/camera/points'}
    (command,) = commands(LAUNCH / 'social_circle.launch.py', given)
    assert command == [*cell('', 'tuned.yaml')[:-1], 'points:=/camera/points']


def test_rviz_runs_in_the_namespace_of_the_cell():
    *_, rviz = commands(LAUNCH / 'social_circle.launch.py', {'namespace': 'cell1', 'rviz': 'true'})
    assert rviz[:2] == ['rviz2', '-d']
    assert Path(rviz[2]).is_file()
    assert rviz[3:] == ['--ros-args', '-r', '__ns:=/cell1']


def test_a_replay_starts_a_cell_and_a_player():
    given = {'recording': 'night.mcap', 'rate': '0.5', 'loop': 'true', 'params_file': 'tuned.yaml'}
    node, player = commands(LAUNCH / 'replay.launch.py', given)
    assert node == cell('replay', 'tuned.yaml')
    assert player[2:] == [
        'socialcircle_ros.commands.main', 'play', 'night.mcap', '--namespace', 'replay', '--rate', '0.5',
        '--wait', '60', '--loop',
    ]  # fmt: skip
    with pytest.raises(RuntimeError, match="Required launch argument 'recording'"):
        commands(LAUNCH / 'replay.launch.py', {})


def test_each_cell_has_its_own_parameters_or_the_defaults(tmp_path):
    (tmp_path / 'left.yaml').touch()
    given = {'cells': 'left, right', 'params_folder': str(tmp_path)}
    found = commands(LAUNCH / 'cells.launch.py', given)
    assert found == [cell('left', tmp_path / 'left.yaml'), cell('right')]
    assert commands(LAUNCH / 'cells.launch.py', {}) == [cell('cell1'), cell('cell2')]


@contextlib.contextmanager
def launched(tmp_path, file, **arguments):
    """A running launch file; Ctrl-C ends it, and its exit code must be 0."""
    given = [f'{name}:={value}' for name, value in arguments.items()]
    log = tmp_path / 'launch.log'
    with log.open('w') as output:
        command = [sys.executable, str(Path(__file__).with_name('run.py')), str(LAUNCH / file), *given]
        process = subprocess.Popen(command, stdout=output, stderr=output, start_new_session=True)
    try:
        yield SimpleNamespace(process=process, log=log)
    finally:
        # To the whole process group, as a terminal does.
        os.killpg(process.pid, signal.SIGINT)
        process.wait(60)
    assert process.returncode == 0, log.read_text()
    assert 'Traceback' not in log.read_text()


@pytest.mark.live
class TestStarted:
    @pytest.fixture(autouse=True)
    def needs_ros(self):
        pytest.importorskip('rclpy', reason='live tests need ROS 2')

    def outliers(self, namespace, launch):
        from examples import cloud

        from socialcircle_ros.clients.cloud_client import Client

        with Client(f'/{namespace}') as client:
            client.wait_for_node(launch, 180.0)
            return client.clean(cloud()).measurement.values['outliers']

    def test_one_cell_filters(self, tmp_path):
        name = f'one{os.getpid()}'
        with launched(tmp_path, 'social_circle.launch.py', namespace=name) as launch:
            assert self.outliers(name, launch) == '26'

    def test_several_cells_filter_each_with_its_own_parameters(self, tmp_path):
        left, right = f'left{os.getpid()}', f'right{os.getpid()}'
        wide = '/**:\n  ros__parameters:\n    circle.mode: paper\n    circle.radius_scale: 100.0\n'
        (tmp_path / f'{left}.yaml').write_text(wide)
        with launched(tmp_path, 'cells.launch.py', cells=f'{left},{right}', params_folder=tmp_path) as launch:
            assert (self.outliers(left, launch), self.outliers(right, launch)) == ('0', '26')

    def test_a_replay_is_filtered(self, tmp_path):
        from socialcircle_ros.recording import open_recording

        name = f'again{os.getpid()}'
        record = [sys.executable, '-m', 'socialcircle_ros.commands.main', 'record', f'/{name}/points_filtered']
        recorder = subprocess.Popen([*record, '-o', tmp_path / 'filtered.mcap'])
        parts = TOP / 'bags/parts.mcap'
        try:
            with launched(tmp_path, 'replay.launch.py', recording=parts, namespace=name) as launch:
                for _ in range(1200):
                    if 'messages played' in launch.log.read_text():
                        break
                    with contextlib.suppress(subprocess.TimeoutExpired):
                        launch.process.wait(0.1)
        finally:
            recorder.send_signal(signal.SIGINT)
            code = recorder.wait(60)
        assert code == 0
        with open_recording(tmp_path / 'filtered.mcap') as reader:
            assert reader.message_count > 0


def test_the_real_launch_package_reads_the_launch_files():
    if importlib.util.find_spec('launch_ros') is None:
        pytest.skip('launch is not installed (it is not on PyPI); the other tests use a stand-in')
    from launch.launch_description_sources import PythonLaunchDescriptionSource

    from launch import LaunchContext

    for file in LAUNCH.glob('*.launch.py'):
        description = PythonLaunchDescriptionSource(str(file)).get_launch_description(LaunchContext())
        assert description.entities
