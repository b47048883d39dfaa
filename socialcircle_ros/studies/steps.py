# SPDX-License-Identifier: Apache-2.0
"""The steps of an experiment: each is kept on disk when it is finished, so that an interrupted run continues."""

import base64
import json
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from hashlib import blake2b
from pathlib import Path
from typing import cast

import numpy as np

from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.report.content import Cell, Column, Item, Picture, Section, Table
from socialcircle_ros.storage import write_file


@dataclass(frozen=True)
class Step:
    """A part of an experiment.

    Attributes:
        key: name of the step, unique in its experiment; the name of its file.
        work: how long it takes relative to other steps: seconds on the machine on which `workload` was measured.
        make: does the work, and gives sections of the page. It gets those of all steps before it, merged.
    """

    key: str
    work: float
    make: Callable[[Sequence[Section]], list[Section]]


@dataclass(frozen=True)
class Finished:
    """What is known before the first step that runs, and after each.

    Attributes:
        sections: of all steps so far, merged.
        done: number of finished steps.
        total: number of all steps.
        seconds_left: estimate; it comes from the pilot until a step has run, then from the steps that ran.
        resumed: number of steps that an earlier run finished.
    """

    sections: Sequence[Section]
    done: int
    total: int
    seconds_left: float
    resumed: int


def run_steps(
    steps: Sequence[Step], folder: Path, fingerprint: str, pilot: Callable[[], float]
) -> Iterator[Finished]:
    """Run the steps that an earlier run did not finish, and keep each on disk.

    Args:
        steps: all steps in their order.
        folder: where finished steps are kept; it is created.
        fingerprint: of what two runs must have in common to share steps; files of another one are replaced.
        pilot: measures how many seconds a unit of work takes here; not called if no step is left.

    Yields:
        What is known before the first step, and after each.

    Raises:
        SocialCircleError: the folder or a file cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SocialCircleError(f'{folder} cannot be written: {error.strerror}; choose another folder.') from None
    made = {}
    for step in steps:
        found = _kept(folder / f'{step.key}.json', fingerprint)
        if found is not None:
            made[step.key] = found
    resumed = len(made)
    left = [step for step in steps if step.key not in made]
    seconds_per_work = pilot() if left else 0.0
    spent_s = spent_work = 0.0
    while True:
        sections = merged([section for step in steps for section in made.get(step.key, ())])
        seconds_left = seconds_per_work * sum(step.work for step in left)
        yield Finished(sections, len(made), len(steps), seconds_left, resumed)
        if not left:
            return
        step = left.pop(0)
        began_s = time.monotonic()
        made[step.key] = step.make(sections)
        spent_s += time.monotonic() - began_s
        spent_work += step.work
        if spent_work:
            seconds_per_work = spent_s / spent_work
        packed = [_packed(each) for each in made[step.key]]
        content = json.dumps({'fingerprint': fingerprint, 'sections': packed}, default=_plain)
        write_file(folder / f'{step.key}.json', content)


def merged(sections: Sequence[Section]) -> list[Section]:
    """Join the sections of one title: their paragraphs once, their findings, the rows of their tables of one name.

    An experiment can make a table row by row, each in a step of its own.
    """
    by_title: dict[str, Section] = {}
    for section in sections:
        before = by_title.get(section.title)
        by_title[section.title] = section if before is None else _joined(before, section)
    return list(by_title.values())


def rows_of(sections: Sequence[Section], name: str) -> list[Sequence[Cell]]:
    """The rows of a table that earlier steps made; none if there is no such table."""
    return [row for section in sections for table in section.tables if table.name == name for row in table.rows]


def _joined(before: Section, after: Section) -> Section:
    items = list(before.items)
    places = {item.name: place for place, item in enumerate(items) if isinstance(item, Table)}
    for item in after.items:
        place = places.get(item.name) if isinstance(item, Table) else None
        table = None if place is None else items[place]
        if place is not None and isinstance(item, Table) and isinstance(table, Table):
            items[place] = replace(
                table,
                rows=[*table.rows, *item.rows],
                links=[*table.links, *item.links],
                note=table.note or item.note,
            )
        else:
            items.append(item)
    return replace(
        before,
        text=list(dict.fromkeys((*before.text, *after.text))),
        findings=[*before.findings, *after.findings],
        items=items,
        warnings=list(dict.fromkeys((*before.warnings, *after.warnings))),
    )


def forget_steps(folder: Path) -> None:
    """Remove the finished steps of an experiment."""
    for path in folder.glob('*.json'):
        path.unlink()
    if folder.is_dir():
        folder.rmdir()


def fingerprint_of(*parts: object) -> str:
    """Hash what two runs must have in common, by its representation as text."""
    return blake2b(repr(parts).encode(), digest_size=16).hexdigest()


def _kept(path: Path, fingerprint: str) -> list[Section] | None:
    """The sections that an earlier run kept; None if there are none of this fingerprint."""
    try:
        record = json.loads(path.read_bytes())
        if record['fingerprint'] != fingerprint:
            return None
        return [_unpacked(each) for each in record['sections']]
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _plain(value: object) -> object:
    """A number of NumPy as one of Python."""
    if not isinstance(value, np.generic):
        raise TypeError(f'A table of an experiment holds text and numbers, not {type(value).__name__}.')
    return value.item()


def _packed(section: Section) -> dict[str, object]:
    items: list[dict[str, object]] = []
    for item in section.items:
        if isinstance(item, Table):
            items.append({'table': asdict(item)})
        elif isinstance(item, Picture):
            png = base64.b64encode(item.png).decode()
            items.append({'picture': {'name': item.name, 'png': png, 'caption': item.caption}})
        else:
            raise TypeError(f'A section of an experiment holds tables and pictures, not {type(item).__name__}.')
    words = {name: getattr(section, name) for name in ('title', 'text', 'findings', 'warnings', 'anchor')}
    return {**words, 'items': items}


def _unpacked(record: Mapping[str, object]) -> Section:
    items: list[Item] = []
    for item in cast('list[dict[str, dict[str, object]]]', record['items']):
        if 'table' in item:
            table = item['table']
            columns = [Column(**each) for each in cast('list[dict[str, str]]', table['columns'])]  # type: ignore[arg-type]
            rows = cast('list[list[Cell]]', table['rows'])
            words = cast('dict[str, str]', {name: table[name] for name in ('name', 'title', 'note')})
            items.append(Table(columns=columns, rows=rows, links=cast('list[str]', table['links']), **words))
        else:
            words = cast('dict[str, str]', item['picture'])
            items.append(Picture(words['name'], base64.b64decode(words['png']), words['caption']))
    texts = cast('dict[str, list[str]]', record)
    return Section(
        str(record['title']), texts['text'], texts['findings'], items, texts['warnings'], str(record['anchor'])
    )
