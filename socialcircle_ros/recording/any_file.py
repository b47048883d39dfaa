# SPDX-License-Identifier: Apache-2.0
"""Opening whatever holds clouds: a recording, or a measurement file, which is imported first."""

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from tempfile import TemporaryDirectory

from socialcircle_ros.errors import UnitWarning
from socialcircle_ros.formats import format_of

from . import reader
from .create import record_clouds
from .importers import ImportedCloud
from .origins import FileOrigin

_listener: ContextVar[Callable[[str], None] | None] = ContextVar('_listener', default=None)


def open_recording(path: str | Path) -> reader.RecordingReader:
    """Open a recording, or a measurement file as a recording of one cloud on `/points`, in m.

    A warning of the class `UnitWarning` says what is taken for a unit that a measurement file does not state.

    Args:
        path: an MCAP file, a rosbag2 directory, or a file that `import_cloud` reads.

    Raises:
        RecordingError: as `reader.open_recording`.
        ImportFileError: the measurement file cannot be used.
    """
    path = Path(path)
    if not is_measurement_file(path):
        return reader.open_recording(path)
    with TemporaryDirectory(prefix='socialcircle-') as folder:
        imported = Path(folder) / f'{path.stem}.mcap'
        record_clouds([path], imported, keep_changed=False, written=_tell)  # a copy has another time
        # The opened file stays readable after its name is gone.
        opened = reader.open_recording(imported)
    opened.path = path
    return opened


@contextmanager
def units_told_to(tell: Callable[[str], None]) -> Iterator[None]:
    """Tell the caller what `open_recording` takes for a unit in this thread, instead of warning.

    Collected warnings get lost in a thread: those of a process have one list of filters and one place where they
    go, which other threads set and put back meanwhile.

    Args:
        tell: called with the sentence of each warning.
    """
    before = _listener.set(tell)
    try:
        yield
    finally:
        _listener.reset(before)


def _tell(path: Path, cloud: ImportedCloud, _: FileOrigin) -> None:
    if not cloud.unit_note:
        return
    sentence, listener = f'{path} {cloud.unit_note}.', _listener.get()
    if listener is None:
        warnings.warn(sentence, UnitWarning, stacklevel=1)
    else:
        listener(sentence)


def is_measurement_file(path: Path) -> bool:
    """Whether the suffix of a path is that of a format of measurement files, and not of a recording."""
    form = format_of(path)
    return form is not None and bool(form.reads) and not path.is_dir()
