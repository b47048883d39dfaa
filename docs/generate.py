# SPDX-License-Identifier: Apache-2.0
"""Writes the files and tables that are generated: the parameter file, and the tables of the documents.

    python docs/generate.py

The parameters come from `socialcircle_ros/settings`, the topics, services and status keys from
`socialcircle_ros/interface.py`, the formats of files from `socialcircle_ros/formats/table.py`, the
columns of measurements from `socialcircle_ros/measurements/row.py`. In a page the
generator fills the place between `<!-- generated: NAME -->` and `<!-- end -->` with the table NAME, and changes
nothing else.
"""

import re
from pathlib import Path

from socialcircle_ros.formats import formats_table
from socialcircle_ros.interface import interface_tables
from socialcircle_ros.measurements import schema_table
from socialcircle_ros.settings import GROUPS, parameter_table, yaml_text
from socialcircle_ros.storage import write_file

DOCS = Path(__file__).resolve().parent
PARAMETER_FILE = DOCS.parent / 'config' / 'social_circle.yaml'

TABLES = {f'{group.group or "node"} parameters': parameter_table(group) for group in GROUPS}
TABLES |= interface_tables() | formats_table() | schema_table()
PLACE = re.compile(r'(?<=<!-- generated: )(.+?)( -->\n).*?(?=<!-- end -->)', re.DOTALL)


def generated() -> dict[Path, str]:
    """The generated files and the pages with generated tables: their paths and their text."""
    pages = {page: page.read_text(encoding='utf-8') for page in sorted(DOCS.glob('*.md'))}
    filled = {
        page: PLACE.sub(lambda place: f'{place[1]}{place[2]}\n{TABLES[place[1]]}\n', text)
        for page, text in pages.items()
        if PLACE.search(text)
    }
    return {PARAMETER_FILE: yaml_text({}), **filled}


if __name__ == '__main__':
    for path, content in generated().items():
        write_file(path, content)
