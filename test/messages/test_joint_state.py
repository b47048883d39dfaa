# SPDX-License-Identifier: Apache-2.0
"""Stage positions."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.messages.header import Header
from socialcircle_ros.messages.joint_state import JointState
from socialcircle_ros.recording import schema_text

generate_dynamic = pytest.importorskip('mcap_ros2._dynamic', reason='needs mcap-ros2-support').generate_dynamic

DECODE = generate_dynamic('sensor_msgs/JointState', schema_text('sensor_msgs/msg/JointState'))[
    'sensor_msgs/JointState'
]


@given(st.lists(st.text('abc_é', max_size=9), max_size=4), st.lists(st.floats(allow_nan=False), max_size=4))
def test_an_encoded_joint_state_is_decoded_by_another_library_and_read_back(names, positions):
    state = JointState(Header(3, 4, 'stage'), names, positions)
    other = DECODE(state.encode())
    assert (list(other.name), list(other.position), list(other.velocity)) == (names, positions, [])
    assert JointState.decode(state.encode()) == state
