# SPDX-License-Identifier: Apache-2.0
"""Two hosts on one machine, and the packets that are lost between them."""

import os
import sys
import time

import pytest

from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.studies.bench import two_hosts as module
from socialcircle_ros.studies.bench.two_hosts import ADDRESSES, two_hosts

on_two_hosts = pytest.mark.usefixtures('two_hosts_possible')

SEND = f"""
import socket, sys
sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
for _ in range(4000):
    sender.sendto(b'datagram', ('{ADDRESSES[1]}', 9))
print('sent', flush=True)
sys.stdin.read()
"""


def wait_for_output(host, word):
    while word not in host.output.read_text():
        assert host.process.poll() is None, host.log.read_text()
        time.sleep(0.01)


def packets(host, device):
    """How many packets a device of a host has received."""
    rows = [row.split() for row in host.run('cat', '/proc/net/dev').splitlines()]
    return next(int(row[2]) for row in rows if row[0] == f'{device}:')


@pytest.mark.parametrize('loss', [0.0, 0.1])
@on_two_hosts
def test_a_share_of_the_packets_is_lost(tmp_path, loss):
    sending = [sys.executable, '-c', SEND]
    with two_hosts((sending, ['cat']), loss, tmp_path, os.environ) as (first, second):
        first.begin()
        wait_for_output(first, 'sent')
        sent = packets(second, 'host2')  # fewer than 4000 if the question for the address was lost
        lost = packets(second, 'lost-end') if loss else 0
    assert sent > 0
    assert lost == pytest.approx(sent * loss, abs=6 * (sent * loss * (1 - loss)) ** 0.5)


@on_two_hosts
def test_each_host_has_a_network_and_shared_memory_of_its_own(tmp_path):
    command = ['sh', '-c', 'ls /dev/shm; cat /proc/net/dev; echo done; cat']
    with two_hosts((command, command), 0.0, tmp_path, os.environ) as hosts:
        for host in hosts:
            host.begin()
            wait_for_output(host, 'done')
        seen = [host.output.read_text() for host in hosts]
    assert ['host1:' in seen[0], 'host2:' in seen[0]] == [True, False]
    assert ['host1:' in seen[1], 'host2:' in seen[1]] == [False, True]
    assert 'fastrtps' not in seen[0] + seen[1]


@on_two_hosts
def test_the_hosts_end_with_the_block(tmp_path):
    with two_hosts((['cat'], ['cat']), 0.0, tmp_path, os.environ) as hosts:
        hosts[0].begin()
        assert [host.process.poll() for host in hosts] == [None, None]
    assert all(host.process.poll() is not None for host in hosts)


@on_two_hosts
def test_closing_its_input_asks_a_command_to_end(tmp_path):
    with two_hosts((['cat'], ['sleep', '60']), 0.0, tmp_path, os.environ) as (first, second):
        first.begin()
        second.begin()
        assert first.end(60.0)
        assert not second.end(0.1)


@on_two_hosts
def test_a_program_that_fails_is_an_error_with_its_reason(tmp_path):
    with (
        two_hosts((['cat'], ['cat']), 0.0, tmp_path, os.environ) as (first, _),
        pytest.raises(SocialCircleError, match='ip link set none up" fails: Cannot find device'),
    ):
        first.run('ip', 'link', 'set', 'none', 'up')


def make_two_hosts(folder):
    with two_hosts((['true'], ['true']), 0.0, folder, os.environ):
        pass


def test_without_root_the_reason_says_so(tmp_path, monkeypatch):
    monkeypatch.setattr(module.os, 'geteuid', lambda: 1000)
    with pytest.raises(SocialCircleError, match=r'this is not root; use sudo\.$'):
        make_two_hosts(tmp_path)


def test_without_the_programs_the_reason_names_them(tmp_path, monkeypatch):
    monkeypatch.setattr(module.os, 'geteuid', lambda: 0)
    monkeypatch.setattr(module.shutil, 'which', lambda tool: None if tool in ('ip', 'tc') else tool)
    with pytest.raises(SocialCircleError, match=r'iproute2.*: ip, tc not found\.$'):
        make_two_hosts(tmp_path)
