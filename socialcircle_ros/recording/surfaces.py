# SPDX-License-Identifier: Apache-2.0
"""`read_surface`: heights from any measurement file."""

import warnings
from pathlib import Path

from socialcircle_ros.cloud import PitchLike
from socialcircle_ros.errors import UnitWarning
from socialcircle_ros.formats import MeasuredSurface, OrganizedCloud, read_file, surface_of

from .importers import import_cloud

_OF_IMPORTERS = ('.npz', '.ply', '.pcd')


def read_surface(path: str | Path, *, pitch: PitchLike | None = None, unit: str | None = None) -> MeasuredSurface:
    """Read heights on a regular grid from a measurement file of any format in `docs/formats.md`.

    Args:
        path: the file.
        pitch: dx and dy, for a file that does not state them.
        unit: of a file that does not name it.

    Returns:
        The heights, NaN where not measured, with pitch and unit. A `UnitWarning` says what is taken for a unit
        that the file does not state.

    Raises:
        ImportFileError: the file cannot be used; the message says why and what to do.
        CloudError: the file holds a cloud that is not on a regular grid.
        SettingError: the unit is no text.
    """
    path = Path(path)
    if path.suffix.lower() in _OF_IMPORTERS:
        cloud = import_cloud(path, pitch=pitch, unit=unit)
        found: MeasuredSurface | OrganizedCloud = cloud.organized()
        note = cloud.unit_note
    else:
        found = read_file(path, pitch=pitch, unit=unit)
        note = '' if found.unit else 'does not state its unit, which is not known'
    if note:
        warnings.warn(f'{path} {note.partition(";")[0]}; give it as unit=.', UnitWarning, stacklevel=2)
    return found if isinstance(found, MeasuredSurface) else surface_of(found).surface
