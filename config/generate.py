"""Writes what is generated from the table in settings.py: config/social_circle.yaml and the README's table.

python config/generate.py
"""

import re
from pathlib import Path

from socialcircle_ros.settings import markdown_table, yaml_text

TOP = Path(__file__).resolve().parents[1]
MARKED = re.compile(r'(?<=<!-- parameters -->\n).*?(?=<!-- end of parameters -->)', re.DOTALL)


def generated() -> dict[Path, str]:
    """The files as they must be."""
    readme = TOP / 'README.md'
    with_table = MARKED.sub(lambda _: f'\n{markdown_table()}\n', readme.read_text(encoding='utf-8'))
    return {TOP / 'config' / 'social_circle.yaml': yaml_text({}), readme: with_table}


if __name__ == '__main__':
    for path, text in generated().items():
        path.write_text(text, encoding='utf-8')
