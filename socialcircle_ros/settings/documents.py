"""Renders the table of parameters: as parameter files, and as Markdown tables for the documents."""

import json
import re
import textwrap
from collections.abc import Iterable, Mapping, Sequence

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


def _yaml_value(value: RosValue) -> str:
    """One value as YAML; a float keeps its decimal point, because YAML 1.1 reads 1e-12 as text."""
    return re.sub(r'^(-?\d+)e', r'\1.0e', json.dumps(value))
