# SPDX-License-Identifier: Apache-2.0
"""The node's health as a status: level, sentence and values for `/diagnostics`."""

import time
from dataclasses import dataclass

from rclpy.node import Node
from rclpy.subscription import Subscription

from socialcircle_ros.interface import STACK_FRAMES
from socialcircle_ros.messages import diagnostics
from socialcircle_ros.messages.diagnostics import Status

from .connections import SILENT, complaints, namesakes, node_of
from .health import Health
from .transport import NETWORK_PROFILE, PROFILE

_NOTICEABLE_S = 1.0  # a cloud of 1280×960 takes as long without anything being compiled


@dataclass(frozen=True)
class NodeState:
    """What the report needs to know beside the counts.

    Attributes:
        name: full name of the node.
        state: of the lifecycle.
        failure: why the last transition failed; '': it did not.
        subscriptions: with the types of their messages; that to `points` first; none while the node is not active.
        active_since_s: time of the activation, of time.monotonic().
        silence_s: time without a cloud after which diagnostics warn; 0: never.
        differences: what the installed rclpy lacks.
        busy_s: for how long the cloud or frame at hand has been worked on; at most 0: nothing is at hand.
        compiling: whether kernels are compiled.
    """

    name: str
    state: str
    failure: str
    subscriptions: tuple[tuple[Subscription, str], ...]
    active_since_s: float
    silence_s: float
    differences: str
    busy_s: float
    compiling: bool


def health_status(node: Node, now: NodeState, health: Health) -> tuple[Status, str]:
    """The status for `/diagnostics`, and the complaint about other nodes that is to be logged ('': none)."""
    listening = bool(now.subscriptions)
    topic = now.subscriptions[0][0].topic_name if listening else ''
    publishers = node.get_publishers_info_by_topic(topic) if listening else []
    frames = [heard.topic_name for heard, kind in now.subscriptions if kind == STACK_FRAMES.type]
    frames_come = any(node.get_publishers_info_by_topic(name) for name in frames)
    unheard = [
        sentence
        for heard, kind in now.subscriptions
        for sentence in complaints(
            heard.topic_name, kind, heard.qos_profile, node.get_publishers_info_by_topic(heard.topic_name)
        )
    ]
    values = health.values(
        state=now.state,
        publishers=len(publishers) if listening else None,
        connections=' '.join(unheard) if listening else None,
        differences=now.differences or None,
    )
    several = namesakes(node)
    silent_s = min(health.seconds_silent(), time.monotonic() - now.active_since_s)
    # A publisher may wait for the result of its last cloud; and where frames come, clouds need not.
    awaited = publishers and now.silence_s and now.busy_s <= 0 and (health.clouds_came() or not frames_come)
    if not listening and now.failure:
        level, message = diagnostics.ERROR, now.failure
    elif now.state == 'finalized':
        level, message = (
            diagnostics.WARN,
            'The node is shut down, and filters no more: end it, and start it again.',
        )
    elif not listening:
        level, message = diagnostics.OK, f'The node is {now.state}; it filters once it is active.'
    elif unheard:
        level, message = diagnostics.ERROR, unheard[0]
    elif health.in_trouble():
        level, message = diagnostics.ERROR, health.last_reason
    elif several:
        level, message = diagnostics.WARN, several
    elif now.compiling and now.busy_s > _NOTICEABLE_S:
        level = diagnostics.WARN
        message = (
            f'Kernels that the settings need are compiled, once; a cloud or stack has waited {now.busy_s:.0f} s.'
        )
    elif health.failed_limits():
        level, message = diagnostics.WARN, f'The last measurement failed its limits: {health.failed_limits()}'
    elif health.had_trouble():
        level, message = diagnostics.WARN, health.last_reason
    elif awaited and silent_s > now.silence_s:
        names = ', '.join(node_of(publisher) for publisher in publishers)
        level = diagnostics.WARN
        message = SILENT.format(
            names=names, topic=topic, seconds=silent_s, profile=PROFILE, network_profile=NETWORK_PROFILE.name
        )
    elif not publishers and frames_come:
        level, message = diagnostics.OK, 'Frames are measured as they come.'
    elif not publishers:
        inputs = ' or '.join([topic, *frames])
        when = 'any more' if health.counts.received or health.counts.frames_received else 'yet'
        level, message = diagnostics.OK, f'Waiting: no node publishes on {inputs} {when}.'
    else:
        level, message = diagnostics.OK, 'Clouds are filtered as they come.'
    status = Status(level, f'{now.name.strip("/")}: filter', message, now.name, values)
    return status, ' '.join([*unheard[:1], several]).strip()
