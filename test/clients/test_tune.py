"""`socialcircle tune` with a live node: the link over ROS, and the page in a real browser."""

import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from browser import Visitor, browser
from examples import cloud

from socialcircle_ros.clients.process import NodeProcess
from socialcircle_ros.clients.remote_node import RemoteNode
from socialcircle_ros.messages.image import OUTLIER, decode_mono8
from socialcircle_ros.panel.link import ParameterKind, Presence
from socialcircle_ros.settings import PARAMETERS

pytestmark = pytest.mark.live

SCALE = 'circle.radius_scale'
BAGS = Path(__file__).resolve().parents[2] / 'bags'


class Bench:
    """A node, and a link to it."""

    def __init__(self, cell):
        self.cell = cell
        self.link = RemoteNode(cell.name)

    def until(self, condition):
        """Wait for a snapshot that meets a condition, and return it."""
        return self.cell.wait_for(lambda: (snapshot := self.link.wait(-1, 0)) and condition(snapshot) and snapshot)

    def until_active(self):
        return self.until(lambda snapshot: snapshot.presence is Presence.ACTIVE and snapshot.values)

    def start_again(self, folder, parameters):
        self.cell.node_process = NodeProcess(self.cell.namespace, folder / 'again.log', parameters)


@pytest.fixture
def bench(cell):
    bench = Bench(cell)
    yield bench
    bench.link.close()


def texts(snapshot):
    return [entry.text for entry in snapshot.log]


def test_the_parameters_have_the_descriptions_of_the_node(bench):
    snapshot = bench.until_active()
    rows = {row.name: row for row in snapshot.descriptors}
    for name, expected in PARAMETERS.items():
        row = rows[name]
        assert (row.sentence, row.unit, row.read_only) == (expected.sentence, expected.unit, expected.read_only)
        assert row.choices == expected.limits.choices
    kinds = {
        bool: ParameterKind.BOOLEAN,
        int: ParameterKind.INTEGER,
        float: ParameterKind.REAL,
        str: ParameterKind.TEXT,
        list: ParameterKind.INTEGERS,
    }
    assert {name: rows[name].kind for name in PARAMETERS} == {
        name: kinds[row.kind] for name, row in PARAMETERS.items()
    }
    assert (rows['circle.window'].low, rows['circle.window'].high, rows['circle.window'].step) == (3, 31, 2)
    assert [name for name in snapshot.values if name in PARAMETERS] == list(PARAMETERS)


def test_a_sent_cloud_is_shown_with_its_mask_and_measurement(bench):
    bench.until_active()
    assert bench.link.publish(cloud(stamp=5_000_000_007)) == ''
    shown = bench.until(lambda snapshot: snapshot.shown_cloud).shown_cloud
    assert shown.cloud == cloud(stamp=5_000_000_007)
    assert (shown.mask == OUTLIER).sum() == 26
    assert shown.numbers.outliers == 26


def test_a_cloud_of_another_publisher_is_shown(bench):
    bench.until_active()
    bench.cell.wait_for(lambda: bench.cell.clouds.get_subscription_count() == 2)
    bench.cell.publish(cloud(stamp=6_000_000_000))
    shown = bench.until(lambda snapshot: snapshot.shown_cloud).shown_cloud
    assert shown.numbers.stamp == '6.000000000'


def test_a_page_that_starts_later_shows_the_last_cloud(cell):
    cell.clean(cloud(stamp=8_000_000_000))
    bench = Bench(cell)
    try:
        shown = bench.until(lambda snapshot: snapshot.shown_cloud).shown_cloud
        assert shown.cloud == cloud(stamp=8_000_000_000)
        assert (shown.mask == OUTLIER).sum() == 26
    finally:
        bench.link.close()


def test_the_last_cloud_is_filtered_again_after_a_change(bench):
    bench.until_active()
    bench.link.publish(cloud())
    bench.until(lambda snapshot: snapshot.shown_cloud)
    assert bench.link.change({SCALE: 100, 'circle.window': 5}) == ''
    snapshot = bench.until(
        lambda snapshot: snapshot.shown_cloud.measurement.values[SCALE] == '100.0' and len(texts(snapshot)) >= 3
    )
    assert (snapshot.shown_cloud.mask == OUTLIER).sum() == snapshot.shown_cloud.numbers.outliers == 0
    assert f'{SCALE}: 1.0 → 100.0 (this page)' in texts(snapshot)


def test_a_refused_change_gives_the_reason_and_changes_nothing(bench):
    before = bench.until_active().values
    assert 'is empty; give a height' in bench.link.change({SCALE: 2.0, 'circle.vote_region': [0, 0, 5, 0]})
    assert 'not a valid step' in bench.link.change({'circle.window': 4})
    assert bench.link.wait(-1, 0).values == before


def test_a_change_made_elsewhere_is_shown_and_logged(bench):
    bench.until_active()
    bench.cell.set(circle__radius_scale=4)
    snapshot = bench.until(lambda snapshot: snapshot.values[SCALE] == 4.0)
    assert f'{SCALE}: 1.0 → 4.0 (elsewhere)' in texts(snapshot)


