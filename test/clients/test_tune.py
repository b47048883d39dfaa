# SPDX-License-Identifier: Apache-2.0
"""`socialcircle tune` beside a live node, with the page in a real browser."""

import re
import signal
import subprocess
import sys
from pathlib import Path
from urllib.error import HTTPError
from urllib.parse import urlsplit
from urllib.request import urlopen

import pytest
from browser import Visitor, browser
from forked import ForkedNode
from launching.stand_in import commands

from socialcircle_ros import interface
from socialcircle_ros.clients.remote_node import RemoteNode
from socialcircle_ros.messages.image import OUTLIER, decode_mono8

pytestmark = pytest.mark.live

SCALE = 'circle.radius_scale'
TOP = Path(__file__).resolve().parents[2]
BAGS = TOP / 'bags'


class Tuning:
    """`socialcircle tune` as its own process."""

    def __init__(self, folder, *arguments):
        command = [sys.executable, '-m', 'socialcircle_ros.commands.main', 'tune', *map(str, arguments)]
        self.process = subprocess.Popen(
            [*command, '--port', '0', '--presets', folder / 'presets'],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        self.greeting = self.process.stdout.readline()
        self.address = re.search(r'http://\S+', self.greeting)[0]  # as a terminal marks it

    def listening(self):
        """Addresses on which the process accepts TCP connections, from /proc."""
        inodes = set()
        for link in Path(f'/proc/{self.process.pid}/fd').iterdir():
            inodes.add(str(link.readlink()).removeprefix('socket:[').removesuffix(']'))
        rows = [
            line.split()
            for name in ('tcp', 'tcp6')
            for line in Path(f'/proc/{self.process.pid}/net/{name}').read_text().splitlines()[1:]
        ]
        return [row[1] for row in rows if row[3] == '0A' and row[9] in inodes]

    def close(self):
        self.process.send_signal(signal.SIGINT)
        _, errors = self.process.communicate(timeout=300)
        assert self.process.returncode == 0, errors
        assert 'Traceback' not in errors


@pytest.fixture
def start_tuning(tmp_path):
    started = []

    def start(*arguments):
        started.append(Tuning(tmp_path, *arguments))
        return started[-1]

    yield start
    for tuning in started:
        tuning.close()


@pytest.mark.skipif(sys.platform != 'linux', reason='reads /proc')
def test_the_page_listens_on_the_loopback_interface_only(start_tuning):
    pytest.importorskip('viser', reason='the page needs viser')
    tuning = start_tuning('--node', '/nowhere/social_circle')
    port = urlsplit(tuning.address).port
    assert tuning.greeting.startswith('Tuning /nowhere/social_circle at http://127.0.0.1:')
    assert tuning.listening() == [f'0100007F:{port:04X}']
    with pytest.raises(HTTPError, match='403'):
        urlopen(f'http://127.0.0.1:{port}/')
    with urlopen(tuning.address) as page:  # noqa: S310 - the command printed it
        assert b'<title>Social circle</title>' in page.read()


@pytest.mark.long
def test_an_operator_tunes_a_node_that_is_killed_and_started_again(start_cell, start_tuning, tmp_path):
    with browser() as chromium:
        cell = start_cell({'circle.mode': 'paper'})
        tuning = start_tuning(BAGS / 'parts.mcap', '--ros-args', '-r', f'__ns:={cell.namespace}')
        visitor = Visitor(chromium, tuning.address)
        assert visitor.sees(cell.name)
        assert visitor.sees('all 1,834 outliers')

        def outliers():
            masks = cell.inbox[interface.MASK.name]
            return int((decode_mono8(masks[-1]) == OUTLIER).sum()) if masks else None

        # A moved slider changes the mask that the node publishes.
        assert cell.wait_for(lambda: outliers() == 1834)
        visitor.slider('radius scale').press('End')
        cell.wait_for(lambda: outliers() == 0)
        assert cell.get(SCALE) == 100.0
        assert visitor.sees('and no outliers')
        # A refused value shows the reason.
        visitor.field('vote region [points]').fill('0, 0, 1000, 1000')
        assert visitor.sees('at most 40000 can vote')
        assert cell.get('circle.vote_region') == [0, 0, 0, 0]
        # A change made elsewhere moves the control.
        cell.set(circle__radius_scale=1.5)
        assert visitor.wait_until('radius scale', '1.5')
        # The page shows that the node is killed, and recovers when it is started again.
        cell.kill()
        assert visitor.sees('the node has stopped answering')
        cell.node_process = ForkedNode(
            cell.namespace, tmp_path / 'again.log', {SCALE: '2.5', 'circle.mode': 'paper'}
        )
        assert visitor.wait_until('radius scale', '2.5')
        # The settings that the node had are restored.
        visitor.press('Restore these settings')
        assert visitor.wait_until('radius scale', '1.5')
        cell.wait_for(lambda: cell.get(SCALE) == 1.5)
        visitor.open_tab('Recording')
        visitor.press('next ▶')
        assert visitor.sees('Cloud 2 of 8')
        cell.wait_for(lambda: outliers() not in (None, 0))
        visitor.open_tab('Log')
        assert visitor.sees('The node was started again.')
        visitor.leave()


@pytest.mark.long
def test_an_integrator_tunes_on_a_recording_of_frames_and_launches_the_cell_with_what_was_saved(
    start_cell, start_tuning, tmp_path
):
    with browser() as chromium:
        saved = tmp_path / 'tuned.yaml'
        cell = start_cell({'circle.mode': 'paper', 'parameters_file': str(saved)})
        tuning = start_tuning(BAGS / 'stack.mcap')  # it finds the node
        visitor = Visitor(chromium, tuning.address, tab='Recording')
        visitor.open_tab('Recording')
        assert visitor.sees('stack.pitch_x is not set')
        told = tuning.greeting
        while not told.startswith('Tuning'):  # the page was there before the graph named the node
            told = tuning.process.stdout.readline()
        assert told.startswith(f'Tuning {cell.name} at http://127.0.0.1:')
        visitor.press('Load stack.yaml into the node, and open')
        assert visitor.sees('Stack 1 of 1 of stack.mcap')
        assert visitor.sees('Cloud 1 of 1 of stack.mcap')  # the node has measured its frames
        assert visitor.sees('height of kept points [µm]')
        visitor.open_tab('Tune')
        visitor.field('radius scale').fill('2,5')
        cell.wait_for(lambda: cell.get(SCALE) == 2.5)
        visitor.open_tab('Presets')
        visitor.press('Save parameters at the node')
        cell.wait_for(saved.exists)
        given = {'namespace': f'{cell.namespace[1:]}_launched', 'params_file': str(saved)}
        (command,) = commands(TOP / 'launch/social_circle.launch.py', given)
        launched = subprocess.Popen(command)
        try:
            with RemoteNode(f'/{given["namespace"]}/{interface.NODE_NAME}') as link:
                values = cell.wait_for(lambda: link.wait(-1, 0).values)
            assert values[SCALE] == 2.5
            assert values['stack.frames'] == 32
        finally:
            launched.send_signal(signal.SIGINT)
            launched.wait()
        visitor.leave()
