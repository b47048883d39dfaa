# SPDX-License-Identifier: Apache-2.0
"""Clouds over a network that loses packets: a small version of the benchmark."""

import pytest

from socialcircle_ros.studies.bench.network import deliver, setups

on_two_hosts = pytest.mark.usefixtures('two_hosts_possible')

SETUPS = {setup.name: setup for setup in setups()}


def test_each_setup_has_a_name_of_its_own_and_differs_from_the_others():
    assert len(SETUPS) == len(setups())
    small, short = SETUPS['only small datagrams'].publisher, SETUPS['only short heartbeats'].publisher
    both = SETUPS['fastdds_network.xml'].publisher
    parts = ('<maxMessageSize>', '<heartbeatPeriod>', '<heartbeatResponseDelay>')
    assert [part in both for part in parts] == [True, True, True]
    assert [part in small for part in parts] == [True, False, False]
    assert [part in short for part in parts] == [False, True, True]


@pytest.mark.live
@pytest.mark.parametrize(
    'name',
    ['fastdds_network.xml, subscriber fastdds.xml', 'fastdds_network.xml, both ways'],
)
@on_two_hosts
def test_every_cloud_arrives_although_one_packet_in_a_hundred_is_lost(name):
    pytest.importorskip('rclpy')
    found = deliver(SETUPS[name], 0.01, clouds=5, shape=(240, 320), interval_s=1.0)
    assert (found.published, found.arrived, found.reported, found.hung) == (5, 5, 0, False)
    assert found.latency.least > 0


@pytest.mark.live
@on_two_hosts
def test_clouds_that_do_not_arrive_are_reported_to_the_subscriber():
    pytest.importorskip('rclpy')
    found = deliver(SETUPS['fastdds.xml'], 0.05, clouds=4, shape=(960, 1280), interval_s=1.0)
    assert found.published == 4
    assert found.arrived < 4
    assert 0 < found.reported <= 4 - found.arrived
