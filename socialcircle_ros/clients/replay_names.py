# SPDX-License-Identifier: Apache-2.0
"""The names under which the topics of a recording are played."""

from collections.abc import Collection

from rclpy.exceptions import InvalidNamespaceException
from rclpy.validate_namespace import validate_namespace

from socialcircle_ros.errors import RecordingError, SettingError
from socialcircle_ros.interface import FILTERED, MEASUREMENT, POINTS, STACK_FRAMES, STACK_POINTS

# Not the masks: truth/outlier_mask belongs to the namespace above.
_OF_A_CELL = (POINTS, STACK_FRAMES, STACK_POINTS, FILTERED, MEASUREMENT)


def topic_prefix(namespace: str) -> str:
    """The prefix that puts topics into a namespace: '' for the root, `/cell1` for `cell1`.

    Raises:
        SettingError: ROS does not allow such a namespace.
    """
    stripped = namespace.strip('/')
    prefix = f'/{stripped}' if stripped else ''
    try:
        validate_namespace(prefix or '/')
    except InvalidNamespaceException:
        raise SettingError(
            f'{namespace!r} is not a valid namespace: use letters, digits, _ and /, and no digit at the start.'
        ) from None
    return prefix


def names_in_namespace(topics: Collection[str], prefix: str) -> dict[str, str]:
    """The names under which recorded topics are played in a namespace.

    Where the topics are those of one cell, the namespace takes the place of that of the cell. It is put before
    names outside of the cell, such as /tf, so that no node beside the replay hears them. Where the recording has
    no cell, or several, it is put before all names, which keeps the cells apart.

    Args:
        topics: names as recorded.
        prefix: of the namespace; see `topic_prefix`.

    Returns:
        Recorded names to names that are played.

    Raises:
        RecordingError: two topics would get the same name.
    """
    cells = cells_of(topics)
    cell = cells.pop() if len(cells) == 1 else ''
    names: dict[str, str] = {}
    for topic in topics:
        name = prefix + (topic.removeprefix(cell) if topic.startswith(f'{cell}/') else topic)
        other = next((recorded for recorded, played in names.items() if played == name), None)
        if other is not None:
            raise RecordingError(
                f'{other} and {topic} would both be played as {name}: name the topics to play with --topics, or'
                ' give --prefix instead of --namespace.'
            )
        names[topic] = name
    return names


def cells_of(topics: Collection[str]) -> set[str]:
    """The namespaces in which topics of a cell are; '' for the root."""
    # stack/points is the cloud of a stack, and not points in a namespace `stack`: the shorter one is meant.
    found = ([each.namespace_of(name) for each in _OF_A_CELL] for name in topics)
    return {
        min((namespace.rstrip('/') for namespace in namespaces if namespace is not None), key=len)
        for namespaces in found
        if any(namespace is not None for namespace in namespaces)
    }
