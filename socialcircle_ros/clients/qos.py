# SPDX-License-Identifier: Apache-2.0
"""QoS profiles between rclpy and the YAML text in which rosbag2 records them."""

from collections.abc import Sequence
from enum import IntEnum
from typing import TypedDict, cast

import yaml
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, HistoryPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

from socialcircle_ros.settings.plain_yaml import load_plain_yaml

_DEFAULT_DEPTH = 10
RECORDING_DEPTH = 100
"""Messages of a topic that may wait until a recorder takes them."""


class _RecordedProfile(TypedDict):
    """The keys of a profile, in the order in which rosbag2 writes them."""

    history: str
    depth: int
    reliability: str
    durability: str
    deadline: dict[str, int]
    lifespan: dict[str, int]
    liveliness: str
    liveliness_lease_duration: dict[str, int]
    avoid_ros_namespace_conventions: bool


def reliable(depth: int = 1) -> QoSProfile:
    """The QoS of the node's topics: reliable, volatile, keep last `depth`."""
    return QoSProfile(depth=depth, reliability=ReliabilityPolicy.RELIABLE)


def replay_qos(recorded: str) -> QoSProfile:
    """The QoS with which a recorded topic is played.

    History, depth, reliability and durability are those of the first recorded profile. Deadline, lifespan and
    liveliness keep their defaults, because a replay may run at another rate.

    Args:
        recorded: `offered_qos_profiles` as rosbag2 writes it. Empty or unreadable text gives reliable, keep last
            10.
    """
    try:
        offered = cast('list[dict[str, str]]', load_plain_yaml(recorded))[0]  # another type raises
        reliability = _policy(offered['reliability'], ReliabilityPolicy, ReliabilityPolicy.RELIABLE)
        durability = _policy(offered['durability'], DurabilityPolicy, DurabilityPolicy.VOLATILE)
        history = _policy(offered['history'], HistoryPolicy, HistoryPolicy.KEEP_LAST)
        depth = int(offered['depth'])
    except (KeyError, IndexError, TypeError, ValueError):
        return reliable(_DEFAULT_DEPTH)
    return QoSProfile(history=history, depth=max(depth, 1), reliability=reliability, durability=durability)


def recording_qos(publishers: Sequence[TopicEndpointInfo]) -> QoSProfile:
    """The strictest QoS that is compatible with all publishers of a topic."""
    profiles = [publisher.qos_profile for publisher in publishers]
    all_reliable = all(profile.reliability == ReliabilityPolicy.RELIABLE for profile in profiles)
    all_latched = all(profile.durability == DurabilityPolicy.TRANSIENT_LOCAL for profile in profiles)
    return QoSProfile(
        depth=RECORDING_DEPTH,
        reliability=ReliabilityPolicy.RELIABLE if all_reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if all_latched else DurabilityPolicy.VOLATILE,
    )


def recorded_text(publishers: Sequence[TopicEndpointInfo]) -> str:
    """What the publishers of a topic offer, as the YAML of rosbag2."""
    profiles = [dict(_recorded_profile(publisher.qos_profile)) for publisher in publishers]
    return yaml.safe_dump(profiles, sort_keys=False)


def _policy(value: str | int, policies: type[IntEnum], default: IntEnum) -> IntEnum:
    """Read a recorded policy; older recordings hold its number. A policy that leaves the choice open is `default`.

    Raises:
        KeyError: no policy has that name.
        ValueError: no policy has that number.
    """
    name = policies(value).name if isinstance(value, int) else str(value).upper()
    return default if name in ('SYSTEM_DEFAULT', 'UNKNOWN', 'BEST_AVAILABLE') else policies[name]


def _recorded_profile(profile: QoSProfile) -> _RecordedProfile:
    # The graph does not tell history and depth; rosbag2 writes `unknown` and 0 too.
    history, liveliness = profile.history, profile.liveliness
    known = history in (HistoryPolicy.KEEP_LAST, HistoryPolicy.KEEP_ALL)
    return {
        'history': history.name.lower() if known else 'unknown',
        'depth': profile.depth,
        'reliability': profile.reliability.name.lower(),
        'durability': profile.durability.name.lower(),
        'deadline': _seconds_and_nanoseconds(profile.deadline),
        'lifespan': _seconds_and_nanoseconds(profile.lifespan),
        'liveliness': liveliness.name.lower() if isinstance(liveliness, LivelinessPolicy) else 'automatic',
        'liveliness_lease_duration': _seconds_and_nanoseconds(profile.liveliness_lease_duration),
        'avoid_ros_namespace_conventions': profile.avoid_ros_namespace_conventions,
    }


def _seconds_and_nanoseconds(duration: Duration) -> dict[str, int]:
    seconds, nanoseconds = divmod(duration.nanoseconds, 1_000_000_000)
    return {'sec': seconds, 'nsec': nanoseconds}
