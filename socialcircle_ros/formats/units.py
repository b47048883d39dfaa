"""Units of length: their names in files, their size, and lengths as a person reads them."""

import math

from socialcircle_ros.errors import SettingError

METRES = {'m': 1.0, 'cm': 1e-2, 'mm': 1e-3, 'um': 1e-6, 'nm': 1e-9, 'pm': 1e-12, 'Å': 1e-10, 'inch': 0.0254}
"""The known units and their length in m."""

_SPELLINGS = {
    **{unit.lower(): unit for unit in METRES},
    **dict.fromkeys(('µm', 'μm', 'micron', 'microns', 'micrometer', 'micrometre', 'micrometers'), 'um'),
    **dict.fromkeys(('meter', 'metre', 'meters', 'metres'), 'm'),
    **dict.fromkeys(('millimeter', 'millimetre', 'millimeters'), 'mm'),
    **dict.fromkeys(('nanometer', 'nanometre', 'nanometers'), 'nm'),
    **dict.fromkeys(('angstrom', 'ang', 'å'), 'Å'),
    **dict.fromkeys(('in', '"'), 'inch'),
}

_PREFIXES = ((1.0, 'm'), (1e-3, 'mm'), (1e-6, 'µm'), (1e-9, 'nm'), (1e-12, 'pm'))


def known_unit(text: str | None) -> str | None:
    """The unit that a file means, as `METRES` spells it; None if the file names none, or one that is not known."""
    return None if text is None else _SPELLINGS.get(text.strip().lower())


def metres_per(unit: str | None) -> float:
    """The length of a unit in m.

    Raises:
        SettingError: the unit is not known.
    """
    known = known_unit(unit)
    if known is None:
        what = 'is not named' if unit is None else f'{unit!r} is not known'
        raise SettingError(f'The unit of the coordinates {what}: give one of {", ".join(METRES)}, as --unit.')
    return METRES[known]


def length_text(value: float, unit: str | None) -> str:
    """A length for a person: with a prefix that suits it, or as it is if its unit is not known."""
    if known_unit(unit) is None or not math.isfinite(value):
        return f'{value:.6g} {unit or "(unit not known)"}'
    metres = value * metres_per(unit)
    size, name = next((each for each in _PREFIXES if abs(metres) >= each[0]), _PREFIXES[-1])
    if metres == 0:
        size, name = 1.0, 'm'
    return f'{metres / size:.6g} {name}'
