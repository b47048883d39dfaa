"""Messages that the middleware gave up: they were published, but did not arrive whole before the next one."""

from collections.abc import Callable

from rclpy.callback_groups import CallbackGroup
from rclpy.event_handler import EventHandler, SubscriptionEventCallbacks, UnsupportedEventTypeError

from .transport import NETWORK_PROFILE


class LostMessages(SubscriptionEventCallbacks):
    """Event callbacks of a subscription that report lost messages, if the middleware has that event.

    Args:
        lost: takes the number of messages that were lost since the last call, on the executor's thread.
    """

    def __init__(self, lost: Callable[[int], None]) -> None:
        super().__init__(message_lost=lambda status: lost(status.total_count_change))

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


def lost_sentence(count: int, topic: str) -> str:
    """What to say of clouds that were lost, and what to change.

    Args:
        count: of clouds that were lost at once.
        topic: the resolved name.
    """
    clouds = 'A cloud was' if count == 1 else f'{count} clouds were'
    return (
        f'{clouds} lost on the way to {topic}: parts did not arrive before the next cloud was published. If the'
        f' publisher is on another machine, start it with FASTRTPS_DEFAULT_PROFILES_FILE={NETWORK_PROFILE.name}'
        ' (docs/network.md), or publish less often.'
    )
