# SPDX-License-Identifier: Apache-2.0
"""What the node tells of a transition that failed."""

from types import SimpleNamespace

import pytest

from socialcircle_ros.node.social_circle_node import SocialCircleNode


@pytest.mark.parametrize(
    ('wrong', 'failure'),
    [
        ('', 'on_cleanup failed: OSError: no space left'),
        ('a.depth cannot be -3.', 'on_cleanup failed: a.depth cannot be -3. (OSError: no space left)'),
    ],
)
def test_a_failed_transition_is_told_with_its_exception_whatever_else_is_wrong(wrong, failure):
    logged = []
    node = SimpleNamespace(
        _live_parameters=SimpleNamespace(wrong_overrides=lambda: wrong),
        get_logger=lambda: SimpleNamespace(error=logged.append),
    )
    SocialCircleNode.transition_failed(node, 'on_cleanup', None, OSError('no space left'))
    assert node._failure == failure
    assert logged == [failure]
