# SPDX-License-Identifier: Apache-2.0
"""What a node says of itself on `/diagnostics`."""

from dataclasses import dataclass

from diagnostic_msgs.msg import DiagnosticArray

_REFUSAL_KEYS = ('clouds_refused', 'clouds_failed', 'stack_refusals', 'frames_dropped')


@dataclass(frozen=True)
class NodeHealth:
    """The part of a node's diagnostics that its clients use.

    Attributes:
        level: 0 good, 1 warning, 2 error, 3 stale.
        message: one sentence.
        state: of the lifecycle.
        refusals: how many clouds, frames and stacks were refused, failed or dropped so far.
        last_reason: why the last of these was.
    """

    level: int
    message: str
    state: str
    refusals: int
    last_reason: str


def health_of(node: str, array: DiagnosticArray) -> NodeHealth | None:
    """Read the health of a node from a message on `/diagnostics`.

    Args:
        node: full name of the node.
        array: the message; it may hold the diagnostics of several nodes.

    Returns:
        None if the message does not hold the node's diagnostics.
    """
    for status in array.status:
        if status.hardware_id == node:
            values = {pair.key: pair.value for pair in status.values}
            return NodeHealth(
                level=int.from_bytes(status.level, 'little'),
                message=status.message,
                state=values.get('state', ''),
                refusals=sum(_count(values.get(key, '')) for key in _REFUSAL_KEYS),
                last_reason=values.get('last_reason', ''),
            )
    return None


def _count(text: str) -> int:
    """A count; 0 for a text that is none, because any participant of the graph can send diagnostics."""
    try:
        return int(text)
    except ValueError:
        return 0
