# SPDX-License-Identifier: Apache-2.0
"""The inputs of a batch: recordings, folders, globs, measurement files, and URLs through fsspec."""

import errno
import os
import tempfile
from collections import Counter, deque
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime
from hashlib import blake2b
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

from socialcircle_ros.arguments import OneOrSeveral, several
from socialcircle_ros.errors import RecordingError, SocialCircleError
from socialcircle_ros.storage import file_system, is_below, is_url, real_location, reason_of

from .results import ResultFolder, result_name

if TYPE_CHECKING:
    import fsspec

_RECORDINGS = ('.mcap', '.mcap.zstd', '.mcap.zst')
_METADATA = 'metadata.yaml'
_NOT_FOUND_IN_FOLDERS = ('.txt', '.asc', '.csv', '.xyz', '.dat', '.npy')
"""Suffixes of measurement files that other files have more often; in a folder they are passed over."""

_BLOCK = 1 << 20
_HASH_BYTES = 16


@dataclass(frozen=True)
class ArchiveInput:
    """One input of a batch.

    Attributes:
        location: absolute path, or URL.
        name: of its results, relative to their folder, without a suffix; no other input of the folder has it.
        size: in bytes.
        changed: what changes when the content does: the time of the last change, or the ETag; '': unknown.
        time_ns: time of the last change, ns since 1970; 0: unknown.
    """

    location: str
    name: str
    size: int
    changed: str
    time_ns: int


@dataclass(frozen=True)
class _Found:
    location: str
    relative: str
    size: int
    changed: str
    time_ns: int


def find_inputs(
    given: OneOrSeveral[str | Path],
    progress: Callable[[int], None] = lambda count: None,
    results: ResultFolder | None = None,
    left_out: Callable[[str], None] = lambda location: None,
    owners: Mapping[str, Collection[str]] | None = None,
) -> list[ArchiveInput]:
    """Find all inputs, in the order of their locations; an input that is given twice is one input.

    Args:
        given: recordings, rosbag2 directories, measurement files, folders that are searched with all folders in
            them, glob patterns, and URLs of these. In folders, hidden files and measurement files whose suffix is
            also that of other files, such as .txt, are passed over. A folder to which links lead is searched once.
        progress: called with the number of inputs found so far.
        results: what is in its folders is no input, however it is named; None: there is no such folder.
        left_out: called with the location of each such result that would have been an input.
        owners: locations of earlier inputs by `result_name`; no other input gets the names of their results.

    Raises:
        SocialCircleError: none is given; one of them does not exist, cannot be read, holds no input, or is a
            recording with the folder of the results in it; all hold only such results; or fsspec cannot open a
            URL.
    """
    found: dict[str, _Found] = {}
    own = _OwnResults(results)
    texts = [str(each) for each in several(given)]
    if not texts:
        raise RecordingError('There is no input: give recordings, measurement files, folders or URLs.')
    for text in texts:
        count = 0
        for each in _found_at(text):
            count += 1
            if own.hold(each):
                left_out(each.location)
            else:
                found.setdefault(each.location, each)
                progress(len(found))
        # A shell that replaces * by all names gives the folder of the results as well.
        if not count and not own.are_at(text):
            raise RecordingError(f'{text} holds no recording and no measurement file.')
    if not found:
        raise RecordingError(
            f'{", ".join(texts)} holds nothing but the results: give the recordings that they came from.'
        )
    ordered = [found[location] for location in sorted(found)]
    counts = Counter(result_name(each.relative) for each in ordered)

    def name_of(each: _Found) -> str:
        name = result_name(each.relative)
        is_alone = counts[name] == 1 and set((owners or {}).get(name, ())) <= {each.location}
        return each.relative if is_alone else with_hash(each.relative, each.location)

    return [ArchiveInput(each.location, name_of(each), each.size, each.changed, each.time_ns) for each in ordered]


def with_hash(name: str, location: str) -> str:
    """The name of the results of an input where its own name belongs to another one as well."""
    return f'{name}-{short_hash(location)}'


