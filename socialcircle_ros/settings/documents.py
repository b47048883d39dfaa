# SPDX-License-Identifier: Apache-2.0
"""Renders the table of parameters: as parameter files, and as Markdown tables for the documents."""

import math
import textwrap
from collections.abc import Iterable, Mapping, Sequence

import yaml

from socialcircle_ros.errors import SettingError

from .groups import PARAMETERS
from .schema import RosValue, Settings


def yaml_text(values: Mapping[str, RosValue], *, whole: bool = True) -> str:
    """Write a parameter file, with the description of each parameter as a comment above it.

    The file applies to nodes of any name in any namespace.

    Args:
        values: Values by full name; names of other parameters than ours are ignored.
        whole: Whether the file also holds the other parameters, at their defaults.

    Returns:
        YAML text.

    Raises:
        SettingError: a value is text that cannot be written to a file.
    """
    lines = ['/**:', '  ros__parameters:']
    for name, row in PARAMETERS.items():
        if not whole and name not in values:
            continue
        unit = f' [{row.unit}]' if row.unit else ''
        comment = f'{row.sentence} Allowed: {row.allowed}.{unit}'
        lines += textwrap.wrap(comment, 100, initial_indent='    # ', subsequent_indent='    # ')
        lines += [f'    {name}: {_yaml_value(values.get(name, row.default))}', '']
    return '\n'.join(lines).rstrip() + '\n'


def parameter_table(group: type[Settings]) -> str:
    """The Markdown table of the parameters of a group."""
    rows = [
        (f'`{row.name}`', f'`{_yaml_value(row.default)}`', row.allowed, row.unit, row.sentence)
        for row in group.parameters()
    ]
    return markdown_table(('parameter', 'default', 'allowed', 'unit', 'description'), rows)


def markdown_table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table; each row has one cell per column."""
    lines = [columns, ['---'] * len(columns), *rows]
    return ''.join('| ' + ' | '.join(cell.replace('|', '\\|') for cell in line) + ' |\n' for line in lines)


def quoted_yaml(content: Mapping[str, object]) -> str:
    """A mapping as YAML in which every text is quoted, so that none is read as a number or a boolean.

    Args:
        content: of mappings, lists, text, numbers and booleans. ROS reads the result as PyYAML does.

    Raises:
        SettingError: a text cannot be written to a file.
    """
    return _dump(content)


class _QuotingDumper(yaml.SafeDumper):
    """Writes text in double quotes, and no aliases, which ROS does not read."""

    def ignore_aliases(self, data: object) -> bool:  # noqa: ARG002 - PyYAML's signature
        return True


def _quoted(dumper: yaml.SafeDumper, text: str) -> yaml.ScalarNode:
    try:
        text.encode()
    except UnicodeEncodeError:
        raise SettingError(f'{text!r} is not valid UTF-8, and cannot be saved.') from None
    return dumper.represent_scalar('tag:yaml.org,2002:str', text, style='"')


_QuotingDumper.add_representer(str, _quoted)


def _dump(content: object, *, flow: bool = False) -> str:
    # Without a limit of the width, because a text that is broken into lines is hard to read.
    written: str = yaml.dump(
        content,
        Dumper=_QuotingDumper,
        sort_keys=False,
        allow_unicode=True,
        width=math.inf,
        default_flow_style=flow,
    )
    return written


def _yaml_value(value: RosValue) -> str:
    """One value as YAML, in one line."""
    return _dump([value], flow=True).strip()[1:-1]
