# SPDX-License-Identifier: Apache-2.0
"""Files of instruments, read by SurfaceTopography (MIT)."""

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import replace
from datetime import datetime
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.cloud import HeightMap, Pitch
from socialcircle_ros.errors import ImportFileError, install_command
from socialcircle_ros.lengths import known_unit

from .matrix import check_labels, check_rows
from .surface import MATRIX, SOURCE_FORMAT, MeasuredSurface, given_pitch
from .text import without_mark


def read_vendor_file(
    path: Path, readers: tuple[str, ...], pitch: Pitch | None, unit: str | None
) -> MeasuredSurface:
    """Read the first height map of a file.

    Args:
        path: of the file.
        readers: the names of the library's formats that the suffix may mean, the likeliest first.
        pitch: dx and dy of a file that does not have them.
        unit: of a file that does not name it.

    Raises:
        ImportFileError: the library is missing or cannot read the file, or the file has no height map.
    """
    try:
        from SurfaceTopography.IO import open_topography  # noqa: PLC0415 - an extra
    except ImportError:
        raise ImportFileError(f'{path} needs SurfaceTopography: {install_command("formats")}.') from None
    reasons = []
    with without_mark(path) as plain:
        for name in readers:
            found = _attempt(path, partial(open_topography, str(plain), format=name), pitch, unit)
            if isinstance(found, MeasuredSurface):
                if name != 'asc':
                    return found
                check_rows(path)
                check_labels(path, found.heights)
                return replace(found, metadata={**found.metadata, SOURCE_FORMAT: MATRIX})
            reasons.append(f'{name}: {found}')
    raise ImportFileError(
        f'{path} cannot be read as {" or ".join(readers)}: it is damaged, or of a variant that is not known'
        f' ({"; ".join(reasons)}). Export it as x3p or sdf with the program of the instrument.'
    )


def _attempt(
    path: Path,
    opened: Callable[[], AbstractContextManager[object]],
    pitch: Pitch | None,
    unit: str | None,
) -> MeasuredSurface | str:
    """The first height map, or why the library cannot read the file.

    Raises:
        ImportFileError: the file was read, but cannot be used.
    """
    try:
        with opened() as reader:
            return _first_surface(path, reader.channels, pitch, unit)  # type: ignore[attr-defined]
    except ImportFileError:
        raise
    except Exception as error:  # noqa: BLE001 - for a damaged file the library raises errors of many kinds
        return (str(error).strip() or type(error).__name__).splitlines()[0].rstrip('.')


def _first_surface(path: Path, channels: list[object], pitch: Pitch | None, unit: str | None) -> MeasuredSurface:
    heights = [each for each in channels if getattr(each, 'dim', None) == 2 and _is_height(each)]
    if not heights:
        raise ImportFileError(f'{path} has no height map among its {len(channels)} channels.')
    channel = heights[0]
    stated = getattr(channel, 'physical_sizes', None)
    given = given_pitch(path, pitch) if stated is None else None
    columns, rows = channel.nb_grid_pts  # type: ignore[attr-defined]
    arguments = {} if given is None else {'physical_sizes': (columns * given[0], rows * given[1])}
    topography = channel.topography(**arguments)  # type: ignore[attr-defined]
    if not getattr(topography, 'is_uniform', True):
        raise ImportFileError(f'{path} has points that are not on a regular grid: export it as a height map.')
    read = np.ma.filled(np.ma.masked_invalid(topography.heights()).astype(np.float64), np.nan)
    if path.suffix.lower() == '.nms':
        read[read > _stated_top(topography.info)] = np.nan
    values = _small(read.T)  # the library has x first
    found = given or tuple(float(each) for each in topography.pixel_size)
    found_unit = known_unit(topography.unit) or topography.unit or unit
    metadata = {'source': path.name, 'channel': str(getattr(channel, 'name', ''))}
    instrument = topography.info.get('instrument') if hasattr(topography.info, 'get') else None
    measured = topography.info.get('acquisition_time') if hasattr(topography.info, 'get') else None
    if isinstance(measured, datetime):
        metadata['date'] = measured.isoformat(timespec='seconds')
    if isinstance(instrument, dict):
        metadata |= {f'instrument {key}': str(value) for key, value in instrument.items()}
    return MeasuredSurface(values, found, found_unit, {}, metadata)


def _stated_top(info: Mapping[str, object]) -> float:
    """Half a step above the greatest height of an NMS file, 65534; 65535, which is not measured, lies above it."""
    header = info.get('raw_metadata')
    low, high = (header.get(key) for key in ('zmin', 'zmax')) if isinstance(header, Mapping) else (None, None)
    if not isinstance(low, float) or not isinstance(high, float):
        return np.inf
    return high + (high - low) / 2**17


def _is_height(channel: object) -> bool:
    kind = getattr(channel, 'data_kind', None)
    return kind is None or getattr(kind, 'value', kind) == 'height'


def _small(heights: NDArray[np.float64]) -> HeightMap:
    """The heights in float32 where that holds every one of them, as it does where the file is in float32."""
    with np.errstate(over='ignore'):
        single = heights.astype(np.float32)
    exact = np.array_equal(single.astype(np.float64), heights, equal_nan=True)
    return np.ascontiguousarray(single if exact else heights)