def short_hash(text: str) -> str:
    """Eight hexadecimal digits of a text, for names of files."""
    return blake2b(text.encode(), digest_size=4).hexdigest()


@contextmanager
def local_copy(location: str) -> Iterator[Path]:
    """The input as a local path: itself, or a copy that is removed at the end of the block.

    Raises:
        SocialCircleError: it cannot be read.
    """
    if not is_url(location):
        yield Path(location)
        return
    files, path = file_system(location)
    with tempfile.TemporaryDirectory(prefix='socialcircle-') as folder:
        target = Path(folder, PurePosixPath(path).name)
        try:
            files.get(path, str(target), recursive=files.isdir(path))
        except Exception as error:  # noqa: BLE001 - each file system has errors of its own
            raise RecordingError(f'{location} cannot be read: {reason_of(error)}') from None
        yield target


def content_hash(path: Path) -> str:
    """Hash the content of a recording or of a measurement file: 32 hexadecimal digits.

    Raises:
        RecordingError: it cannot be read.
    """
    digest = blake2b(digest_size=_HASH_BYTES)
    files = sorted(each for each in path.rglob('*') if each.is_file()) if path.is_dir() else [path]
    try:
        for file in files:
            if path.is_dir():
                digest.update(f'{file.relative_to(path)}\0{file.stat().st_size}\0'.encode())
            with file.open('rb') as stream:
                while block := stream.read(_BLOCK):
                    digest.update(block)
    except FileNotFoundError:
        raise RecordingError(f'{path} does not exist: check the name.') from None
    except OSError as error:
        raise RecordingError(f'{path} cannot be read ({error.strerror}): check its permissions.') from None
    return digest.hexdigest()


def still_holds(location: str, size: int, changed: str, content: str) -> bool:
    """Whether a location holds a content that it held before.

    Args:
        location: of an input.
        size: of it, then.
        changed: its state then, see `ArchiveInput`.
        content: the hash of its content.
    """
    try:
        found = find_inputs([location])
        if len(found) != 1:
            return False
        if changed and (found[0].size, found[0].changed) == (size, changed):
            return True
        with local_copy(location) as path:
            return content_hash(path) == content
    except SocialCircleError:
        return False


class _OwnResults:
    """Tells what a batch has written from its inputs, whatever path, link or URL leads there."""

    def __init__(self, results: ResultFolder | None) -> None:
        self._location = '' if results is None else results.location
        self._real = '' if results is None else real_location(results.location)
        self._folders = () if results is None else results.folders()

    def are_at(self, location: str) -> bool:
        """Whether a location is the folder of the results."""
        return bool(self._real) and real_location(location) == self._real

    def hold(self, found: _Found) -> bool:
        """Whether it is a result.

        Raises:
            RecordingError: it is a recording with the folder of the results in it, which would change it.
        """
        if not self._real:
            return False
        real = real_location(found.location)
        if is_below(self._real, real):
            raise RecordingError(
                f'{self._location} is in the recording {found.location}: give another folder for the results.'
            )
        return any(is_below(real, folder) for folder in self._folders)


def _found_at(text: str) -> Iterator[_Found]:
    if is_url(text):
        yield from _found_at_url(text)
        return
    text = text.removeprefix('file://')
    path = Path(text).absolute()
    if os.path.lexists(path):
        yield from _found_under(path)
    elif any(sign in text for sign in '*?['):
        matches = sorted(Path(path.anchor).glob(str(path.relative_to(path.anchor))))
        for match in matches:
            yield from _found_under(match)
    else:
        raise RecordingError(f'{text} does not exist: check the name.')


