# SPDX-License-Identifier: Apache-2.0
"""What the diagnostics tell of the last stack."""

from socialcircle_ros.focus import Registered
from socialcircle_ros.node.health import Health


def test_the_drift_of_the_last_stack_is_shown_where_it_is_known():
    health = Health()
    values = [health.values('active', None, None, None)]
    for drift in (3.14159, 0.0, None, 2.0):
        health.stack_finished(0.1, 0.01, 2, drift)
        values.append(health.values('active', None, None, None))
    health.reset()
    values.append(health.values('active', None, None, None))
    assert [each.get('stack_drift_px') for each in values] == [None, '3.14', '0.0', None, '2.0', None]


def test_what_was_registered_is_shown_where_it_was_asked_for():
    health = Health()
    shown = []
    for registered in (Registered(3.14159, 1.0212345, 0), None):
        health.stack_finished(0.1, 0.01, 2, 3.0, registered)
        values = health.values('active', None, None, None)
        shown.append((values.get('stack_registered_px'), values.get('stack_registered_magnification')))
    assert shown == [('3.14', '1.02123'), (None, None)]
