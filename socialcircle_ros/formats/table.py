# SPDX-License-Identifier: Apache-2.0
"""The table of formats: which files are read and written, by what, and what they cannot hold."""

from dataclasses import dataclass
from pathlib import Path

from socialcircle_ros.settings import markdown_table

BASE, PILLOW, LIBRARY = 'base install', 'Pillow', 'SurfaceTopography'


@dataclass(frozen=True)
class Format:
    """A format of measurement files.

    Attributes:
        suffixes: of its files, in lower case.
        name: of the format; what may vary, after a semicolon.
        reads: what reads it: the base install or a library of an extra; '': nothing.
        writes: what writes it; '': nothing.
        readers: the names of the format in SurfaceTopography, the likeliest first.
        any_points: whether it holds any coordinates; else only heights on a regular grid.
        fields: whether it holds further values of each point, such as intensity and the mask.
        double: whether it holds float64.
        metres: whether its unit is always m.
        exact: what a round trip import → export → import keeps.
    """

    suffixes: tuple[str, ...]
    name: str
    reads: str
    writes: str = ''
    readers: tuple[str, ...] = ()
    any_points: bool = False
    fields: bool = False
    double: bool = True
    metres: bool = False
    exact: str = ''

    @property
    def title(self) -> str:
        """The name without what may vary."""
        return self.name.partition(';')[0]

    def lacks(self) -> str:
        """What a written file cannot hold."""
        if not self.writes:
            return ''
        lacking = [
            ('points off a regular grid, another origin than 0', self.any_points),
            ('fields; `export` writes the mask as a PNG beside it', self.fields),
            ('float64: rounded to float32, with a note', self.double),
            ('another unit than m: converted, with a note', not self.metres),
        ]
        return '; '.join(text for text, held in lacking if not held) or 'nothing'


def _vendor(suffixes: str, name: str, readers: str) -> Format:
    return Format(tuple(suffixes.split()), name, LIBRARY, readers=tuple(readers.split()))


_ALL = 'yes: every coordinate and field'
_GRID = 'yes: heights and pitch'

FORMATS = (
    Format(('.npz',), 'NumPy archive, height map', BASE, BASE, fields=True, exact=_GRID + ', fields'),
    Format(('.ply',), 'PLY, organized', BASE, BASE, any_points=True, fields=True, exact=_ALL),
    Format(('.pcd',), 'PCD, organized', BASE, BASE, any_points=True, fields=True, exact=_ALL),
    Format(('.x3p',), 'ISO 25178-72', BASE, BASE, metres=True, exact=_GRID + ' in m'),
    Format(('.sdf',), 'ISO 25178-71; text and binary, written as text', BASE, BASE, metres=True,
           exact=_GRID + ' in m'),
    Format(('.tif', '.tiff'), 'TIFF with heights, as GeoTIFF', PILLOW, PILLOW, double=False,
           exact=_GRID + ' in float32'),
    Format(('.csv', '.xyz'),
           'text; x, y and z per line, also without points not measured, or a matrix with commas', BASE, BASE,
           readers=('xyz',), any_points=True, fields=True, exact=_ALL),
    _vendor('.txt .asc',
            'text; a matrix of heights with a header; or one without, x, y and z per line, or an ASCII grid of '
            'ESRI, which need no library',
            'asc'),
    Format(('.npy',), 'NumPy array of heights (rows, columns)', BASE),
    _vendor('.al3d', 'Alicona', 'al3d'),
    _vendor('.opd', 'Wyko', 'opd'),
    _vendor('.opdx', 'Bruker, Dektak', 'opdx'),
    _vendor('.dat', 'Zygo MetroPro; or text, as .txt', 'metropro asc'),
    _vendor('.datx', 'Zygo Mx', 'datx'),
    _vendor('.plu', 'Sensofar', 'plu'),
    _vendor('.plux', 'Sensofar', 'plux'),
    _vendor('.sur', 'Digital Surf', 'sur'),
    _vendor('.nms', 'NanoFocus', 'nms'),
    _vendor('.vk3 .vk4 .vk6 .vk7', 'Keyence', 'vk'),
    _vendor('.os3d', 'OmniSurf3D', 'os3d'),
)  # fmt: skip
"""Every format of measurement files."""


def format_of(path: Path) -> Format | None:
    """The format that the suffix of a file means; None if it means none."""
    suffix = path.suffix.lower()
    return next((each for each in FORMATS if suffix in each.suffixes), None)


def suffixes(*, written: bool) -> tuple[str, ...]:
    """The suffixes of the formats that are read, or of those that are written."""
    return tuple(
        suffix for each in FORMATS if (each.writes if written else each.reads) for suffix in each.suffixes
    )


def formats_table() -> dict[str, str]:
    """The Markdown table of `docs/formats.md`, by its name."""
    rows = [
        (
            ', '.join(f'`{suffix}`' for suffix in each.suffixes),
            each.name,
            each.reads or 'no',
            each.writes or 'no',
            each.exact or '-',
            each.lacks() or '-',
        )
        for each in FORMATS
    ]
    titles = ('file', 'format', 'read by', 'written by', 'round trip exact', 'what a written file does not hold')
    return {'formats': markdown_table(titles, rows)}
