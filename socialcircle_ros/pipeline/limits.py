# SPDX-License-Identifier: Apache-2.0
"""Whether a measurement passes its limits. The node, `socialcircle filter` and the report all ask here."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from socialcircle_ros.cloud import Cloud, Mask
from socialcircle_ros.digits import number_text, share_text, unlike_texts
from socialcircle_ros.lengths import known_unit, length_text
from socialcircle_ros.metrics.areal import texture
from socialcircle_ros.settings import LimitSettings

IN_UNIT_OF_CLOUD = 'in the unit of the cloud'
"""Ends the reasons that have lengths, where their unit is not known."""

_DIGITS = 6  # of a length


@dataclass(frozen=True)
class TextureReason:
    """Why a measurement does not pass: a parameter of its texture, and the limit that it is below or above.

    The value is NaN where fewer than three points are kept.
    """

    name: str
    value: float
    comparison: str
    limit: float

    def sentence(self, unit: str | None) -> str:
        """The reason, with lengths in the unit of the cloud; None: it is not known."""
        if math.isnan(self.value):
            return f'{self.name} is not known: fewer than three points are kept.'

        def text(length: float, digits: int) -> str:
            if known_unit(unit) is not None:
                return length_text(length, unit, digits=digits)
            return number_text(length, digits, padded=False, scientific=scientific)

        scientific = any('×' in number_text(each, _DIGITS) for each in (self.value, self.limit))
        value, limit = unlike_texts(self.value, self.limit, text, _DIGITS)
        end = '' if known_unit(unit) is not None else f', {IN_UNIT_OF_CLOUD}'
        return f'{self.name} is {value}, {self.comparison} {limit}{end}.'


@dataclass(frozen=True)
class Verdict:
    """Whether a measurement passes, and why it does not.

    Attributes:
        shares: one sentence for each share that does not pass.
        textures: the parameters of the texture that do not.
    """

    shares: tuple[str, ...] = ()
    textures: tuple[TextureReason, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether no limit is exceeded."""
        return not (self.shares or self.textures)

    def reasons(self, unit: str | None = None) -> tuple[str, ...]:
        """All reasons, one sentence each, with lengths in the unit of the cloud; None: it is not known."""
        return (*self.shares, *(each.sentence(unit) for each in self.textures))


def verdict(limits: LimitSettings, xyz: Cloud, kept: Mask, measured: int) -> Verdict | None:
    """Hold a measurement to its limits.

    Args:
        limits: the limits.
        xyz: (H, W, 3) the cloud; read only if the texture has limits.
        kept: (H, W) the measured points that are kept.
        measured: number of measured points.

    Returns:
        The verdict; None if there is no limit.
    """
    if not limits.are_set:
        return None
    outliers = measured - int(kept.sum())
    shares = _share_reasons(limits, outliers / measured if measured else 0.0, measured / kept.size)
    return Verdict(tuple(shares), tuple(_texture_reasons(limits, xyz, kept)))


def _share_reasons(limits: LimitSettings, outliers: float, measured: float) -> Iterator[str]:
    most, least = limits.outlier_share_max, limits.measured_share_min
    if most is not None and outliers > most:
        share, limit = unlike_texts(outliers, most, _share_text, 2)
        yield f'{share} of the measured points are outliers, more than {limit}.'
    if least is not None and measured < least:
        share, limit = unlike_texts(measured, least, _share_text, 2)
        yield f'{share} of the points are measured, fewer than {limit}.'


def _texture_reasons(limits: LimitSettings, xyz: Cloud, kept: Mask) -> Iterator[TextureReason]:
    limited = [row for row in limits.of_texture if row[1] is not None or row[2] is not None]
    if not limited:
        return
    found = texture(xyz, kept)
    values = {'Sa': found.sa, 'Sq': found.sq, 'Sz': found.sz}
    for name, low, high in limited:
        value = values[name]
        if low is not None and not value >= low:  # also NaN
            yield TextureReason(name, value, 'below', low)
        elif high is not None and not value <= high:
            yield TextureReason(name, value, 'above', high)


def _share_text(share: float, decimals: int) -> str:
    return share_text(share, decimals, padded=False)
