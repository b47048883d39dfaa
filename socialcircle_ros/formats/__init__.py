# SPDX-License-Identifier: Apache-2.0
"""Measurement files of other programs: which formats there are, and heights and clouds in and out of them.

`.npz`, `.ply` and `.pcd` are read by `recording.importers`. Nothing here knows recordings or messages.
"""

from .files import check_given, read_file, write_cloud_file, write_surface
from .surface import MeasuredSurface, OrganizedCloud, surface_of
from .table import FORMATS, Format, format_of, formats_table, suffixes
from .times import stated_time

__all__ = [
    'FORMATS',
    'Format',
    'MeasuredSurface',
    'OrganizedCloud',
    'check_given',
    'format_of',
    'formats_table',
    'read_file',
    'stated_time',
    'suffixes',
    'surface_of',
    'write_cloud_file',
    'write_surface',
]
