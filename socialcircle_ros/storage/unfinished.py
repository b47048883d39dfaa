# SPDX-License-Identifier: Apache-2.0
"""Files and folders that get their name only when they are complete."""

import errno
import fcntl
import itertools
import logging
import os
import re
import secrets
import shutil
import stat
import weakref
from contextlib import suppress
from enum import Enum, auto
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

from socialcircle_ros.errors import SocialCircleError

from .signals import postponed_signals, raising

_LOG = logging.getLogger(__name__)

_PARTIAL = 'partial'  # removed after an error
_UNFINISHED = 'unfinished'  # kept after an error
_REPLACED = 'replaced'  # a folder that is being replaced

_LEFTOVER = re.compile(rf'(?P<target>.+)\.[0-9a-f]+\.({_PARTIAL}|{_UNFINISHED}|{_REPLACED})')

_REGULAR = (stat.S_IFREG, stat.S_IFDIR)
_KINDS = {
    stat.S_IFREG: 'a file',
    stat.S_IFDIR: 'a directory',
    stat.S_IFLNK: 'a symbolic link',
    stat.S_IFCHR: 'a device',
    stat.S_IFBLK: 'a device',
    stat.S_IFIFO: 'a named pipe',
    stat.S_IFSOCK: 'a socket',
}


def write_file(path: Path, content: str | bytes) -> None:
    """Write a file whole or not at all; a file that has the name already is replaced, and keeps its permissions.

    Args:
        path: of the file.
        content: text is written as UTF-8.

    Raises:
        SocialCircleError: the file cannot be written, or something other than a file has its name.
    """
    try:
        with Unfinished(path) as file:
            file.write(content)
            file.complete()
    except OSError as error:
        raise SocialCircleError(f'{path} cannot be written: {error.strerror}.') from None


def check_place(path: Path) -> None:
    """Raise an error if `write_file` could not write there, before the work that makes the content.

    Raises:
        SocialCircleError: as by `write_file`.
    """
    try:
        with Unfinished(path):
            pass
    except OSError as error:
        raise SocialCircleError(f'{path} cannot be written: {error.strerror}.') from None


def lies_in(target: Path, source: Path) -> bool:
    """Whether writing the target would change the source, a file or a folder; both names are followed."""
    # Path.resolve() fails on a loop of links.
    written, read = (Path(os.path.realpath(path)) for path in (target, source))
    return written == read or written in read.parents or (read.is_dir() and read in written.parents)


def open_in_place(path: Path, *, append: bool = False) -> BinaryIO:
    """Open a file that grows where it stands, such as a log; links, devices and pipes are refused.

    Args:
        path: of the file.
        append: whether to keep what is in it.

    Raises:
        SocialCircleError: something other than a file has the name.
        OSError: the file cannot be opened.
    """
    found = kind_of_target(path)
    if found not in (None, 'a file'):
        raise SocialCircleError(f'{path} is {found}, and is not overwritten: give another name.')
    flags = os.O_APPEND if append else os.O_TRUNC
    return os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_NOFOLLOW | flags, 0o666), 'wb')


def kind_of_target(path: Path) -> str | None:
    """What has the name of a file that is to be written, in words; None: nothing has. Links are not followed."""
    try:
        mode = path.lstat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return None
    return _KINDS.get(stat.S_IFMT(mode), 'no file')


class _Lock(Enum):
    """What became of an attempt to lock a file."""

    HELD = auto()
    TAKEN = auto()  # by another process
    IMPOSSIBLE = auto()  # some network file systems have no locks


class _OpenEntry:
    """A temporary file or folder, its lock, and the handling of signals while it exists.

    Attributes:
        path: None before it is made, and after it got its name.
        descriptor: of the open file or folder, which is locked.
    """

    def __init__(self) -> None:
        self.path: Path | None = None
        self.descriptor = -1
        self._process = os.getpid()
        self._raising = raising.begin()

    def make(self, target: Path, suffix: str, *, folder: bool) -> None:
        """Make and lock it, beside the target.

        Raises:
            OSError: it cannot be made.
        """
        while True:
            path = target.with_name(f'{target.name}.{secrets.token_hex(4)}.{suffix}')
            if folder:
                path.mkdir()
            self.path = path if folder else None
            flags = os.O_RDONLY | os.O_DIRECTORY if folder else os.O_WRONLY | os.O_CREAT | os.O_EXCL
            self.descriptor = os.open(path, flags | os.O_NOFOLLOW, 0o666)
            self.path = path
            if _lock(self.descriptor) != _Lock.TAKEN and path.exists():
                return
            # Another process saw it before it was locked, and removes it.
            os.close(self.descriptor)
            self.descriptor = -1

    def remove(self) -> None:
        """Remove it, unless it got its name."""
        if self._process != os.getpid():
            return  # a fork has the descriptor, but the file is not its own
        with postponed_signals():
            if self.path is not None and self.path.is_dir():
                shutil.rmtree(self.path, ignore_errors=True)
            elif self.path is not None:
                with suppress(OSError):
                    self.path.unlink()
            with suppress(OSError):
                os.close(self.descriptor)
        raising.end(begun=self._raising)


