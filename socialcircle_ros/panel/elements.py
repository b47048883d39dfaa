# SPDX-License-Identifier: Apache-2.0
"""Helpers for viser's elements: react to a choice, set a value, name an icon."""

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar, cast

from socialcircle_ros.errors import printable
from socialcircle_ros.settings import RosValue

if TYPE_CHECKING:
    import viser

PRODUCT = 'Social circle'
"""Title of the page in the browser, of its panel and of its notifications."""

Value = TypeVar('Value', bool, int, float, str)


def on_choice(element: 'viser.GuiInputHandle[Value]', call: Callable[[Value], None]) -> None:
    """Call a function with each value that a visitor chooses; values that the page sets itself are ignored."""

    def updated(event: 'viser.GuiEvent[viser.GuiInputHandle[Value]]') -> None:
        if event.client_id is not None:
            call(event.target.value)

    element.on_update(updated)


def set_value(element: 'viser.GuiInputHandle[Value]', value: RosValue) -> None:
    """Show a value in every browser; viser converts it to the type of the element."""
    # printable: a text with surrogates, such as a file name that is not UTF-8, would end each connection.
    # viser defines a method between getter and setter, so that mypy takes the property for read-only.
    element.value = printable(value) if isinstance(value, str) else value  # type: ignore[misc, assignment]


def icon(name: str) -> 'viser.IconName':
    """An icon of Tabler by its name; `viser.Icon` would need viser when this room is imported."""
    return cast('viser.IconName', name)
