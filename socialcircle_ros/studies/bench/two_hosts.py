# SPDX-License-Identifier: Apache-2.0
"""Two hosts on one machine, joined by a network that loses packets.

A host is a process with a network and a /dev/shm of its own, which `unshare` starts. Its network ends with it, so
nothing is left behind. A pair of virtual Ethernet devices joins the hosts. Each end drops packets at random when
they arrive. A packet has at most 1500 bytes, so a datagram is lost with any of its packets, as on a real network.

The kernel's own `netem` is not used, because many kernels do not have it. Instead a filter of two instructions
draws a random number, and redirects the packet to a device without an address if the number is small.
"""

import os
import shutil
import subprocess
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.storage import open_in_place

ADDRESSES = ('10.77.0.1', '10.77.0.2')
"""IPv4 addresses of the two hosts."""

_TOOLS = ('ip', 'tc', 'unshare', 'nsenter')
_NEEDS = (
    'Two hosts on one machine need root, and on Linux the programs ip and tc (Debian package iproute2), unshare'
    ' and nsenter (util-linux): {lack}.'
)
_START = 'mount -t tmpfs tmpfs /dev/shm && read -r go && exec "$@"'
_PATIENCE_S = 10.0

# Classic BPF: load a random number of 32 bits (SKF_AD_OFF + SKF_AD_RANDOM); unless it is at least {0}, match.
_LOSE = '4,32 0 0 4294963256,53 1 0 {0},6 0 0 4294967295,6 0 0 0'
_RANDOM_RANGE = 2**32


class Host:
    """A process on a host of its own, which ends with it.

    Args:
        name: of the log files.
        command: what runs on the host, once `begin` is called.
        folder: `NAME.out` and `NAME.log` in it get its output and its errors.
        environment: replaces the variables of this process.

    Raises:
        SocialCircleError: this machine cannot make it.
    """

    def __init__(self, name: str, command: Sequence[str], folder: Path, environment: Mapping[str, str]) -> None:
        self.output, self.log = folder / f'{name}.out', folder / f'{name}.log'
        start = ('unshare', '--net', '--mount', 'sh', '-c', _START, 'sh', *command)
        read_end, self._write_end = os.pipe()
        with open_in_place(self.output) as output, open_in_place(self.log) as log:
            self.process = subprocess.Popen(  # noqa: S603
                start, stdin=read_end, stdout=output, stderr=log, env=dict(environment)
            )
        os.close(read_end)
        self._wait_for_own_network()

    def run(self, *command: str) -> str:
        """Run a program in the host's network; gives its output.

        Raises:
            SocialCircleError: it fails.
        """
        return _run('nsenter', f'--net=/proc/{self.process.pid}/ns/net', *command)

    def begin(self) -> None:
        """Start the command."""
        os.write(self._write_end, b'\n')

    def end(self, timeout_s: float) -> bool:
        """Close the standard input of the command, which asks it to end; False: it had to be killed."""
        if self._write_end >= 0:
            os.close(self._write_end)
            self._write_end = -1
        try:
            self.process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            return False
        return True

    def _wait_for_own_network(self) -> None:
        end_s = time.monotonic() + _PATIENCE_S
        while not self._has_own_network():
            if self.process.poll() is not None or time.monotonic() > end_s:
                self.end(0.0)
                said = self.log.read_text(encoding='utf-8', errors='replace').strip()
                raise SocialCircleError(_NEEDS.format(lack=said or 'unshare makes no network'))
            time.sleep(0.005)

    def _has_own_network(self) -> bool:
        try:
            return Path(f'/proc/{self.process.pid}/ns/net').readlink() != Path('/proc/self/ns/net').readlink()
        except OSError:  # it has ended
            return False


def _run(*command: str) -> str:
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603
    except OSError as error:
        raise SocialCircleError(_NEEDS.format(lack=f'{command[0]}: {error.strerror}')) from None
    if done.returncode:
        said = (done.stderr.strip().splitlines() or [f'exit code {done.returncode}'])[0]
        raise SocialCircleError(_NEEDS.format(lack=f'"{" ".join(command)}" fails: {said}'))
    return done.stdout


@contextmanager
def two_hosts(
    commands: tuple[Sequence[str], Sequence[str]], loss: float, folder: Path, environment: Mapping[str, str]
) -> Iterator[tuple[Host, Host]]:
    """Two joined hosts with commands that wait for `Host.begin`; the hosts end with the block.

    Args:
        commands: what runs on the hosts.
        loss: share of the packets that are lost, in each direction.
        folder: gets the output of the commands, as `host1.out` and `host2.out`, and their errors.
        environment: variables of the commands.

    Raises:
        SocialCircleError: this machine cannot make them; says what is missing.
    """
    if os.geteuid() != 0:
        raise SocialCircleError(_NEEDS.format(lack='this is not root; use sudo'))
    missing = [tool for tool in _TOOLS if shutil.which(tool) is None]
    if missing:
        raise SocialCircleError(_NEEDS.format(lack=f'{", ".join(missing)} not found'))
    hosts: list[Host] = []
    try:
        for number, command in enumerate(commands, 1):
            hosts.append(Host(f'host{number}', command, folder, environment))
        first, second = hosts
        _join(first, second, loss)
        yield first, second
    finally:
        for host in hosts:
            host.end(0.0)


def _join(first: Host, second: Host, loss: float) -> None:
    ends = ('netns', str(first.process.pid)), ('netns', str(second.process.pid))
    _run('ip', 'link', 'add', 'host1', *ends[0], 'type', 'veth', 'peer', 'name', 'host2', *ends[1])
    for host, device, address in zip((first, second), ('host1', 'host2'), ADDRESSES, strict=True):
        host.run('ip', 'link', 'set', 'lo', 'up')
        host.run('ip', 'address', 'add', f'{address}/24', 'dev', device)
        # Without this a packet of TCP is as long as 64 kB here, and is lost as one.
        host.run('ip', 'link', 'set', device, 'gso_max_segs', '1', 'up')
        if loss:
            _lose(host, device, loss)
    for host, device in zip((first, second), ('host1', 'host2'), strict=True):
        _wait_until_up(host, device)


def _lose(host: Host, device: str, loss: float) -> None:
    """Drop arriving packets at random."""
    host.run('ip', 'link', 'add', 'lost', 'type', 'veth', 'peer', 'name', 'lost-end')
    host.run('ip', 'link', 'set', 'lost', 'up')
    host.run('ip', 'link', 'set', 'lost-end', 'up')
    host.run('tc', 'qdisc', 'add', 'dev', device, 'clsact')
    program = _LOSE.format(min(round(loss * _RANDOM_RANGE), _RANDOM_RANGE - 1))
    drop = ('action', 'mirred', 'egress', 'redirect', 'dev', 'lost')
    host.run('tc', 'filter', 'add', 'dev', device, 'ingress', 'bpf', 'bytecode', program, *drop)


def _wait_until_up(host: Host, device: str) -> None:
    """Wait for the link: Fast DDS ignores a network that is down when it starts."""
    end_s = time.monotonic() + _PATIENCE_S
    while 'state UP' not in host.run('ip', 'link', 'show', 'dev', device):
        if time.monotonic() > end_s:
            raise SocialCircleError(_NEEDS.format(lack='the link between them stays down'))
        time.sleep(0.01)