class Unfinished:
    """A file or folder beside its target, which `complete` gives the name of the target.

    A context manager: without `complete`, the end of the block removes it, and so do Ctrl-C, SIGTERM and SIGHUP
    (the latter two raise SignalExit meanwhile, unless the program handles them). Only SIGKILL and a loss of power
    leave it. The next `Unfinished` of the same target removes what is left, or gives it a name of its own if it
    was to be kept, and logs that. A lock tells what is left from what is still written.
    """

    def __init__(self, target: Path, *, folder: bool = False, kept: bool = False) -> None:
        """Make the temporary file or folder.

        Args:
            target: the name that it gets.
            folder: whether to make a folder.
            kept: whether what a killed process has left is of use, and is not to be removed.

        Raises:
            SocialCircleError: something that is not a file, or not a folder, has the name of the target.
            OSError: it cannot be made.
        """
        # Absolute, because the working directory may change while a long file is written.
        self._target = target.absolute()
        self._given = target
        self._folder = folder
        self._check_target()
        remove_leftovers(self._target)
        self._entry = _OpenEntry()
        # It also runs when the object is lost, as by Ctrl-C just after it was made, and at the exit.
        self._cleaner = weakref.finalize(self, self._entry.remove)
        try:
            with postponed_signals():
                self._entry.make(self._target, _UNFINISHED if kept else _PARTIAL, folder=folder)
        except BaseException:
            self._cleaner()
            raise

    @property
    def path(self) -> Path:
        """Where to write until it is complete."""
        return self._entry.path or self._target

    @property
    def descriptor(self) -> int:
        """The descriptor of the open file; for a folder, of the folder."""
        return self._entry.descriptor

    def write(self, content: str | bytes) -> None:
        """Write to the file; text as UTF-8.

        Raises:
            OSError: it cannot be written.
        """
        view = memoryview(content.encode() if isinstance(content, str) else content)
        while view:
            view = view[os.write(self.descriptor, view) :]

    def complete(self, *, replace: bool = True) -> None:
        """Write everything to the disk, and give it the name of the target.

        Args:
            replace: whether to replace what has the name already; a folder is replaced by a folder.

        Raises:
            FileExistsError: the name is taken, and `replace` is False.
            SocialCircleError: something that is not a file, or not a folder, has taken the name meanwhile.
            OSError: it cannot be done.
        """
        os.fsync(self.descriptor)
        self._check_target()
        with postponed_signals():
            if self._folder:
                self._take_folders_place(replace=replace)
            elif replace:
                self._copy_permissions()
                self.path.replace(self._target)
            else:
                _rename_to_free_name(self.path, self._target)
            self._has_its_name()
        self._cleaner()

    def keep(self) -> Path:
        """Give it a free name beside the target, where the target's own name is taken.

        Returns:
            The name.

        Raises:
            OSError: it cannot be done.
        """
        with postponed_signals():
            path = _rename_like(self.path, self._target)
            self._has_its_name()
        self._cleaner()
        return path

    def leave(self) -> Path:
        """Leave it as it is, where it cannot be given a name.

        Returns:
            Where it is.
        """
        path, self._entry.path = self.path, None
        self._cleaner()
        return path

    def discard(self) -> None:
        """Remove it; nothing if it is complete."""
        self._cleaner()

    def __enter__(self) -> 'Unfinished':  # noqa: PYI034 - Self is not in Python 3.10
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.discard()

    def _check_target(self) -> None:
        found = kind_of_target(self._target)
        if found not in (None, 'a directory' if self._folder else 'a file'):
            raise SocialCircleError(f'{self._given} is {found}, and is not overwritten: give another name.')

    def _copy_permissions(self) -> None:
        with suppress(OSError):  # those of the target, if it exists; not every file system has permissions
            os.fchmod(self.descriptor, stat.S_IMODE(self._target.lstat().st_mode))

    def _take_folders_place(self, *, replace: bool) -> None:
        if not replace or not self._target.exists():
            _rename_to_free_name(self.path, self._target)
            return
        replaced = self._target.with_name(f'{self._target.name}.{secrets.token_hex(4)}.{_REPLACED}')
        old = os.open(self._target, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
        try:
            _lock(old)  # so that no other process takes it for left behind
            self._target.rename(replaced)
            try:
                self.path.rename(self._target)
            except OSError:
                replaced.rename(self._target)
                raise
            shutil.rmtree(replaced, ignore_errors=True)
        finally:
            os.close(old)

    def _has_its_name(self) -> None:
        self._entry.path = None
        with suppress(OSError):  # some file systems cannot write the directory of a folder to the disk
            folder = os.open(self._target.parent, os.O_RDONLY | os.O_DIRECTORY)
            try:
                os.fsync(folder)
            finally:
                os.close(folder)


def remove_leftovers(target: Path) -> None:
    """Remove what killed processes left beside a target, and log that.

    What was to be kept gets a name of its own instead, and a folder that was being replaced its old name.
    """
    with suppress(OSError):  # what is wrong with the folder shows when the file is made
        for path in sorted(target.parent.iterdir()):
            if _target_of(path) == target:
                _remove_unless_in_use(path, target)


def remove_leftovers_below(folder: Path) -> None:
    """Do the same for all targets in a folder and in the folders in it."""
    for below, folders, files in os.walk(folder):
        for path in (Path(below, name) for name in sorted([*folders, *files])):
            if target := _target_of(path):
                _remove_unless_in_use(path, target)


def _target_of(path: Path) -> Path | None:
    """What a leftover was to become; None: the path is no leftover."""
    found = _LEFTOVER.fullmatch(path.name)
    return path.with_name(found['target']) if found else None


def _remove_unless_in_use(path: Path, target: Path) -> None:
    with suppress(OSError):
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
        try:
            if stat.S_IFMT(os.fstat(descriptor).st_mode) in _REGULAR and _lock(descriptor) == _Lock.HELD:
                _remove_leftover(path, target)
        finally:
            os.close(descriptor)


def _remove_leftover(path: Path, target: Path) -> None:
    suffix = path.suffix.removeprefix('.')
    if suffix == _REPLACED and not os.path.lexists(target):
        path.rename(target)
        _LOG.warning('%s had lost its name when a process was killed; it has its name again.', target)
    elif suffix == _UNFINISHED:
        rescued = _rename_like(path, target, _UNFINISHED)
        _LOG.warning('%s was left by a process that was killed; it is kept as %s.', path, rescued)
    else:
        shutil.rmtree(path) if path.is_dir() else path.unlink()
        _LOG.warning('%s was left by a process that was killed; it is removed.', path)


def _rename_like(path: Path, target: Path, word: str = '') -> Path:
    """Give a file or folder a free name: the target's with a word or a number, and with the same suffix."""
    for number in itertools.count(1):
        counts = [word] * bool(word) + [str(number)] * (number > 1)
        free = target.with_name(f'{"_".join([target.stem, *counts])}{target.suffix}')
        if not os.path.lexists(free):
            with suppress(FileExistsError):
                _rename_to_free_name(path, free)
                return free
    raise AssertionError


def _rename_to_free_name(path: Path, free: Path) -> None:
    """Rename without replacing anything.

    Raises:
        FileExistsError: the name is taken.
    """
    if path.is_dir():
        try:
            path.rename(free)
        except OSError as error:
            if error.errno not in (errno.ENOTEMPTY, errno.ENOTDIR):
                raise
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(free)) from None
        return
    try:
        os.link(path, free, follow_symlinks=False)
    except FileExistsError:
        raise
    except OSError:  # a file system without hard links
        if os.path.lexists(free):
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(free)) from None
        path.rename(free)
    else:
        path.unlink()


def _lock(descriptor: int) -> _Lock:
    """Lock an open file or folder while this process lives."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return _Lock.TAKEN
    except OSError:
        return _Lock.IMPOSSIBLE
    return _Lock.HELD
