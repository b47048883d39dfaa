# SPDX-License-Identifier: Apache-2.0
"""Why no cloud arrives: publishers that cannot be heard or that are silent, and what to change."""

from collections.abc import Iterable

from rclpy.node import Node
from rclpy.qos import QoSCompatibility, QoSProfile, QoSReliabilityPolicy, qos_check_compatible
from rclpy.topic_endpoint_info import TopicEndpointInfo

UNNAMED = 'NODE_NAME_UNKNOWN'  # the middleware's answer before discovery, and for publishers without a ROS node
SILENT = (
    'Publisher {names} on {topic} has sent no cloud for {seconds:.0f} s; see that it publishes, and that its'
    ' clouds are not lost on the way: start it with FASTRTPS_DEFAULT_PROFILES_FILE={profile} (clouds over'
    ' 0.5 MB do not fit the shared memory of Fast DDS as shipped), or on another machine with {network_profile}.'
)


def complaints(
    topic: str, type_name: str, wanted: QoSProfile, publishers: Iterable[TopicEndpointInfo]
) -> list[str]:
    """One sentence for each publisher that this subscription cannot hear.

    Args:
        topic: the resolved name.
        type_name: what the subscription takes, such as sensor_msgs/msg/PointCloud2.
        wanted: the subscription's QoS.
        publishers: TopicEndpointInfo of each publisher on the topic.
    """
    sentences = []
    for publisher in publishers:
        name = node_of(publisher)
        if publisher.topic_type != type_name:
            sentences.append(
                f'Publisher {name} on {topic} sends {publisher.topic_type}, not {type_name}; remap one of them.'
            )
            continue
        compatibility, reason = qos_check_compatible(publisher.qos_profile, wanted)
        if compatibility == QoSCompatibility.ERROR:
            sentences.append(f'Publisher {name} on {topic} cannot be heard: {_mend(topic, publisher, reason)}')
    return sentences


def node_of(publisher: TopicEndpointInfo) -> str:
    """The name of the publisher's node with its namespace, once discovery has told it."""
    if UNNAMED in publisher.node_name:
        return '(of a node not yet known by name)'
    return f'{publisher.node_namespace.rstrip("/")}/{publisher.node_name}'


def _mend(topic: str, publisher: TopicEndpointInfo, reason: str) -> str:
    if publisher.qos_profile.reliability == QoSReliabilityPolicy.BEST_EFFORT:
        return (
            'it is best effort and this node asks for reliable; make the publisher reliable (best effort'
            f' loses large clouds), or start this node with qos_overrides.{topic}.subscription.reliability:'
            ' best_effort.'
        )
    return f'{reason.rstrip("; ")}; set qos_overrides.{topic}.subscription to what the publisher offers.'


def namesakes(node: Node) -> str:
    """A sentence where the graph holds several nodes with the full name of this one; else ''."""
    found = [(space, name) for name, space in node.get_node_names_and_namespaces()]
    count = found.count((node.get_namespace(), node.get_name()))
    if count < 2:
        return ''
    return (
        f'{count} nodes are named {node.get_fully_qualified_name()}: each filters the clouds and answers services;'
        ' end all but one, or start them in different namespaces.'
    )
