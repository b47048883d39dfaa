# SPDX-License-Identifier: Apache-2.0
"""YAML without aliases and in bounded size, so that a small text cannot fill the memory."""

from collections.abc import Iterator

import yaml

_LARGEST = 100_000  # events; the metadata of a rosbag2 directory has some 40 for each topic and 12 for each file
_DEEPEST = 50
_FASTEST = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)

# SafeLoader raises any of these for a value that is not of the type that its form or its tag names.
_INVALID = (
    yaml.YAMLError,
    ValueError,
    KeyError,
    IndexError,
    TypeError,
    AttributeError,
    OverflowError,
    RecursionError,
)


class PlainYamlError(ValueError):
    """A text is not plain YAML; the message says why, to be put behind "because"."""


def load_plain_yaml(text: str | bytes) -> object:
    """Load YAML that has no aliases.

    Args:
        text: one document.

    Returns:
        What `yaml.safe_load` returns: dicts, lists, texts, numbers, dates or None.

    Raises:
        PlainYamlError: it is not YAML, has an alias, or is too large or too deep.
    """
    for _ in plain_events(text):
        pass
    try:
        return yaml.load(text, _FASTEST)  # noqa: S506 - a safe loader
    except _INVALID:
        raise PlainYamlError('it has a value that YAML cannot read') from None


def plain_events(text: str | bytes) -> Iterator[yaml.Event]:
    """Yield the parsing events of YAML.

    Raises:
        PlainYamlError: as `load_plain_yaml`.
    """
    depth = 0
    try:
        for number, event in enumerate(yaml.parse(text, _FASTEST)):
            if isinstance(event, yaml.AliasEvent):
                raise PlainYamlError(f'it has an alias in line {line_of(event)}, which is not allowed')
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            if depth > _DEEPEST:
                raise PlainYamlError(f'it is nested deeper than {_DEEPEST} levels')
            if number > _LARGEST:
                raise PlainYamlError('it is too large')
            yield event
    except (yaml.YAMLError, UnicodeError) as error:
        mark = getattr(error, 'problem_mark', None)
        where = f' in line {mark.line + 1}' if mark is not None else ''
        raise PlainYamlError(f'it is not YAML{where}') from None


def line_of(event: yaml.Event) -> int:
    """The line in which an event begins; the first is 1."""
    return event.start_mark.line + 1 if event.start_mark is not None else 1
