"""What is generated from the table of parameters: parameter files and the table of the documents."""

import json
import re
import textwrap
from collections.abc import Mapping

from .groups import PARAMETERS
from .schema import RosValue


def yaml_text(values: Mapping[str, RosValue], *, whole: bool = True) -> str:
    """A parameter file that a node starts from, each parameter of the table under its sentence.

    It applies to a node of any name in any namespace.

    Args:
        values: full names to values; names beyond the table are passed over.
        whole: whether the parameters that are not among them follow at their defaults.
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


def markdown_table() -> str:
    """The table of parameters for the README."""
    lines = ['| parameter | default | allowed | unit | |', '|---|---|---|---|---|']
    for name, row in PARAMETERS.items():
        cells = (f'`{name}`', f'`{_yaml_value(row.default)}`', row.allowed, row.unit, row.sentence)
        lines.append('| ' + ' | '.join(cell.replace('|', '/') for cell in cells) + ' |')
    return '\n'.join(lines) + '\n'


def _yaml_value(value: RosValue) -> str:
    """One value as YAML; a float keeps its point, without which YAML 1.1 takes 1e-12 for a text."""
    return re.sub(r'^(-?\d+)e', r'\1.0e', json.dumps(value))
