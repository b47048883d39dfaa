"""Render sections as one HTML page that embeds its pictures, for the screen and for paper."""

import base64
from collections.abc import Sequence
from html import escape
from pathlib import Path

from socialcircle_ros.errors import SocialCircleError

from .content import Beside, Item, Panels, Picture, Section, Table

_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
body {{ font: 16px/1.5 system-ui, sans-serif; color: #1a1a1a; max-width: 72rem; margin: 2rem auto;
  padding: 0 1rem; }}
h1, h2 {{ line-height: 1.2; }}
h2 {{ margin-top: 3rem; border-bottom: 1px solid #bbb; }}
p, ul {{ max-width: 48rem; }}
.findings {{ background: #f2f5f8; border-left: 4px solid #2a6592; padding: .5rem 1rem .5rem 2rem; }}
.table {{ overflow-x: auto; margin: 1.5rem 0; }}
table {{ border-collapse: collapse; font-size: .85rem; }}
caption {{ text-align: left; font-weight: 600; padding: .3rem 0; }}
th, td {{ padding: .15rem .5rem; border-bottom: 1px solid #ddd; text-align: right; vertical-align: top; }}
th {{ border-bottom: 2px solid #888; }}
th:first-child, td:first-child, .words {{ text-align: left; }}
td {{ font-variant-numeric: tabular-nums; white-space: nowrap; }}
td.words {{ white-space: normal; }}
.warnings {{ background: #fff3dc; border-left: 4px solid #c77700; padding: .5rem 1rem .5rem 2rem; }}
.beside {{ display: flex; flex-wrap: wrap; gap: 0 2.5rem; }}
.beside .table {{ margin: .5rem 0; }}
.panels {{ display: flex; gap: .8rem; margin: 1rem 0 .3rem; }}
.panels figure {{ flex: 1 1 0; min-width: 0; max-width: 26rem; margin: 0; }}
.panels img {{ width: 100%; image-rendering: auto; border: 1px solid #bbb; box-sizing: border-box; }}
.scale {{ font-size: .85rem; color: #444; margin: 0; }}
.scale img {{ width: 12rem; height: .7rem; vertical-align: middle; margin: 0 .5rem; }}
.note, figcaption {{ font-size: .85rem; color: #444; max-width: 60rem; }}
figure {{ margin: 1.5rem 0; }}
img {{ max-width: 100%; height: auto; }}
@media print {{
  body {{ font-size: 10pt; max-width: none; margin: 0; }}
  table {{ font-size: 7.5pt; }}
  th, td {{ padding: .1rem .3rem; }}
  figure, tr {{ break-inside: avoid; }}
  h2, caption {{ break-after: avoid; }}
  .table {{ overflow: visible; }}
  .sheet {{ break-inside: avoid; }}
  .sheet h2 {{ margin-top: 1rem; font-size: 12pt; }}
  a {{ color: inherit; text-decoration: none; }}
}}
</style>
</head>
<body>
<h1>{title}</h1>
{body}
</body>
</html>
"""


def render(title: str, introduction: Sequence[str], sections: Sequence[Section]) -> str:
    """Render an HTML page.

    Args:
        title: title of the page.
        introduction: paragraphs at the top.
        sections: the sections in order; their findings are also listed at the top.

    Returns:
        The page as HTML. It embeds its pictures and needs no other file.
    """
    parts = [_paragraphs(introduction)]
    findings = [finding for section in sections for finding in section.findings]
    if findings:
        parts.append(f'<h2>Findings</h2>\n{_list(findings, "findings")}')
    parts += [_section(section) for section in sections]
    return _PAGE.format(title=escape(title), body='\n'.join(parts))


def prepare(folder: Path) -> None:
    """Create the folder of the results. Call it before long work, so that a bad folder is reported at once.

    Raises:
        SocialCircleError: the folder cannot be created.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SocialCircleError(f'{folder} cannot be written: {error.strerror}; choose another folder.') from None


def _section(section: Section) -> str:
    parts = [f'<h2>{escape(section.title)}</h2>']
    if section.warnings:
        parts.append(_list(section.warnings, 'warnings'))
    parts.append(_paragraphs(section.text))
    parts += [_item(item) for item in section.items]
    body = '\n'.join(parts)
    return f'<section class="sheet" id="{escape(section.anchor)}">\n{body}\n</section>' if section.anchor else body


def _item(item: Item) -> str:
    if isinstance(item, Table):
        return _table(item)
    if isinstance(item, Picture):
        return _picture(item)
    return _panels(item) if isinstance(item, Panels) else _beside(item)


def _paragraphs(texts: Sequence[str]) -> str:
    return '\n'.join(f'<p>{escape(text)}</p>' for text in texts)


def _list(sentences: Sequence[str], kind: str) -> str:
    items = '\n'.join(f'<li>{escape(sentence)}</li>' for sentence in sentences)
    return f'<ul class="{kind}">\n{items}\n</ul>'


def _table(table: Table) -> str:
    names = ''.join(
        f'<th class="words">{escape(column.name)}</th>' if words else f'<th>{escape(column.name)}</th>'
        for column, words in zip(table.columns, _text_columns(table), strict=True)
    )
    head = f'<thead><tr>{names}</tr></thead>\n' if any(column.name for column in table.columns) else ''
    rows = []
    for number, (cells, texts) in enumerate(zip(table.rows, table.texts(), strict=True)):
        shown = [escape(text) for text in texts]
        if table.links:
            shown[0] = f'<a href="#{escape(table.links[number])}">{shown[0]}</a>'
        row = ''.join(
            f'<td class="words">{text}</td>' if isinstance(cell, str) else f'<td>{text}</td>'
            for cell, text in zip(cells, shown, strict=True)
        )
        rows.append(f'<tr>{row}</tr>')
    body = '\n'.join(rows)
    note = f'\n<p class="note">{escape(table.note)}</p>' if table.note else ''
    caption = f'<caption>{escape(table.title)}</caption>\n' if table.title else ''
    return f'<div class="table"><table>\n{caption}{head}<tbody>\n{body}\n</tbody>\n</table>{note}</div>'


def _text_columns(table: Table) -> list[bool]:
    """Whether each column holds text in all of its rows; such a column is aligned to the left."""
    return [
        bool(table.rows) and all(isinstance(row[number], str) for row in table.rows)
        for number in range(len(table.columns))
    ]


def _picture(picture: Picture) -> str:
    caption = escape(picture.caption)
    image = f'<img alt="{caption}" src="{_source(picture.png)}">'
    return f'<figure>{image}<figcaption>{caption}</figcaption></figure>'


def _panels(panels: Panels) -> str:
    style = f'aspect-ratio: {panels.aspect:.4g}'
    figures = '\n'.join(
        f'<figure><img alt="{escape(title)}" style="{style}" src="{_source(png)}">'
        f'<figcaption>{escape(title)}</figcaption></figure>'
        for title, png in panels.pictures
    )
    row = f'<div class="panels">\n{figures}\n</div>'
    if panels.scale is None:
        return row
    low, high, bar = panels.scale
    image = f'<img alt="colours from low to high" src="{_source(bar)}">'
    return f'{row}\n<p class="scale">{escape(low)}{image}{escape(high)}</p>'


def _beside(beside: Beside) -> str:
    tables = '\n'.join(_table(table) for table in beside.tables)
    return f'<div class="beside">\n{tables}\n</div>'


def _source(png: bytes) -> str:
    return f'data:image/png;base64,{base64.b64encode(png).decode()}'
