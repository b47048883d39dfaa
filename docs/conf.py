# SPDX-License-Identifier: Apache-2.0
"""Sphinx: make site builds the pages of this folder; rosdoc2 finds this file too."""

import re

from pygments.lexers import BashLexer
from sphinx.application import Sphinx

from socialcircle_ros import __version__

project = 'socialcircle_ros'
copyright = 'the socialcircle_ros maintainers'  # noqa: A001 - Sphinx's name
release = __version__

extensions = ['myst_parser', 'sphinx.ext.autodoc', 'sphinx.ext.napoleon']
root_doc = 'index'
myst_heading_anchors = 4
myst_enable_extensions = ['dollarmath']
suppress_warnings = ['myst.xref_missing']  # pages link to files beside docs/; test/test_docs.py checks every link

autodoc_typehints = 'description'
autodoc_member_order = 'bysource'
autodoc_mock_imports = ['rclpy']
napoleon_numpy_docstring = False

html_theme = 'furo'  # without fonts or scripts from other servers: cells have no internet
html_title = f'socialcircle_ros {release}'
html_static_path: list[str] = []


def add_contents(_: Sphinx, page: str, source: list[str]) -> None:
    """Make the contents of the site from the table of the first page; its bold rows are captions."""
    if page != root_doc:
        return
    trees = []
    for row in source[0].splitlines():
        if caption := re.match(r'\| \*\*(.+?)\*\*', row):
            trees.append(f'```{{toctree}}\n:hidden:\n:caption: {caption[1]}\n\n')
        elif entry := re.match(r'\| \[.*?\]\((\S+)\.md\)', row):
            trees[-1] += f'{entry[1]}\n'
    source[0] += ''.join(f'\n{tree}```\n' for tree in trees)


def setup(app: Sphinx) -> None:
    """Let Sphinx call what is above."""
    app.connect('source-read', add_contents)
    app.add_lexer('ros', BashLexer)  # commands that need a sourced ROS; the tests run the others
