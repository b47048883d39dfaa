# SPDX-License-Identifier: Apache-2.0
""".npz archives, as `import` reads them, and .npy arrays of heights."""

import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from socialcircle_ros.errors import ImportFileError
from socialcircle_ros.lengths import metres_per

from .damage import archive_damage_told
from .surface import MeasuredSurface, given_pitch

if TYPE_CHECKING:
    from socialcircle_ros.cloud import PitchLike

    from .fields import PointValues

RESERVED = ('z', 'dx', 'dy', 'x', 'y', 'unit', 'frames', 'metadata', 'file', 'allow_pickle')  # the last: of NumPy
"""Names that no field of an archive can have."""


def write_npz(path: Path, surface: MeasuredSurface) -> None:
    """Write z, dx, dy, unit and metadata, and each field under its name, which is none of `RESERVED`.

    Raises:
        SettingError: the unit is not known; without a unit, the import would take µm.
    """
    metres_per(surface.unit)
    arrays: dict[str, PointValues] = {
        'z': np.ascontiguousarray(surface.heights),
        'dx': np.float64(surface.pitch[0]),  # type: ignore[dict-item]
        'dy': np.float64(surface.pitch[1]),  # type: ignore[dict-item]
    }
    if surface.unit:
        arrays['unit'] = np.array(surface.unit)
    if surface.metadata:
        arrays['metadata'] = np.array(json.dumps(dict(surface.metadata), ensure_ascii=True))
    for name, values in surface.fields.items():
        arrays[name] = np.ascontiguousarray(values)
    with path.open('wb') as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]


def read_npy(path: Path, pitch: 'PitchLike | None', unit: str | None) -> MeasuredSurface:
    """Read heights (rows, columns), to which the caller adds pitch and unit.

    Raises:
        ImportFileError: the file holds something else, or no pitch is given.
    """
    with archive_damage_told(path, 'is not an .npy array of numbers, or is cut off: save it again.'):
        values = np.load(path, allow_pickle=False)
    if not isinstance(values, np.ndarray) or values.ndim != 2 or not values.size or values.dtype.kind not in 'fiu':
        raise ImportFileError(f'{path} holds no array of numbers in rows and columns.')
    return MeasuredSurface(values, given_pitch(path, pitch), unit)
