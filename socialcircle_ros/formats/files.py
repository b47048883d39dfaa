# SPDX-License-Identifier: Apache-2.0
"""Measurement files in and out, by their suffix."""

import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from socialcircle_ros.errors import CloudError, ImportFileError, SettingError, SocialCircleError
from socialcircle_ros.lengths import checked_unit, known_unit, metres_per, unit_name
from socialcircle_ros.storage import check_place, kind_of_target, write_file

from . import archive, esri, lists, points, sdf, tiff, x3p
from .damage import unreadable
from .fields import FileFields, fields_for_file
from .surface import MeasuredSurface, OrganizedCloud, given_pitch, surface_of
from .table import BASE, Format, format_of, suffixes
from .text import check_text
from .vendor import read_vendor_file

if TYPE_CHECKING:
    from socialcircle_ros.cloud import Pitch, PitchLike

_CLOUD_WRITERS: dict[str, Callable[[Path, OrganizedCloud], None]] = {
    '.ply': points.write_ply,
    '.pcd': points.write_pcd,
    '.csv': points.write_text,
    '.xyz': points.write_text,
}
_SURFACE_WRITERS: dict[str, Callable[[Path, MeasuredSurface], None]] = {
    '.npz': archive.write_npz,
    '.x3p': x3p.write_x3p,
    '.sdf': sdf.write_sdf,
    '.tif': tiff.write_tiff,
    '.tiff': tiff.write_tiff,
}


_LISTS = ('.csv', '.xyz', '.txt', '.asc', '.dat')


def read_file(
    path: Path, *, pitch: 'PitchLike | None' = None, unit: str | None = None
) -> MeasuredSurface | OrganizedCloud:
    """Read a file of a format other than .npz, .ply and .pcd, which `recording.importers` reads.

    Args:
        path: of the file.
        pitch: dx and dy, for a file that does not state them.
        unit: of a file that does not name it.

    Raises:
        ImportFileError: the file cannot be used, or its library is not installed; the message says what to do.
        SettingError: the unit is no text.
    """
    unit = checked_unit(unit)
    known = format_of(path)
    if known is None or not known.reads:
        raise ImportFileError(
            f'{path} has an unknown file type: give one of {", ".join(suffixes(written=False))}.'
        )
    distances = None if pitch is None else given_pitch(path, pitch)
    try:
        path.open('rb').close()  # a file that is missing or may not be read is told here, not by a library
        found = _read(path, known, distances, unit)
    except OSError as error:
        raise unreadable(path, error) from None
    except (CloudError, SettingError) as error:  # such as a pitch of 0 or a unit with control characters
        raise ImportFileError(f'{path} cannot be used: {error}') from None
    if unit is not None and found.unit is None:
        found = replace(found, unit=unit)
    check_given(path, found, distances, unit)
    return found


def check_given(
    path: Path, found: MeasuredSurface | OrganizedCloud, pitch: 'Pitch | None', unit: str | None
) -> None:
    """See that what the caller says of a file does not contradict the file.

    Raises:
        ImportFileError: the file states another pitch or unit.
    """
    if pitch is not None and found.pitch != pitch:
        raise ImportFileError(f'{path} states its own coordinates: leave the pitch out.')
    if unit is not None and known_unit(found.unit) != known_unit(unit):
        stated = f'is in {unit_name(found.unit)}' if found.unit else 'does not state its unit'
        raise ImportFileError(f'{path} {stated}, not in {unit_name(unit)}: leave the unit out.')


def _read(path: Path, known: Format, pitch: 'Pitch | None', unit: str | None) -> MeasuredSurface | OrganizedCloud:
    suffix = path.suffix.lower()
    if suffix == '.x3p':
        return x3p.read_x3p(path)
    if suffix == '.sdf':
        return sdf.read_sdf(path)
    if suffix in ('.tif', '.tiff'):
        return tiff.read_tiff(path, pitch, unit)
    if suffix == '.npy':
        return archive.read_npy(path, pitch, unit)
    if suffix in _LISTS:
        check_text(path)
        if esri.is_esri_grid(path):
            return esri.read_esri_grid(path)
    if suffix in ('.csv', '.xyz') and points.is_own_text(path):
        return points.read_text(path)
    if suffix == '.csv' and points.is_matrix(path):
        return points.read_matrix(path, pitch, unit)
    wanted = pitch is not None and suffix != '.xyz'
    if suffix in _LISTS and (found := lists.read_list(path, matrix_wanted=wanted)) is not None:
        return found
    if suffix == '.csv' and wanted and points.is_matrix(path, least=3):
        return points.read_matrix(path, pitch, unit)
    if known.reads == BASE:
        raise lists.no_list(path)
    if suffix in _LISTS and (matrix := points.read_bare_matrix(path, pitch, unit)) is not None:
        return matrix
    return read_vendor_file(path, known.readers, pitch, unit)


