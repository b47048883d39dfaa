# SPDX-License-Identifier: Apache-2.0
"""Large clouds over a network that loses packets: how many arrive, and how long that takes."""

import os
import re
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.node.transport import NETWORK_PROFILE, PROFILE
from socialcircle_ros.storage import write_file

from .live import SHAPE, Times
from .network_peers import LOST, NO_PARTNER
from .two_hosts import Host, two_hosts

LOSSES = (0.0, 0.001, 0.01)
"""Shares of the packets that are lost, in each direction."""

INTERVAL_S = 2.0
"""Time between two clouds. A cloud that has not arrived by then is replaced by the next one (keep last 1)."""

REASSEMBLY = {'net.ipv4.ipfrag_high_thresh': 134217728, 'net.ipv4.ipfrag_time': 3}
"""Settings of the receiving kernel with which lost fragments of datagrams do not fill its memory."""

_PATIENCE_S = 60.0  # for discovery and the last cloud, over the time that the clouds take
_HEARTBEATS = re.compile(r'\s*<(data_writer|data_reader) .*?</\1>', re.DOTALL)
_SMALL_DATAGRAMS = re.compile(r'\s*<maxMessageSize>.*?</maxMessageSize>')
_OWN_SETTINGS = ('FASTRTPS_', 'FASTDDS_', 'RMW_', 'ROS_DOMAIN_ID', 'ROS_LOCALHOST_ONLY', 'ROS_STATIC_PEERS')


@dataclass(frozen=True)
class Setup:
    """A way to send clouds.

    Attributes:
        name: for the table.
        publisher: text of the publisher's profile of Fast DDS; '': no profile.
        subscriber: text of the subscriber's profile; '': no profile.
        environment: variables of both processes.
        kernel: settings of the subscriber's kernel.
        both_ways: whether the subscriber publishes each cloud back, as a node does if its outputs are used on the
            publisher's host.
    """

    name: str
    publisher: str = ''
    subscriber: str = ''
    environment: Mapping[str, str] = field(default_factory=dict)
    kernel: Mapping[str, int] = field(default_factory=dict)
    both_ways: bool = False


@dataclass(frozen=True)
class Delivery:
    """What became of the clouds that were to be published.

    Attributes:
        setup: name of the way they were sent.
        loss: share of the packets that were lost.
        clouds: to be published.
        published: calls of publish() that began: fewer than `clouds` if the publisher hung, and 0 if the processes
            did not discover each other.
        reported: clouds that the subscriber's middleware reported as lost.
        hung: whether the publisher did not end by itself.
        latency: from the call of publish() to the subscriber's callback; None: no cloud arrived.
    """

    setup: str
    loss: float
    clouds: int
    published: int
    reported: int
    hung: bool
    latency: Times | None

    @property
    def arrived(self) -> int:
        """Clouds that arrived."""
        return len(self.latency.milliseconds) if self.latency else 0


def setups() -> list[Setup]:
    """The shipped profiles, and others that were tried."""
    node, network = (path.read_text(encoding='utf-8') for path in (PROFILE, NETWORK_PROFILE))
    small_datagrams, short_heartbeats = _HEARTBEATS.sub('', network), _SMALL_DATAGRAMS.sub('', network)
    asynchronous = {'RMW_FASTRTPS_PUBLICATION_MODE': 'ASYNCHRONOUS'}
    tcp = {'FASTDDS_BUILTIN_TRANSPORTS': 'LARGE_DATA'}
    return [
        Setup('no profile'),
        Setup('fastdds.xml', node, node),
        Setup('fastdds.xml, kernel settings', node, node, kernel=REASSEMBLY),
        Setup('fastdds_network.xml', network, network),
        Setup('fastdds_network.xml, subscriber fastdds.xml', network, node),
        Setup('fastdds_network.xml, both ways', network, network, both_ways=True),
        Setup('fastdds_network.xml, asynchronous', network, network, asynchronous),
        Setup('only small datagrams', small_datagrams, small_datagrams),
        Setup('only short heartbeats', short_heartbeats, short_heartbeats),
        Setup('only short heartbeats, kernel settings', short_heartbeats, short_heartbeats, kernel=REASSEMBLY),
        Setup('TCP (LARGE_DATA)', environment=tcp),
        Setup('TCP (LARGE_DATA), both ways', environment=tcp, both_ways=True),
    ]