def _found_under(top: Path) -> Iterator[_Found]:
    """The inputs at or under a local path; a rosbag2 directory is one input.

    Links may lead back to a folder above them. So each folder is searched once, by its own path if it is under
    `top`: links wait until all other folders are searched.
    """
    waiting, links = [top], deque[Path]()
    searched: set[Path] = set()
    while waiting or links:
        path = waiting.pop() if waiting else links.popleft()
        try:
            real = path.resolve(strict=True)
            if real in searched:
                continue
            children = sorted(path.iterdir()) if path.is_dir() else []
            if not path.is_dir() or _is_bag([each.name for each in children]):
                yield _found(path, top)
                searched.update([real] if children else [])
                continue
            searched.add(real)
            for child in reversed(children):  # the last that waits is the next
                if not child.name.startswith('.') and (child.is_dir() or _is_found_in_folders(child.name)):
                    (links if child.is_symlink() and child.is_dir() else waiting).append(child)
        except (OSError, RuntimeError) as error:  # before Python 3.13 a loop of links is a RuntimeError
            reason = os.strerror(errno.ELOOP) if isinstance(error, RuntimeError) else error.strerror
            raise RecordingError(f'{path} cannot be read ({reason}): check its permissions and links.') from None


def _found(path: Path, top: Path) -> _Found:
    """A local file, or a rosbag2 directory, as an input.

    Raises:
        OSError: its size cannot be read.
    """
    files = [each for each in path.rglob('*') if each.is_file()] if path.is_dir() else [path]
    states = [each.stat() for each in files]
    relative = str(path.relative_to(top)) if path != top else path.name
    changed = max((state.st_mtime_ns for state in states), default=0)
    return _Found(str(path), relative, sum(state.st_size for state in states), str(changed), changed)


def _found_at_url(url: str) -> Iterator[_Found]:
    files, path = file_system(url)
    try:
        if any(sign in path for sign in '*?['):
            tops = sorted(files.glob(path))
        else:
            tops = [path] if files.exists(path) else []
        for top in tops:
            yield from _found_remotely(files, str(top))
    except SocialCircleError:
        raise
    except Exception as error:  # noqa: BLE001 - each file system has errors of its own
        raise RecordingError(f'{url} cannot be listed: {reason_of(error)}') from None
    if not tops:
        raise RecordingError(f'{url} does not exist: check the name.')


def _found_remotely(files: 'fsspec.AbstractFileSystem', top: str) -> Iterator[_Found]:
    information = files.info(top)
    if information['type'] != 'directory':
        yield _remote(files, [information], top, PurePosixPath(top).name)
        return
    folders: dict[str, list[dict[str, object]]] = {}
    for name, details in sorted(files.find(top, detail=True).items()):
        folders.setdefault(str(PurePosixPath(name).parent), []).append(details)
    for folder, members in folders.items():
        names = [PurePosixPath(str(each['name'])).name for each in members]
        if _is_bag(names):
            relative = str(PurePosixPath(folder).relative_to(top)) if folder != top else PurePosixPath(top).name
            yield _remote(files, members, folder, relative)
            continue
        for name, details in zip(names, members, strict=True):
            if not name.startswith('.') and _is_found_in_folders(name):
                path = str(details['name'])
                yield _remote(files, [details], path, str(PurePosixPath(path).relative_to(top)))


def _remote(
    files: 'fsspec.AbstractFileSystem', members: Sequence[dict[str, object]], path: str, relative: str
) -> _Found:
    size = sum(int(str(each.get('size') or 0)) for each in members)
    states = [each.get('ETag') or each.get('LastModified') or each.get('mtime') for each in members]
    times = [each.get('LastModified') or each.get('created') for each in members]
    instants = [each for each in times if isinstance(each, datetime)]
    changed = ' '.join(map(str, states)) if all(states) else ''
    # A float of seconds since 1970 holds whole microseconds, as a datetime does, but not nanoseconds.
    time_ns = round(max(instants).timestamp() * 1e6) * 1000 if instants else 0
    location = str(files.unstrip_protocol(path)).removeprefix('file://')  # local:///nights is a path
    return _Found(location, relative, size, changed, time_ns)


def _is_bag(names: Sequence[str]) -> bool:
    return _METADATA in names and any(name.endswith(_RECORDINGS) for name in names)


def _is_found_in_folders(name: str) -> bool:
    lowered = name.lower()
    if lowered.endswith(_RECORDINGS):
        return True
    from socialcircle_ros.formats import format_of  # noqa: PLC0415 - loads kernels

    form = format_of(Path(name))
    return form is not None and bool(form.reads) and not lowered.endswith(_NOT_FOUND_IN_FOLDERS)
