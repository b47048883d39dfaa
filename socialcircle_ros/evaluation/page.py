"""One HTML page of a report: it needs no other file, and reads on paper as on a screen."""

import base64
from collections.abc import Sequence
from html import escape

from .report import Picture, Section, Table

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
th, td {{ padding: .15rem .6rem; border-bottom: 1px solid #ddd; text-align: right; vertical-align: top; }}
th {{ border-bottom: 2px solid #888; }}
th:first-child, td:first-child, td.words {{ text-align: left; }}
td {{ font-variant-numeric: tabular-nums; }}
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
    """The page as text.

    Args:
        title: of the page.
        introduction: paragraphs before everything else.
        sections: in order; their findings are gathered at the top.
    """
    parts = [_paragraphs(introduction)]
    findings = [finding for section in sections for finding in section.findings]
    if findings:
        parts.append(f'<h2>What was found</h2>\n{_findings(findings)}')
    parts += [_section(section) for section in sections]
    return _PAGE.format(title=escape(title), body='\n'.join(parts))


def _section(section: Section) -> str:
    parts = [f'<h2>{escape(section.title)}</h2>', _paragraphs(section.text)]
    parts += [_table(item) if isinstance(item, Table) else _picture(item) for item in section.items]
    return '\n'.join(parts)


def _paragraphs(texts: Sequence[str]) -> str:
    return '\n'.join(f'<p>{escape(text)}</p>' for text in texts)


def _findings(sentences: Sequence[str]) -> str:
    items = '\n'.join(f'<li>{escape(sentence)}</li>' for sentence in sentences)
    return f'<ul class="findings">\n{items}\n</ul>'


def _table(table: Table) -> str:
    head = ''.join(f'<th>{escape(column.name)}</th>' for column in table.columns)
    rows = []
    for cells, texts in zip(table.rows, table.texts(), strict=True):
        row = ''.join(
            f'<td class="words">{escape(text)}</td>' if isinstance(cell, str) else f'<td>{escape(text)}</td>'
            for cell, text in zip(cells, texts, strict=True)
        )
        rows.append(f'<tr>{row}</tr>')
    body = '\n'.join(rows)
    note = f'\n<p class="note">{escape(table.note)}</p>' if table.note else ''
    return (
        f'<div class="table"><table>\n<caption>{escape(table.title)}</caption>\n<thead><tr>{head}</tr></thead>\n'
        f'<tbody>\n{body}\n</tbody>\n</table>{note}</div>'
    )


def _picture(picture: Picture) -> str:
    data = base64.b64encode(picture.png).decode()
    caption = escape(picture.caption)
    image = f'<img alt="{caption}" src="data:image/png;base64,{data}">'
    return f'<figure>{image}<figcaption>{caption}</figcaption></figure>'
