# SPDX-License-Identifier: Apache-2.0
"""Render sections as one HTML page that embeds its pictures, for the screen and for paper."""

import html
import re
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from socialcircle_ros.errors import SocialCircleError, install_command

from .content import Section

if TYPE_CHECKING:
    from jinja2 import Environment

_CODE = re.compile('`([^`]+)`')
_SUFFIXES = ('.html', '.htm')


def check_page_name(output: Path) -> None:
    """Raise an error if a page would get the name of a directory or of another file, before the work on the page.

    Raises:
        SocialCircleError: the name is not that of a page.
    """
    if output.is_dir():
        raise SocialCircleError(f'{output} is a directory; give the name of a page, such as {output}/page.html.')
    if output.suffix.lower() not in _SUFFIXES:
        raise SocialCircleError(f'{output} is not the name of a page: give one that ends in .html.')


def render(title: str, introduction: Sequence[str], sections: Sequence[Section]) -> str:
    """Render an HTML page.

    Args:
        title: title of the page.
        introduction: paragraphs at the top.
        sections: the sections in order; their findings are also listed at the top.

    Returns:
        The page as HTML. It embeds its pictures and needs no other file.

    Raises:
        SocialCircleError: Jinja2 is not installed.
    """
    findings = [finding for section in sections for finding in section.findings]
    return (
        environment()
        .get_template('page.html')
        .render(title=title, introduction=introduction, findings=findings, sections=sections)
    )


@cache
def environment() -> 'Environment':
    """The templates of the pages.

    Raises:
        SocialCircleError: Jinja2 is not installed.
    """
    try:
        from jinja2 import Environment, PackageLoader, StrictUndefined  # noqa: PLC0415 - an extra
    except ImportError:
        raise SocialCircleError(f'Pages need Jinja2: {install_command("pictures")}.') from None
    found = Environment(
        loader=PackageLoader(__package__), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True,
    )  # fmt: skip
    found.filters['sentence'] = sentence_in_html
    return found


def sentence_in_html(text: str) -> str:
    """A sentence for a person as HTML, escaped, with what stands between backticks in the type of a command."""
    return _CODE.sub(r'<code>\1</code>', html.escape(text))
