# SPDX-License-Identifier: Apache-2.0
"""Units of length: their names in files, their size, and lengths as a person reads them.

Lengths are shown with the SI prefix that suits them. A unit that is not known is said, never guessed.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .digits import decimal_text, exponent_of, fixed_text, number_text, power_of_ten, without_zeros
from .errors import SettingError

if TYPE_CHECKING:
    from matplotlib.axis import Axis

Lengths = NDArray[np.float32] | NDArray[np.float64]
"""Lengths in one unit, of any shape."""

METRES = {'m': 1.0, 'cm': 1e-2, 'mm': 1e-3, 'um': 1e-6, 'nm': 1e-9, 'pm': 1e-12, 'Å': 1e-10, 'inch': 0.0254}
"""The known units and their length in m."""

NOT_KNOWN = 'unit not known'

_SPELLINGS = {
    **{unit.lower(): unit for unit in METRES},
    **dict.fromkeys(('µm', 'μm', 'micron', 'microns', 'micrometer', 'micrometre', 'micrometers'), 'um'),
    **dict.fromkeys(('meter', 'metre', 'meters', 'metres'), 'm'),
    **dict.fromkeys(('millimeter', 'millimetre', 'millimeters'), 'mm'),
    **dict.fromkeys(('nanometer', 'nanometre', 'nanometers'), 'nm'),
    **dict.fromkeys(('angstrom', 'ang', 'å'), 'Å'),
    **dict.fromkeys(('in', '"'), 'inch'),
}

_PREFIXES = {0: 'm', -3: 'mm', -6: 'µm', -9: 'nm', -12: 'pm'}
_DIGITS = 4  # of the largest length of a series
_DIGITS_OF_A_RANGE = 6
_SAME = 6  # digits: values closer than that to the next prefix take it
_MOST_ZEROS = 2  # before the digits of the largest length of a series
_WHOLE = 1e-9  # relative deviation of a whole number of units in a metre


def known_unit(text: str | None) -> str | None:
    """The unit that a file means, as `METRES` spells it; None if the file names none, or one that is not known."""
    return None if text is None else _SPELLINGS.get(text.strip().lower())


def checked_unit(unit: object) -> str | None:
    """The unit that a caller gives.

    Raises:
        SettingError: it is no text of one line, and not None.
    """
    if unit is not None and not (isinstance(unit, str) and unit.isprintable()):
        raise SettingError(f"The unit is {unit!r}; give a text, such as 'um' or 'mm', or None if it is not known.")
    return unit


def unit_name(unit: str) -> str:
    """A unit as a person reads it: µm for um."""
    return 'µm' if known_unit(unit) == 'um' else unit


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


def to_metres(values: Lengths, unit: str) -> Lengths:
    """Lengths in m, in their own data type, each the nearest number that the type has.

    Raises:
        SettingError: the unit is not known.
    """
    return _converted(values, metres_per(unit), back=False)


def from_metres(values: Lengths, unit: str) -> Lengths:
    """Lengths in m in another unit: the reverse of `to_metres`, up to one unit in the last place.

    Raises:
        SettingError: the unit is not known.
    """
    return _converted(values, metres_per(unit), back=True)


def _converted(values: Lengths, metres: float, *, back: bool) -> Lengths:
    real: NDArray[np.float64] = values.astype(np.float64)
    whole = round(1 / metres)
    # A whole number is exact, and its reciprocal is not: so the result is rounded once.
    if abs(whole * metres - 1) < _WHOLE:
        real = real * whole if back else real / whole
    else:
        real = real / metres if back else real * metres
    return cast('Lengths', real.astype(values.dtype))


@dataclass(frozen=True)
class LengthScale:
    """How the lengths of one series, axis or colour bar are shown: all with the same prefix.

    Attributes:
        factor: from the unit of the values to the one that is shown.
        name: of the unit that is shown, such as µm; `NOT_KNOWN` where it is not known.
        decimals: of numbers as large as the largest of the series.
    """

    factor: float
    name: str
    decimals: int

    def number(self, value: float) -> str:
        """A length without its unit; – for NaN. A small value does not become 0: it has more decimals."""
        return decimal_text(float(value) * self.factor, self.decimals)

    def decimals_of(self, values: ArrayLike) -> int:
        """The decimals that show some lengths of the series, such as those of one column, with four digits."""
        lengths = np.abs(np.asarray(values, np.float64)) * self.factor
        largest = float(lengths.max(where=np.isfinite(lengths), initial=0.0))
        return _decimals(_DIGITS, exponent_of(largest, _SAME)) if largest else self.decimals

    def text(self, value: float) -> str:
        """A length with its unit, such as 12.4 µm."""
        return f'{self.number(value)} {_after_number(self.name)}'

    def label(self, quantity: str) -> str:
        """The label of an axis, a colour bar or a column, such as x [µm]."""
        return f'{quantity} [{self.name}]'

    def label_axis(self, axis: 'Axis', quantity: str) -> None:
        """Label a matplotlib axis whose values are in the unit of the series; `bar.ax.yaxis` is a colour bar's."""

        def tick(value: float, _: float) -> str:
            """One tick, with the decimals that tell it from its neighbours."""
            steps = np.diff(np.unique(np.asarray(axis.get_majorticklocs(), np.float64))) * self.factor
            return fixed_text(value * self.factor, _decimals_of_step(float(steps.min()) if steps.size else 1.0))

        axis.set_major_formatter(tick)
        axis.set_label_text(self.label(quantity))


