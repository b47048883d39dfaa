# SPDX-License-Identifier: Apache-2.0
"""The health of a node, from its diagnostics."""

import dataclasses

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from socialcircle_ros.clients.health import _REFUSAL_KEYS, health_of
from socialcircle_ros.interface import HealthValues

HEALTH = HealthValues(
    state='active',
    clouds_received=9,
    clouds_published=4,
    clouds_dropped=100,
    clouds_refused=2,
    clouds_failed=3,
    limits_failed=6,
    frames_received=200,
    frames_dropped=5,
    frames_lost=0,
    joint_states_dropped=0,
    clouds_lost=0,
    stack_refusals=7,
    stacks_finished=1,
    last_reason='The cloud is empty.',
    rate_hz=3.0,
)


def status(hardware_id):
    values = [KeyValue(key=key, value=value) for key, value in HEALTH.to_text().items()]
    return DiagnosticStatus(level=b'\1', message='Some clouds fail.', hardware_id=hardware_id, values=values)


def test_the_health_of_the_named_node_is_read():
    array = DiagnosticArray(status=[DiagnosticStatus(hardware_id='/other'), status('/cell/social_circle')])
    health = health_of('/cell/social_circle', array)
    assert (health.level, health.message, health.state) == (1, 'Some clouds fail.', 'active')
    assert (health.refusals, health.last_reason) == (2 + 3 + 5 + 7, 'The cloud is empty.')


def test_diagnostics_of_other_nodes_say_nothing():
    assert health_of('/cell/social_circle', DiagnosticArray(status=[status('/other')])) is None


def test_refusals_are_counted_by_keys_of_the_interface():
    assert set(_REFUSAL_KEYS) <= {each.name for each in dataclasses.fields(HealthValues)}


def test_counts_that_are_no_numbers_do_not_end_the_client():
    forged = status('/cell/social_circle')
    for pair in forged.values:
        pair.value = '9' * 5000
    assert health_of('/cell/social_circle', DiagnosticArray(status=[forged])).refusals == 0
