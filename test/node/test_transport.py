# SPDX-License-Identifier: Apache-2.0
"""The profiles of Fast DDS that come with the package."""

import importlib.metadata
import os
import re
import subprocess
import sys

import pytest

from socialcircle_ros.node.transport import NETWORK_PROFILE, PROFILE, use_large_segment

FAST_DDS_3 = NETWORK_PROFILE.with_name('fastdds3_network.xml')

PROGRAM = 'import rclpy, rclpy.node; rclpy.init(); rclpy.node.Node("profile"); rclpy.shutdown()'


def complaints_about(profile):
    """What Fast DDS prints when it starts with a profile; it ignores a file that it cannot use."""
    environment = os.environ | {'FASTRTPS_DEFAULT_PROFILES_FILE': str(profile)}
    command = [sys.executable, '-c', PROGRAM]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=True)
    return done.stdout + done.stderr


def test_fast_dds_accepts_the_profile():
    assert 'XML' not in complaints_about(PROFILE)


def test_fast_dds_accepts_one_profile_for_networks():
    accepted = [path for path in (NETWORK_PROFILE, FAST_DDS_3) if 'XML' not in complaints_about(path)]
    assert len(accepted) == 1


def test_the_profiles_for_networks_differ_in_names_only():
    def plain(path):
        text = re.sub(r'<!--.*?-->', '', path.read_text(), flags=re.DOTALL)
        return text.replace('_', '').lower()

    assert plain(NETWORK_PROFILE) == plain(FAST_DDS_3)


def test_fast_dds_complains_about_a_profile_that_it_cannot_use(tmp_path):
    wrong = tmp_path / 'wrong.xml'
    wrong.write_text(NETWORK_PROFILE.read_text().replace('heartbeatPeriod', 'heartbeats'))
    assert 'XML' in complaints_about(wrong)


FRAGMENT = 64_000  # bytes, about


@pytest.mark.parametrize(
    ('given', 'version', 'expected'),
    [
        ({}, '7.1.5', [str(PROFILE), None]),
        ({}, '9.1.2', [None, str(PROFILE)]),
        ({}, 'unknown', [str(PROFILE), None]),
        ({'RMW_IMPLEMENTATION': 'rmw_cyclonedds_cpp'}, '7.1.5', [None, None]),
        ({'FASTRTPS_DEFAULT_PROFILES_FILE': 'mine.xml'}, '9.1.2', ['mine.xml', None]),
        ({'FASTDDS_DEFAULT_PROFILES_FILE': 'mine.xml'}, '7.1.5', [None, 'mine.xml']),
        ({'FASTDDS_BUILTIN_TRANSPORTS': 'UDPv4'}, '7.1.5', [None, None]),
    ],
)
def test_the_profile_is_set_for_jazzy_or_kilted_unless_a_person_has_chosen(given, version, expected, monkeypatch):
    monkeypatch.setattr(os, 'environ', dict(given))
    monkeypatch.setattr(importlib.metadata, 'version', lambda name: version)
    use_large_segment()
    variables = ('FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE')
    assert [os.environ.get(name) for name in variables] == expected


@pytest.mark.parametrize('profile', [PROFILE, NETWORK_PROFILE, FAST_DDS_3])
def test_all_profiles_have_the_same_shared_memory_and_a_queue_for_all_fragments_in_it(profile):
    text = profile.read_text()
    segment, queue = (
        int(re.search(f'<{name}>([0-9]+)<', text).group(1)) for name in ('segment_size', 'port_queue_capacity')
    )
    assert segment == 64 << 20
    assert queue * FRAGMENT > segment
