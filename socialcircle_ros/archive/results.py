# SPDX-License-Identifier: Apache-2.0
"""The folder of the results of a batch: on this machine, or at a URL."""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.storage import (
    check_folder_name,
    file_system,
    folder_of_results,
    is_url,
    real_location,
    reason_of,
    remove_leftovers_below,
    write_file,
)

if TYPE_CHECKING:
    import fsspec

RECORDINGS, REPORTS, LEDGER = 'recordings', 'reports', 'inputs'
"""Folders of the results."""

FOLDERS = (RECORDINGS, REPORTS, LEDGER, 'measurements')  # the last is `measurements.FOLDER`, which loads kernels
"""All folders of the results."""


def recording_of(name: str) -> str:
    """The cleaned recording of an input, relative to the folder of the results.

    Args:
        name: of its results, see `ArchiveInput`.
    """
    return f'{RECORDINGS}/{result_name(name)}.mcap'


def report_of(name: str) -> str:
    """The report of an input, relative to the folder of the results.

    Args:
        name: of its results, see `ArchiveInput`.
    """
    return f'{REPORTS}/{name}.html'


def result_name(name: str) -> str:
    """The name of an input as its cleaned recording has it: `night` and `night.mcap` become the same file."""
    return name.removesuffix('.mcap')


class ResultFolder:
    """The folder of the results of a batch. Each file appears in it whole or not at all.

    Args:
        location: a path, or a URL of what fsspec can write.

    Attributes:
        location: absolute path, or the URL.

    Raises:
        SocialCircleError: nothing can open the URL.
    """

    def __init__(self, location: str | Path) -> None:
        self._files: fsspec.AbstractFileSystem | None = None
        if is_url(location):
            self.location = str(location).rstrip('/')
            self._files, self._top = file_system(self.location)
        else:
            self.location = str(Path(str(location).removeprefix('file://')).absolute())

    @property
    def name(self) -> str:
        """The last part of the location."""
        return PurePosixPath(self.location).name

    def folders(self) -> tuple[str, ...]:
        """The folders in which results are, each as `real_location` spells it.

        Raises:
            SocialCircleError: the library of the URL is not installed.
        """
        return tuple(real_location(f'{self.location}/{folder}') for folder in FOLDERS)

    @contextmanager
    def created(self) -> Iterator[None]:
        """Create the folder, which is removed if the block fails before anything is in it; URLs need no folder.

        Raises:
            SocialCircleError: the folder cannot be created, or would get the name of a file.
        """
        if self._files is not None:
            yield
            return
        check_folder_name(Path(self.location))
        with folder_of_results(Path(self.location)):
            yield

    def tidy(self) -> None:
        """Remove what killed workers left. What they were to write may be there: another worker has done it."""
        if self._files is None:
            remove_leftovers_below(Path(self.location))

    @contextmanager
    def writing(self) -> Iterator[Path]:
        """A local folder for new results: this one, or one that is copied to the URL at the end of the block.

        Raises:
            SocialCircleError: the results cannot be written to the URL.
        """
        if self._files is None:
            yield Path(self.location)
            return
        with tempfile.TemporaryDirectory(prefix='socialcircle-') as folder:
            yield Path(folder)
            for path in sorted(each for each in Path(folder).rglob('*') if each.is_file()):
                name = path.relative_to(folder).as_posix()
                try:
                    self._files.put_file(str(path), f'{self._top}/{name}')
                except Exception as error:  # noqa: BLE001 - each file system has errors of its own
                    raise self._not_written(name, error) from None

    def read(self, name: str) -> bytes | None:
        """The content of a file; None: there is none.

        Args:
            name: of the file, relative to the folder.

        Raises:
            SocialCircleError: the URL cannot be read.
        """
        if self._files is None:
            try:
                return Path(self.location, name).read_bytes()
            except OSError:
                return None
        try:
            content: bytes = self._files.cat_file(f'{self._top}/{name}')
        except FileNotFoundError:
            return None
        except Exception as error:  # noqa: BLE001 - each file system has errors of its own
            raise self._not_read(name, error) from None
        return content

    def read_all(self, folder: str, suffix: str) -> Iterator[tuple[str, bytes]]:
        """Name and content of all files of a folder with names that end with `suffix`, by their names.

        Raises:
            SocialCircleError: the URL cannot be read.
        """
        if self._files is None:
            names = sorted(path.name for path in Path(self.location, folder).glob(f'*{suffix}'))
            found = ((name, self.read(f'{folder}/{name}')) for name in names)
            yield from ((name, content) for name, content in found if content is not None)
            return
        try:
            paths = [path for path in sorted(self._files.find(f'{self._top}/{folder}')) if path.endswith(suffix)]
            contents: dict[str, bytes] = self._files.cat(paths, on_error='omit') if paths else {}
        except Exception as error:  # noqa: BLE001 - each file system has errors of its own
            raise self._not_read(folder, error) from None
        yield from ((PurePosixPath(path).name, content) for path, content in contents.items())

    def write(self, name: str, content: str) -> None:
        """Write a file; an earlier one of the same name is replaced.

        Raises:
            SocialCircleError: it cannot be written.
        """
        if self._files is None:
            path = Path(self.location, name)
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise SocialCircleError(f'{path.parent} cannot be written: {error.strerror}.') from None
            write_file(path, content)
            return
        try:
            self._files.pipe_file(f'{self._top}/{name}', content.encode())
        except Exception as error:  # noqa: BLE001 - each file system has errors of its own
            raise self._not_written(name, error) from None

    def remove(self, name: str) -> None:
        """Remove a file, if it is there and can be removed."""
        with suppress(Exception):
            if self._files is None:
                Path(self.location, name).unlink()
            else:
                self._files.rm_file(f'{self._top}/{name}')

    def _not_read(self, name: str, error: BaseException) -> SocialCircleError:
        return SocialCircleError(f'{self.location}/{name} cannot be read: {reason_of(error)}')

    def _not_written(self, name: str, error: BaseException) -> SocialCircleError:
        return SocialCircleError(f'{self.location}/{name} cannot be written: {reason_of(error)}')
