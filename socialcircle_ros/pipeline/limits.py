# SPDX-License-Identifier: Apache-2.0
"""Whether a measurement passes its limits. The node, `socialcircle filter` and the report all ask here."""

from collections.abc import Iterator
from dataclasses import dataclass

from socialcircle_ros.cloud import Cloud, Mask
from socialcircle_ros.metrics.areal import texture
from socialcircle_ros.settings import LimitSettings


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
        yield f'{100 * outliers:.4g} % of the measured points are outliers, more than {100 * most:.4g} %.'
    if least is not None and measured < least:
        yield f'{100 * measured:.4g} % of the points are measured, fewer than {100 * least:.4g} %.'


def _texture_reasons(limits: LimitSettings, xyz: Cloud, kept: Mask) -> Iterator[str]:
    limited = [row for row in limits.of_texture if row[1] is not None or row[2] is not None]
    if not limited:
        return
    found = texture(xyz, kept)
    values = {'Sa': found.sa, 'Sq': found.sq, 'Sz': found.sz}
    for name, low, high in limited:
        value = values[name]
        if low is not None and value < low:
            yield f'{name} is {value:.6g}, below {low:.6g}, in the unit of the cloud.'
        if high is not None and value > high:
            yield f'{name} is {value:.6g}, above {high:.6g}, in the unit of the cloud.'
        if value != value:  # noqa: PLR0124 - NaN: fewer than three kept points have no texture
            yield f'{name} is not known: fewer than three points are kept.'
