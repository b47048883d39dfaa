# SPDX-License-Identifier: Apache-2.0
"""Numbers as a person reads them: true digits, a true minus sign, and no 0 or 100 % that is none.

Lengths, which have units, are those of `lengths`.
"""

import math
from collections.abc import Callable

LEAST_DIGITS = 2
"""Significant digits of a value for which the decimals of its series are too few."""

_PLAIN = range(-5, 6)  # exponents of numbers that are written without a power of ten
_MOST_DECIMALS = LEAST_DIGITS - 1 - min(_PLAIN)  # of numbers that would become 0 with those of their series
_DIGITS_OF_A_DOUBLE = 17  # tell any two apart
_SUPERSCRIPTS = str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹')


def fixed_text(value: float, decimals: int) -> str:
    """A number with decimals and a true minus sign; no negative zero."""
    text = f'{value:.{max(0, decimals)}f}'
    if float(text) == 0:
        text = text.lstrip('-')
    return text.replace('-', '−')


def decimal_text(value: float, decimals: int) -> str:
    """A number with decimals, and more of them or a power of ten where it would become 0; – for NaN."""
    if not math.isfinite(value):
        return _not_finite(value)
    least = _least_decimals(value) if value else 0
    if least > max(decimals, _MOST_DECIMALS):
        return number_text(value, LEAST_DIGITS)
    return fixed_text(value, max(decimals, least))


def number_text(value: float, digits: int = 3, *, padded: bool = True, scientific: bool = False) -> str:
    """A number with significant digits, such as 0.0254, 13,117 or 2.50 × 10⁻⁷; – for NaN.

    Args:
        value: the number.
        digits: significant digits; whole digits are all shown.
        padded: whether zeros at the end of the decimals stay, as of a measured value.
        scientific: whether the number has a power of ten although it is short without one.
    """
    if not math.isfinite(value):
        return _not_finite(value)
    if value == 0:
        return '0'
    exponent = exponent_of(value, digits)
    if exponent in _PLAIN and not scientific:
        text, power = f'{value:,.{max(0, digits - 1 - exponent)}f}', ''
    else:
        text, power = f'{value:.{digits - 1}e}'.partition('e')[0], f' × {power_of_ten(exponent)}'
    if not padded:
        text = without_zeros(text)
    return f'{text}{power}'.replace('-', '−')


def without_zeros(text: str) -> str:
    """A number without zeros at the end of its decimals."""
    number, times, power = text.partition(' × ')
    return f'{number.rstrip("0").rstrip(".")}{times}{power}' if '.' in number else text


def share_text(share: float, decimals: int = 2, *, signed: bool = False, padded: bool = True) -> str:
    """A share of a whole as percent, such as 4.96 %; – for NaN.

    Only nothing is 0 %, and only all is 100 %: a share that would round to them has more decimals or a power of
    ten.

    Args:
        share: such as 0.0496.
        decimals: of the percent, where they suffice.
        signed: whether a positive share has a sign, as a change has.
        padded: whether zeros at the end of the decimals stay, as of a measured value.
    """
    percent = 100 * share
    if not math.isfinite(percent):
        return _not_finite(percent)
    if percent == 0 or abs(percent) == 100:
        decimals = 0
    gap = abs(abs(percent) - 100)
    if gap and float(f'{gap:.{decimals}f}') == 0:
        decimals = _least_decimals(gap)
    rounds_to_0 = float(f'{percent:.{decimals}f}') == 0
    sign = '+' if signed and percent > 0 else ''
    text = decimal_text(percent, decimals) if rounds_to_0 else fixed_text(percent, decimals)
    return f'{sign}{text if padded else without_zeros(text)} %'


def unlike_texts(one: float, other: float, text: Callable[[float, int], str], digits: int) -> tuple[str, str]:
    """Two numbers that a sentence compares: alike only if they are equal.

    Args:
        one: the number.
        other: what it is compared with.
        text: writes a number with some digits or decimals.
        digits: where they suffice; more are taken where both texts would be one.
    """
    for more in range(_DIGITS_OF_A_DOUBLE):
        texts = text(one, digits + more), text(other, digits + more)
        if one == other or texts[0] != texts[1]:
            break
    return texts


def size_text(rows: int, columns: int) -> str:
    """The size of a cloud or an image, such as 480 rows × 640 columns: other programs name the columns first."""
    return f'{rows} rows × {columns} columns'


def exponent_of(value: float, digits: int = 15) -> int:
    """The power of ten of the first digit, after rounding to some digits."""
    return int(f'{value:.{digits - 1}e}'.partition('e')[2])


def power_of_ten(exponent: int) -> str:
    """A power of ten, such as 10⁻⁶."""
    return f'10{str(exponent).translate(_SUPERSCRIPTS)}'


def _least_decimals(value: float) -> int:
    return LEAST_DIGITS - 1 - exponent_of(value)


def _not_finite(value: float) -> str:
    return '–' if math.isnan(value) else ('−∞' if value < 0 else '∞')
