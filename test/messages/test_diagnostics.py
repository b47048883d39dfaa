# SPDX-License-Identifier: Apache-2.0
"""DiagnosticStatus."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.messages.diagnostics import WARN, Status
from socialcircle_ros.recording import schema_text

generate_dynamic = pytest.importorskip('mcap_ros2._dynamic', reason='needs mcap-ros2-support').generate_dynamic

DECODE = generate_dynamic('diagnostic_msgs/DiagnosticStatus', schema_text('diagnostic_msgs/msg/DiagnosticStatus'))[
    'diagnostic_msgs/DiagnosticStatus'
]

TEXT = st.text(st.characters(exclude_characters='\0', exclude_categories=['Cs']))


@given(TEXT, TEXT, TEXT, st.dictionaries(TEXT, TEXT))
def test_an_encoded_status_is_decoded_by_another_library_and_read_back(name, message, hardware, values):
    status = Status(WARN, name, message, hardware, values)
    encoded = status.encode()
    other = DECODE(encoded)
    assert (other.name, other.message, other.hardware_id) == (name, message, hardware)
    assert {pair.key: pair.value for pair in other.values} == values
    assert Status.decode(encoded) == status
