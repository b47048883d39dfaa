# SPDX-License-Identifier: Apache-2.0
"""What is done: one small file per content of an input, written after its results.

A rerun reads these files. An input with the same location, size and time of change, and with the same settings and
version, is not opened again.
"""

import json
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

from .inputs import ArchiveInput, short_hash
from .results import LEDGER, ResultFolder, recording_of, report_of


@dataclass(frozen=True)
class LedgerEntry:
    """What is done with one content, or what failed at one location.

    Attributes:
        location: of the input.
        size: of the input in bytes.
        changed: state of the input, see `ArchiveInput`.
        digest: hash of the settings, the options and the version; '': a run began to replace the results, and did
            not end.
        clouds: number of filtered clouds.
        refused: number of refused clouds and frames by reason.
        damage: where the recording is damaged; None: it is sound.
        limits_failed: number of clouds that failed their limits.
        name: of the results, see `ArchiveInput`.
        files: the files of rows, relative to the folder of the results.
        failure: why nothing came of it; None: it did not fail.
        content: hash of what was read; '': it could not be read.
        outputs: the cleaned recording and the report, if they were made, relative to the folder of the results;
            None: an earlier version made them and did not say which.
    """

    location: str
    size: int
    changed: str
    digest: str
    clouds: int = 0
    refused: dict[str, int] = field(default_factory=dict)
    damage: str | None = None
    limits_failed: int = 0
    name: str = ''
    files: tuple[str, ...] = ()
    failure: str | None = None
    content: str = ''
    outputs: tuple[str, ...] | None = None

    def is_of(self, found: ArchiveInput, digest: str) -> bool:
        """Whether it is the entry of an unchanged input with the same settings, and nothing failed."""
        same = (self.location, self.size, self.changed, self.digest) == (
            found.location, found.size, found.changed, digest,
        )  # fmt: skip
        return same and bool(found.changed) and self.failure is None

    def made(self, name: str = '') -> set[str]:
        """All that was made of the input, relative to the folder of the results.

        Args:
            name: what an earlier version may have made under this name counts; '': only what is certain.
        """
        outputs = self.outputs
        if outputs is None:
            outputs = (recording_of(name), report_of(name)) if name and name == self.name else ()
        return {*self.files, *outputs}


class Ledger:
    """The entries in a folder of results.

    Args:
        output: the folder of the results, or its location.
    """

    def __init__(self, output: ResultFolder | str | Path) -> None:
        self._output = output if isinstance(output, ResultFolder) else ResultFolder(output)

    def entries(self) -> Iterator[LedgerEntry]:
        """All entries; a file that is not an entry is passed over, and its input is done again."""
        for name, text in self._output.read_all(LEDGER, '.json'):
            entry = _parsed(text)
            if entry is not None:
                yield entry if entry.failure is not None else replace(entry, content=name.removesuffix('.json'))

    def of_content(self, content: str) -> LedgerEntry | None:
        """The entry of a content; None: there is none."""
        entry = _parsed(self._output.read(_file_of(content)))
        return None if entry is None else replace(entry, content=content)

    def begin(self, content: str, found: ArchiveInput, *, moved: bool) -> None:
        """Tell that what was made of a content is about to be replaced, so that no settings count as done.

        The entry stays, because it says what is to be removed. That of a content that has moved becomes one of its
        new location, and its outputs with names of the old one go now: afterwards these names may be those of
        another content, which another worker finds at the old location.

        Args:
            content: hash of what is about to be filtered.
            found: the input with it.
            moved: whether the content is no longer at the location of the entry.

        Raises:
            SocialCircleError: it cannot be written.
        """
        entry = self.of_content(content)
        if entry is None:
            return
        if moved and entry.location != found.location:
            outputs = entry.made(found.name) - set(entry.files)
            own = outputs & {recording_of(found.name), report_of(found.name)}
            self._remove(outputs - own)
            entry = replace(
                entry, location=found.location, size=found.size, changed=found.changed, name=found.name
            )
            self._write(_file_of(content), replace(entry, digest='', outputs=tuple(sorted(own))))
        elif entry.digest:
            self._write(_file_of(content), replace(entry, digest=''))

    def record(self, content: str, entry: LedgerEntry) -> None:
        """Record what is done, and remove what an earlier run, or a failure, had left for this input.

        Raises:
            SocialCircleError: it cannot be written.
        """
        failed = _failure_file(entry.location)
        for earlier in (self.of_content(content), _parsed(self._output.read(failed))):
            if earlier is not None:
                outdated = earlier.made(entry.name) - entry.made()
                if outdated and earlier.location != entry.location:
                    outdated -= self._made_of_others(content)
                self._remove(outdated)
        self._write(_file_of(content), replace(entry, content=content))
        self._output.remove(failed)

    def drop(self, entry: LedgerEntry, done: LedgerEntry) -> None:
        """Remove what was made of a copy of an input that another worker has done meanwhile.

        Args:
            entry: what was made, which is not recorded.
            done: the entry of the other one.
        """
        self._remove(entry.made() - done.made())

    def forget_others(self, earlier: Iterable[LedgerEntry], location: str, content: str) -> None:
        """Forget failures and other contents of a location, with what was made of them.

        Args:
            earlier: entries of the location, as `entries` gave them.
            location: of the input.
            content: hash of what is there now.
        """
        others = [each for each in earlier if each.failure is not None or each.content != content]
        if not others:  # as for nearly all inputs of a rerun, of which nothing is read from an object store then
            return
        now = self.of_content(content)
        kept = set() if now is None else now.made(now.name)
        for each in others:
            if each.failure is not None:
                self._remove(each.made())
                self._output.remove(_failure_file(location))
                continue
            # Another worker may have found this content at another location since.
            current = self.of_content(each.content)
            if current is not None and current.location == location:
                self._remove(current.made() - kept)
                self._output.remove(_file_of(each.content))

    def record_failure(self, entry: LedgerEntry) -> None:
        """Record a failure, in the place of an earlier one at the same location.

        Raises:
            SocialCircleError: it cannot be written.
        """
        path = _failure_file(entry.location)
        earlier = _parsed(self._output.read(path))
        if earlier is not None:
            self._remove(earlier.made() - entry.made())
        self._write(path, entry)

    def _made_of_others(self, content: str) -> set[str]:
        """What was made of all other contents: a name that a moved input had may be that of another one since."""
        return {name for entry in self.entries() if entry.content != content for name in entry.made()}

    def _write(self, name: str, entry: LedgerEntry) -> None:
        self._output.write(name, json.dumps(asdict(entry)))

    def _remove(self, names: set[str]) -> None:
        for name in names:
            self._output.remove(name)


def failure_name(location: str) -> str:
    """Name of the files of a failure, without a suffix."""
    return f'failed-{short_hash(location)}'


def _failure_file(location: str) -> str:
    return f'{LEDGER}/{failure_name(location)}.json'


def _file_of(content: str) -> str:
    return f'{LEDGER}/{content}.json'


def _parsed(content: bytes | None) -> LedgerEntry | None:
    try:
        record = json.loads(content or b'')
        outputs = record.get('outputs')
        tuples = {'files': tuple(record['files']), 'outputs': None if outputs is None else tuple(outputs)}
        return LedgerEntry(**{**record, **tuples})
    except (ValueError, TypeError, KeyError):
        return None
