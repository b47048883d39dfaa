# SPDX-License-Identifier: Apache-2.0
"""The steps of an experiment: each is kept on disk when it is finished, so that an interrupted run continues."""

import base64
import json
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
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
        make: does the work, and gives sections of the page.
    """

    key: str
    make: Callable[[], list[Section]]


@dataclass(frozen=True)
class Finished:
    """What is known after a step.

    Attributes:
        sections: of all steps so far.
        done: number of finished steps.
        total: number of all steps.
        seconds_left: estimate from the mean duration of the steps that ran; None before one ran.
        resumed: whether this step was finished by an earlier run.
    """

    sections: Sequence[Section]
    done: int
    total: int
    seconds_left: float | None
    resumed: bool


def run_steps(steps: Sequence[Step], folder: Path, fingerprint: str) -> Iterator[Finished]:
    """Run the steps that an earlier run did not finish, and keep each on disk.

    Args:
        steps: all steps in their order.
        folder: where finished steps are kept; it is created.
        fingerprint: of what two runs must have in common to share steps; files of another one are replaced.

    Yields:
        What is known after each step.

    Raises:
        SocialCircleError: the folder or a file cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SocialCircleError(f'{folder} cannot be written: {error.strerror}; choose another folder.') from None
    sections: list[Section] = []
    durations_s: list[float] = []
    for number, step in enumerate(steps, 1):
        path = folder / f'{step.key}.json'
        found = _kept(path, fingerprint)
        if found is None:
            began_s = time.monotonic()
            made = step.make()
            durations_s.append(time.monotonic() - began_s)
            packed = [_packed(each) for each in made]
            write_file(path, json.dumps({'fingerprint': fingerprint, 'sections': packed}, default=_plain))
        else:
            made = found
        sections += made
        left_s = sum(durations_s) / len(durations_s) * (len(steps) - number) if durations_s else None
        yield Finished(tuple(sections), number, len(steps), left_s, resumed=found is not None)


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
