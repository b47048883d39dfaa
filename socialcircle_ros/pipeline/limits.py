# SPDX-License-Identifier: Apache-2.0
"""Whether a measurement passes its limits. The node, `socialcircle filter` and the report all ask here."""

from collections.abc import Iterator
from dataclasses import dataclass

from socialcircle_ros.cloud import Cloud, Mask
from socialcircle_ros.digits import number_text, share_text, unlike_texts
from socialcircle_ros.metrics.areal import texture
from socialcircle_ros.settings import LimitSettings

IN_UNIT_OF_CLOUD = 'in the unit of the cloud'
"""Ends the reasons that have lengths."""

_DIGITS = 6  # of a length


@dataclass(frozen=True)
class Verdict:
    """Whether a measurement passes, and the reasons why it does not."""

    reasons: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether no limit is exceeded."""
        return not self.reasons


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
    return Verdict((*shares, *_texture_reasons(limits, xyz, kept)))


def _share_reasons(limits: LimitSettings, outliers: float, measured: float) -> Iterator[str]:
    most, least = limits.outlier_share_max, limits.measured_share_min
    if most is not None and outliers > most:
        share, limit = unlike_texts(outliers, most, _share_text, 2)
        yield f'{share} of the measured points are outliers, more than {limit}.'
    if least is not None and measured < least:
        share, limit = unlike_texts(measured, least, _share_text, 2)
        yield f'{share} of the points are measured, fewer than {limit}.'


def _texture_reasons(limits: LimitSettings, xyz: Cloud, kept: Mask) -> Iterator[str]:
    limited = [row for row in limits.of_texture if row[1] is not None or row[2] is not None]
    if not limited:
        return
    found = texture(xyz, kept)
    values = {'Sa': found.sa, 'Sq': found.sq, 'Sz': found.sz}
    for name, low, high in limited:
        value = values[name]
        if low is not None and value < low:
            yield _texture_reason(name, value, 'below', low)
        if high is not None and value > high:
            yield _texture_reason(name, value, 'above', high)
        if value != value:  # noqa: PLR0124 - NaN: fewer than three kept points have no texture
            yield f'{name} is not known: fewer than three points are kept.'


def _texture_reason(name: str, value: float, comparison: str, limit: float) -> str:
    shown, than = unlike_texts(value, limit, _length_text, _DIGITS)
    return f'{name} is {shown}, {comparison} {than}, {IN_UNIT_OF_CLOUD}.'


def _share_text(share: float, decimals: int) -> str:
    return share_text(share, decimals, padded=False)


def _length_text(length: float, digits: int) -> str:
    return number_text(length, digits, padded=False)
