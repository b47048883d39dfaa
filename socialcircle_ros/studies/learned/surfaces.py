# SPDX-License-Identifier: Apache-2.0
"""The measured surfaces: which ones there are, and which ones the packaged weights were never trained on."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from socialcircle_ros.recording import import_cloud
from socialcircle_ros.studies.adaptive.inserted_outliers import StudiedSurface, measured_surface
from socialcircle_ros.studies.comparison.measured import MeasuredCloud

HELD_OUT = {
    'zygo_fizeau': 'Zygo laser interferometer (Fizeau)',
    'wli_a48_10x': 'optical profiler (white-light interferometer), BCR export',
    'frt_wafer1': 'FRT MicroProf, chromatic confocal point sensor',
    'nanovea_test1': 'Nanovea, chromatic confocal profilometer',
    'sick_wheel': 'laser line profiler of 100.3 µm pitch (others of its maker are in the training)',
    'afm_dimv_500nm': 'Bruker Dimension V, atomic force microscope',
    'afm_dimv_10um': 'Bruker Dimension V, atomic force microscope',
    'afm_driveafm': 'Nanosurf DriveAFM, atomic force microscope',
}
"""Surfaces that the packaged weights were never trained on, and their instruments."""
DEVELOPMENT = (
    'alicona_fv_al3d1', 'alicona_fv_rubber', 'nanofocus_confocal_bullet_bullet1_land1', 'nanofocus_nms_1',
    'wyko_opd_st1', 'wyko_opd_sz2', 'zygo_dat_metropro1',
)  # fmt: skip
"""Surfaces on which the rules and the thresholds were chosen."""

INSTRUMENTS = {
    'afm_anasys': 'Anasys AFM',
    'afm_cells_mi': 'Agilent AFM',
    'afm_cypher': 'Asylum AFM',
    'afm_d3100': 'Bruker AFM',
    'afm_dimv': 'Bruker AFM',
    'afm_driveafm': 'Nanosurf AFM',
    'afm_icon': 'Bruker AFM',
    'afm_nsf': 'Nanosurf AFM',
    'afm_slippy': 'AFM of an unknown maker',
    'afm_stp': 'Agilent AFM',
    'afm_uncd': 'Bruker AFM',
    'alicona': 'Alicona focus variation',
    'frt': 'FRT confocal sensor',
    'gelsight': 'GelSight photometric',
    'nanofocus': 'NanoFocus confocal',
    'nanovea': 'Nanovea confocal sensor',
    'sick': 'SICK line profiler',
    'stm': 'Createc STM',
    'wli': 'white-light profiler',
    'wyko': 'Wyko interferometer',
    'zygo': 'Zygo interferometer',
}
"""Instruments by the beginning of a surface's name. The models of a maker are one instrument here, so that none of
them helps with another; Molecular Imaging belonged to Agilent."""


def instrument_of(name: str) -> str:
    """The instrument of a surface; for a surface that is not known, its name."""
    return next((instrument for start, instrument in INSTRUMENTS.items() if name.startswith(start)), name)


class SurfaceFile(NamedTuple):
    """A file of a measured surface, and its number of points."""

    path: Path
    points: int


def surface_files(folder: Path) -> list[SurfaceFile]:
    """The height maps of the data folder and of its `training/`; focus stacks are skipped.

    Args:
        folder: of `.npz` files, as its README describes them.
    """
    files = []
    for path in [*sorted(folder.glob('*.npz')), *sorted((folder / 'training').glob('*.npz'))]:
        with np.load(path) as arrays:
            if 'frames' not in arrays:
                files.append(SurfaceFile(path, int(arrays['z'].size) if 'z' in arrays else 0))
    return files


def read_surface(path: Path) -> StudiedSurface:
    """Read one height map, and measure its noise and its spikes."""
    cloud = import_cloud(path)
    return measured_surface(MeasuredCloud(path.stem, cloud.points, cloud.unit or ''))


def read_surfaces(folder: Path) -> list[StudiedSurface]:
    """Read all of `surface_files`."""
    return [read_surface(file.path) for file in surface_files(folder)]