def measure_network(clouds: int) -> Iterator[Delivery]:
    """Send clouds in every setup, over networks that lose more and more packets.

    Args:
        clouds: for each setup and loss.

    Raises:
        SocialCircleError: this machine cannot make two hosts; says what is missing.
    """
    for setup in setups():
        for loss in LOSSES:
            yield deliver(setup, loss, clouds)


def deliver(
    setup: Setup, loss: float, clouds: int, shape: tuple[int, int] = SHAPE, interval_s: float = INTERVAL_S
) -> Delivery:
    """Publish clouds of 16 bytes per point on one host, and count those that arrive on the other.

    Args:
        setup: how they are sent.
        loss: share of the packets that are lost.
        clouds: how many.
        shape: rows and columns of a cloud.
        interval_s: time between two clouds.

    Raises:
        SocialCircleError: this machine cannot make two hosts, or the publisher fails.
    """
    size = ['--clouds', str(clouds), '--rows', str(shape[0]), '--columns', str(shape[1])]
    with TemporaryDirectory() as name:
        folder = Path(name)
        subscribe = _command(folder, 'subscribe', setup.subscriber, setup.both_ways)
        publish = _command(folder, 'publish', setup.publisher, setup.both_ways)
        commands = subscribe, [*publish, *size, '--interval-s', str(interval_s)]
        with two_hosts(commands, loss, folder, _environment(setup)) as (subscriber, publisher):
            for key, value in setup.kernel.items():
                subscriber.run('sh', '-c', f'echo {value} > /proc/sys/{key.replace(".", "/")}')
            subscriber.begin()
            publisher.begin()
            hung = not _ends(publisher, clouds * interval_s + _PATIENCE_S)
            subscriber.end(5.0)
            if not hung and publisher.process.returncode not in (0, NO_PARTNER):
                raise SocialCircleError(_failure(publisher))
        return _delivery(setup, loss, clouds, publisher, subscriber, hung)


def _ends(host: Host, timeout_s: float) -> bool:
    """Wait until a command ends by itself; whether it does."""
    end_s = time.monotonic() + timeout_s
    while host.process.poll() is None:
        if time.monotonic() > end_s:
            return False
        time.sleep(0.05)
    return True


def _failure(publisher: Host) -> str:
    said = publisher.log.read_text(encoding='utf-8', errors='replace').strip().splitlines() or ['']
    return f'The publisher of the network benchmark failed: {said[-1]}'


def _command(folder: Path, program: str, profile: str, both_ways: bool) -> list[str]:
    """The command of a peer, with its profile."""
    command = [sys.executable, '-m', 'socialcircle_ros.studies.bench.network_peers', program]
    if both_ways:
        command.append('--both-ways')
    if not profile:
        return command
    path = folder / f'{program}.xml'
    write_file(path, profile)
    return ['env', f'FASTRTPS_DEFAULT_PROFILES_FILE={path}', *command]


def _environment(setup: Setup) -> dict[str, str]:
    """The variables of the two processes; settings of the user for ROS do not reach them."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith(_OWN_SETTINGS)}
    environment |= {'RMW_IMPLEMENTATION': 'rmw_fastrtps_cpp', 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET'}
    return environment | dict(setup.environment)


def _delivery(setup: Setup, loss: float, clouds: int, publisher: Host, subscriber: Host, hung: bool) -> Delivery:
    published = dict(_rows(publisher))
    rows = _rows(subscriber)
    arrived = {number: at_s for number, at_s in rows if number != LOST}
    latencies = tuple(1e3 * (at_s - published[number]) for number, at_s in arrived.items())
    return Delivery(
        setup=setup.name,
        loss=loss,
        clouds=clouds,
        published=len(published),
        reported=int(sum(count for word, count in rows if word == LOST)),
        hung=hung,
        latency=Times(latencies) if latencies else None,
    )


def _rows(host: Host) -> Sequence[tuple[str, float]]:
    """The lines that a peer printed: a cloud's number or a word, and a number."""
    lines = host.output.read_text(encoding='utf-8').splitlines()
    return [(first, float(second)) for first, second in (line.split() for line in lines)]
