# SPDX-License-Identifier: Apache-2.0
"""Opening whatever holds clouds: a recording, or a measurement file, which is imported first."""

import warnings
from pathlib import Path
from tempfile import TemporaryDirectory

from socialcircle_ros.errors import UnitWarning
from socialcircle_ros.formats import format_of

from . import reader
from .create import record_clouds
from .importers import ImportedCloud
from .origins import FileOrigin


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
        record_clouds([path], imported, keep_changed=False, written=_warn)  # a copy has another time
        # The opened file stays readable after its name is gone.
        opened = reader.open_recording(imported)
    opened.path = path
    return opened


def _warn(path: Path, cloud: ImportedCloud, _: FileOrigin) -> None:
    if cloud.unit_note:
        warnings.warn(f'{path} {cloud.unit_note}.', UnitWarning, stacklevel=1)


def is_measurement_file(path: Path) -> bool:
    """Whether the suffix of a path is that of a format of measurement files, and not of a recording."""
    form = format_of(path)
    return form is not None and bool(form.reads) and not path.is_dir()
