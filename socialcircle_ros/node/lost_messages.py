# SPDX-License-Identifier: Apache-2.0
"""Messages that were published, but did not reach a subscription.

Two sources are put together. The publisher numbers its messages, so a gap before a message tells how many are
missing; but nothing is known while no message comes. The middleware has an event for lost messages: Fast DDS
reports messages that a newer one has replaced, but not all of them.
"""

from collections.abc import Callable

from rclpy.callback_groups import CallbackGroup
from rclpy.event_handler import (
    EventHandler,
    QoSMessageLostInfo,
    SubscriptionEventCallbacks,
    UnsupportedEventTypeError,
)

from .rclpy_internals import TakenMessage
from .transport import NETWORK_PROFILE

_MOST_PUBLISHERS = 16  # of which the last number is kept


class LostMessages(SubscriptionEventCallbacks):
    """Counts the lost messages of a subscription: its event callbacks, which also take what `listen` hands over.

    Args:
        lost: takes the number of messages that are newly known to be lost, on the executor's thread.
    """

    def __init__(self, lost: Callable[[int], None]) -> None:
        super().__init__(message_lost=self._reported)
        self._lost = lost
        self._last_numbers: dict[bytes, int] = {}
        self._missing = 0  # by the numbers, up to the last message
        self._reported_since = 0  # by the middleware, since the last message
        self._told = 0

    def arrived(self, taken: TakenMessage) -> int:
        """A message came; its publisher numbers its messages.

        Returns:
            How many messages of the publisher are known to be missing since the one before.
        """
        publisher, number = taken.publisher, taken.number
        if number is None:
            return 0
        before = self._last_numbers.pop(publisher, None)
        self._last_numbers[publisher] = number
        if len(self._last_numbers) > _MOST_PUBLISHERS:
            del self._last_numbers[next(iter(self._last_numbers))]
        # What was reported since the last message is part of a gap, unless the gap is not known.
        missing = self._reported_since if before is None else max(0, number - before - 1)
        self._missing += missing
        self._reported_since = 0
        self._tell()
        return missing

    def knows(self, publisher: bytes) -> bool:
        """Whether a message of the publisher has arrived, and its number is kept."""
        return publisher in self._last_numbers

    def create_event_handlers(
        self, callback_group: CallbackGroup, subscription: object, topic_name: str
    ) -> list[EventHandler]:
        """The handlers; rclpy calls this when the subscription is made."""
        try:
            handlers: list[EventHandler] = super().create_event_handlers(callback_group, subscription, topic_name)
        except UnsupportedEventTypeError:
            self.message_lost = None
            handlers = super().create_event_handlers(callback_group, subscription, topic_name)
        return handlers

    def _reported(self, event: QoSMessageLostInfo) -> None:
        self._reported_since += event.total_count_change
        self._tell()

    def _tell(self) -> None:
        total = self._missing + self._reported_since
        if total > self._told:
            count, self._told = total - self._told, total
            self._lost(count)


def lost_sentence(count: int, topic: str, what: str = 'cloud') -> str:
    """What to say of messages that were lost, and what to change.

    Args:
        count: of messages that were lost at once.
        topic: the resolved name.
        what: each of them is.
    """
    were = f'A {what} was' if count == 1 else f'{count} {what}s were'
    return (
        f'{were} lost on the way to {topic}: they come faster than the node takes them, or parts did not arrive'
        f' before the next {what} was published. Publish less often; if the publisher is on another machine, start'
        f' it with FASTRTPS_DEFAULT_PROFILES_FILE={NETWORK_PROFILE.name} (docs/network.md).'
    )