def test_without_masks_the_link_says_what_to_switch_on(bench):
    bench.until_active()
    bench.cell.set(output__mask=False)
    snapshot = bench.until(lambda snapshot: 'output.mask' in snapshot.sentence)
    assert snapshot.level == 1


def test_the_link_does_not_remain_a_publisher_without_messages(bench):
    bench.until_active()
    bench.link.publish(cloud())
    topic = f'{bench.cell.namespace}/points'
    bench.cell.wait_for(
        lambda: all(
            publisher.node_name != 'socialcircle_tune'
            for publisher in bench.cell.peer.get_publishers_info_by_topic(topic)
        )
    )
    assert bench.link.publish(cloud()) == ''


def test_a_restarted_node_is_found_with_its_new_values(start_cell, tmp_path):
    bench = Bench(start_cell())
    try:
        bench.until_active()
        bench.cell.kill()
        away = bench.until(lambda snapshot: snapshot.presence is not Presence.ACTIVE)
        assert away.sentence.startswith('Waiting')
        assert away.values[SCALE] == 1.0  # the last known values stay visible
        bench.start_again(tmp_path, {SCALE: '3.0'})
        back = bench.until(lambda snapshot: snapshot.presence is Presence.ACTIVE and snapshot.values[SCALE] == 3.0)
        assert 'The node no longer answers.' in texts(back)
        bench.until(lambda snapshot: 'The node was started again.' in texts(snapshot))
    finally:
        bench.link.close()


def test_the_link_waits_for_a_missing_node_and_names_the_command_that_starts_it(cell):
    with RemoteNode('/nowhere/social_circle') as link:
        snapshot = cell.wait_for(
            lambda: (found := link.wait(-1, 0)) and f'There is {cell.name}' in found.sentence and found
        )
        assert snapshot.presence is Presence.ABSENT
        assert 'socialcircle node --ros-args -r __ns:=/nowhere.' in snapshot.sentence
        assert 'is not there' in link.change({SCALE: 2.0})
        assert 'is not there' in link.save()
        assert 'Nobody but this page listens on /nowhere/points' in link.publish(cloud())


class Tuning:
    """`socialcircle tune` as its own process."""

    def __init__(self, folder, *arguments):
        command = [sys.executable, '-m', 'socialcircle_ros.commands.main', 'tune', *map(str, arguments)]
        self.process = subprocess.Popen(
            [*command, '--port', '0', '--presets', folder / 'presets'],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        self.greeting = self.process.stdout.readline()
        self.address = re.search(r'http://\S+(?=;)', self.greeting)[0]

    def listening(self):
        """Addresses on which the process accepts TCP connections, according to the kernel."""
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
        _, errors = self.process.communicate(timeout=60)
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
def test_only_the_loopback_address_is_listened_on(start_tuning):
    pytest.importorskip('viser', reason='the page needs viser')
    tuning = start_tuning('--node', '/nowhere/social_circle')
    port = int(tuning.address.rpartition(':')[2])
    assert tuning.greeting.startswith('Tuning /nowhere/social_circle at http://127.0.0.1:')
    assert tuning.listening() == [f'0100007F:{port:04X}']


def test_an_operator_tunes_a_node_that_is_killed_and_restarted(start_cell, start_tuning, tmp_path):
    with browser() as chromium:
        cell = start_cell()
        tuning = start_tuning(BAGS / 'parts.mcap', '--ros-args', '-r', f'__ns:={cell.namespace}')
        visitor = Visitor(chromium, tuning.address)
        assert visitor.sees(cell.name)
        assert visitor.sees('all 1,834 outliers')

        def outliers():
            masks = cell.inbox['outlier_mask']
            return int((decode_mono8(masks[-1]) == OUTLIER).sum()) if masks else None

        # Moving a slider changes the published mask.
        assert cell.wait_for(lambda: outliers() == 1834)
        visitor.slider('radius scale').press('End')
        cell.wait_for(lambda: outliers() == 0)
        assert cell.get(SCALE) == 100.0
        assert visitor.sees('and no outliers')
        # A bad value is refused with the reason.
        visitor.field('vote region [points]').fill('0, 0, 1000, 1000')
        assert visitor.sees('at most 40000 can vote')
        assert cell.get('circle.vote_region') == [0, 0, 0, 0]
        # A change made elsewhere moves the control.
        cell.set(circle__radius_scale=1.5)
        assert visitor.wait_until('radius scale', '1.5')
        # The page reports that the node was killed, and recovers.
        cell.kill()
        assert visitor.sees('the node has stopped answering')
        cell.node_process = NodeProcess(cell.namespace, tmp_path / 'again.log', {SCALE: '2.5'})
        assert visitor.wait_until('radius scale', '2.5')
        visitor.open_tab('Recording')
        visitor.press('next ▶')
        assert visitor.sees('Cloud 2 of 8')
        cell.wait_for(lambda: outliers() not in (None, 0))
        visitor.open_tab('Log')
        assert visitor.sees('The node was started again.')
        visitor.leave()
