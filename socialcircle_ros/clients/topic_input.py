# SPDX-License-Identifier: Apache-2.0
"""The subscriptions of a recorded topic, which together hear every publisher of it."""

from collections import OrderedDict
from collections.abc import Callable, Sequence

from rclpy.node import Node
from rclpy.qos import QoSCompatibility, QoSProfile, qos_check_compatible
from rclpy.topic_endpoint_info import TopicEndpointInfo

from socialcircle_ros.node.lost_messages import LostMessages
from socialcircle_ros.node.rclpy_internals import MessageInput, TakenMessage, listen, take

from .qos import recording_qos

_REMEMBERED = 1000  # messages; more than publishers commonly keep for late subscribers


class TopicInput:
    """Hears all publishers of a topic, also later ones with another QoS, and hands on each message once.

    A subscription that asks for reliable messages gets none of a publisher that is best effort, as a driver may be
    after a restart. A second subscription then hears this one, and the first goes on, since nothing that it hears
    shall be lost.

    Args:
        node: the node that subscribes.
        kind: class of the messages.
        topic: its name.
        arrived: takes each message.
        lost: takes the number of messages that were published but did not arrive.
    """

    def __init__(
        self,
        node: Node,
        kind: type,
        topic: str,
        arrived: Callable[[TakenMessage], None],
        lost: Callable[[int], None],
    ) -> None:
        self._node = node
        self._kind = kind
        self._topic = topic
        self._arrived = arrived
        self._lost = lost
        self._inputs: list[tuple[MessageInput, QoSProfile, LostMessages]] = []
        self._recent: OrderedDict[tuple[bytes, int | None, int], None] = OrderedDict()

    def hear(self, publishers: Sequence[TopicEndpointInfo]) -> None:
        """Subscribe once more if there are publishers that no subscription hears."""
        unheard = [each for each in publishers if not self._is_heard(each.qos_profile)]
        if not unheard:
            return
        place, qos, lost = len(self._inputs), recording_qos(unheard), LostMessages(self._lost)
        lost.incompatible_qos = lambda _: None  # rclpy would warn that messages are lost, which `hear` prevents
        if self._inputs:
            # It does not say of which publisher, and most may be heard by another subscription.
            lost.message_lost = None
        messages = listen(
            self._node,
            self._kind,
            self._topic,
            lambda taken: self._take(taken, place),
            qos_profile=qos,
            event_callbacks=lost,
        )
        self._inputs.append((messages, qos, lost))

    def take_waiting(self) -> bool:
        """Take the next message of each subscription that has one waiting; whether there was any."""
        waiting = [(take(messages.subscription), place) for place, (messages, _, _) in enumerate(self._inputs)]
        for taken, place in waiting:
            if taken is not None:
                self._take(taken, place)
        return any(taken is not None for taken, _ in waiting)

    def _is_heard(self, offered: QoSProfile) -> bool:
        return any(qos_check_compatible(offered, qos)[0] != QoSCompatibility.ERROR for _, qos, _ in self._inputs)

    def _take(self, taken: TakenMessage, place: int) -> None:
        """Hand on a message, unless another subscription has brought it."""
        if not any(lost.knows(taken.publisher) for _, _, lost in self._inputs[:place]):
            self._inputs[place][2].arrived(taken)
        if taken.publisher:
            key = (taken.publisher, taken.number, taken.published_ns)
            if key in self._recent:
                return
            self._recent[key] = None
            if len(self._recent) > _REMEMBERED:
                self._recent.popitem(last=False)
        self._arrived(taken)