def length_scale(values: ArrayLike, unit: str | None, *, digits: int = _DIGITS) -> LengthScale:
    """Choose the prefix for a series of lengths: that of its largest value.

    Args:
        values: the lengths, in any shape; those that are not finite do not count.
        unit: of the values, in any spelling; None: not known.
        digits: significant digits of the largest value.
    """
    lengths = np.abs(np.asarray(values, np.float64))
    largest = float(lengths.max(where=np.isfinite(lengths), initial=0.0))
    known = known_unit(unit)
    metres = largest * (METRES[known] if known else 1.0)
    exponent = exponent_of(metres, _SAME) if metres else 0
    thousands = exponent // 3 * 3
    if known:
        power = min(max(thousands, min(_PREFIXES)), 0) if metres else _power_of(known)
        name = _PREFIXES[power]
    else:
        # An unknown unit has no prefix: a power of ten keeps numbers short, where they would not be.
        power = 0 if -2 <= exponent < 5 else thousands
        ten = '' if power == 0 else power_of_ten(power)
        name = f'{ten} {unit}'.strip() if unit else '; '.join(filter(None, (ten, NOT_KNOWN)))
    factor = (METRES[known] if known else 1.0) * 10.0**-power
    return LengthScale(factor, name, _decimals(digits, exponent - power))


def length_text(value: float, unit: str | None, *, digits: int = 3) -> str:
    """One length for a person, such as 12.4 µm or −3 nm; without trailing zeros.

    Args:
        value: the length.
        unit: of the value; None: not known, and the text says so.
        digits: significant digits.
    """
    if known_unit(unit) is None:
        return f'{number_text(value, digits, padded=False)} {_after_number(unit or NOT_KNOWN)}'
    scale = length_scale(_rounded(value, digits), unit, digits=digits)
    return f'{without_zeros(scale.number(value))} {_after_number(scale.name)}'


def range_text(low: float, high: float, unit: str | None, *, separator: str = ' to ') -> str:
    """A range of lengths for a person, with one prefix, such as −482.018 to 347.481 nm; without trailing zeros."""
    rounded = [_rounded(each, _DIGITS_OF_A_RANGE) for each in (low, high)]
    scale = length_scale(rounded, unit, digits=_DIGITS_OF_A_RANGE)
    numbers = (without_zeros(scale.number(each)) for each in rounded)
    return f'{separator.join(numbers)} {_after_number(scale.name)}'


def _after_number(name: str) -> str:
    return f'({name})' if name.endswith(NOT_KNOWN) else name


def _power_of(unit: str) -> int:
    """The prefix for 0: the unit itself, or the next larger prefix."""
    return next(power for power in sorted(_PREFIXES) if 10.0**power >= METRES[unit] * (1 - 1e-9) or power == 0)


def _decimals(digits: int, exponent: int) -> int:
    """The decimals of numbers up to a power of ten; few enough for a table where no unit is as small."""
    return min(max(0, digits - 1 - exponent), digits + _MOST_ZEROS)


def _rounded(value: float, digits: int) -> float:
    return float(f'{value:.{digits - 1}e}')


def _decimals_of_step(step: float) -> int:
    """The decimals that write a step of ticks, such as 2 for 0.25."""
    if not 0 < step < math.inf:
        return 0
    digits = f'{_rounded(step, 3):.2e}'
    mantissa = digits.partition('e')[0].rstrip('0')
    return max(0, len(mantissa) - 2 - int(digits.partition('e')[2]))