def write_surface(path: str | Path, surface: MeasuredSurface, *, overwrite: bool = False) -> tuple[str, ...]:
    """Write a surface into a file; the suffix names the format.

    Args:
        path: the file: .npz, .ply, .pcd, .x3p, .sdf, .tiff, .csv or .xyz.
        surface: the heights, their pitch and unit.
        overwrite: whether to replace an existing file.

    Returns:
        One sentence for each thing that the format cannot hold; none if it holds all.

    Raises:
        CloudError: this is no surface, or the data type of its heights does not hold its coordinates.
        SettingError: the format is always in m, and the unit of the surface is not known.
        SocialCircleError: the format is not known, or the file exists already or cannot be written.
    """
    path = Path(path)
    form = _writable(path)
    if not isinstance(surface, MeasuredSurface):
        raise CloudError(f'A surface is MeasuredSurface(heights, pitch, unit), not {type(surface).__name__}.')
    if form.any_points:
        return write_cloud_file(path, surface.cloud(), overwrite=overwrite)
    fitted, notes = _fitted(form, path.suffix.lower(), surface)
    _written(path, overwrite, lambda partial: _SURFACE_WRITERS[path.suffix.lower()](partial, fitted))
    return notes


def write_cloud_file(path: str | Path, cloud: OrganizedCloud, *, overwrite: bool = False) -> tuple[str, ...]:
    """Write an organized cloud into a file; the suffix names the format.

    Returns:
        One sentence for each thing that the format cannot hold.

    Raises:
        CloudError: this is no cloud; or the format holds height maps only, and the points are not on a regular
            grid.
        SettingError, SocialCircleError: as `write_surface`.
    """
    path = Path(path)
    if not isinstance(cloud, OrganizedCloud):
        raise CloudError(f'A cloud for a file is OrganizedCloud(points, unit), not {type(cloud).__name__}.')
    if _writable(path).any_points:
        fields = _fields(path.suffix.lower(), cloud)
        fitted = replace(cloud, fields=fields.by_name)
        _written(path, overwrite, lambda partial: _CLOUD_WRITERS[path.suffix.lower()](partial, fitted))
        return fields.notes
    flat = surface_of(cloud)
    return flat.notes + write_surface(path, flat.surface, overwrite=overwrite)


def _writable(path: Path) -> Format:
    form = format_of(path)
    if form is None or not form.writes:
        raise SocialCircleError(
            f'{path} cannot be written: its suffix must be one of {", ".join(suffixes(written=True))}.'
        )
    return form


def _fitted(form: Format, suffix: str, surface: MeasuredSurface) -> tuple[MeasuredSurface, tuple[str, ...]]:
    """The surface as the format holds it, and what it does not hold."""
    notes = []
    if form.metres and known_unit(surface.unit) != 'm':
        factor = metres_per(surface.unit)
        heights = surface.heights.astype(np.float64) * factor
        pitch = (surface.pitch[0] * factor, surface.pitch[1] * factor)
        stated = unit_name(surface.unit or '')
        notes.append(f'{suffix} is always in m: the lengths are converted from {stated}, in float64.')
        surface = replace(surface, heights=heights, pitch=pitch, unit='m')
    if not form.double:
        with np.errstate(over='ignore'):
            single = surface.heights.astype(np.float32)
        if not np.array_equal(single.astype(surface.heights.dtype), surface.heights, equal_nan=True):
            notes.append(f'{suffix} holds float32: the heights are rounded from {surface.heights.dtype}.')
        surface = replace(surface, heights=single)
    if surface.fields and not form.fields:
        notes.append(f'{suffix} holds heights only: {", ".join(surface.fields)} is left out.')
        surface = replace(surface, fields={})
    fields = _fields(suffix, surface)
    return replace(surface, fields=fields.by_name), (*notes, *fields.notes)


def _fields(suffix: str, surface: MeasuredSurface | OrganizedCloud) -> FileFields:
    """The fields as the format holds them."""
    if suffix == '.npz':
        return fields_for_file(surface.fields, archive.RESERVED, str.isprintable)
    return fields_for_file(surface.fields, points.RESERVED, points.is_allowed)


def _written(path: Path, overwrite: bool, write: Callable[[Path], None]) -> None:
    """Write a file in a temporary folder first, so that it is whole or not there.

    Raises:
        SocialCircleError: it exists already, or cannot be written.
    """
    if kind_of_target(path) == 'a file' and not overwrite:
        raise SocialCircleError(f'{path} exists already: give --overwrite to replace it.')
    check_place(path)
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder) / path.name
        try:
            write(whole)
        except OSError as error:
            raise SocialCircleError(f'{path} cannot be written: {error.strerror or error}.') from None
        write_file(path, whole.read_bytes())
