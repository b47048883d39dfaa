# SPDX-License-Identifier: Apache-2.0
"""The individuals chart: centre line, control limits, and the Western Electric rules.

References:
    D. C. Montgomery: Introduction to Statistical Quality Control, 8th ed., Wiley (2019), section 6.4 (chart for
    individual measurements). Western Electric: Statistical Quality Control Handbook (1956), part B (the rules).
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

RULES = (
    'one point beyond 3 sigma',
    'two of three points beyond 2 sigma on one side',
    'four of five points beyond 1 sigma on one side',
    'eight points on one side of the centre line',
)
"""The Western Electric rules; bit 0 of a signal stands for the first."""

_WINDOWS = ((1, 1, 3.0), (2, 3, 2.0), (4, 5, 1.0), (8, 8, 0.0))  # so many, of so many, beyond so many sigma
_MEAN_RANGE, _MEDIAN_RANGE = 1.128, 0.954  # of two values of a normal distribution, in standard deviations
LEAST_BASELINE = 8
"""Least number of values from which control limits are computed."""


@dataclass(frozen=True)
class ControlLimits:
    """Centre line and standard deviation of a process, from its first values.

    Attributes:
        centre: median of the baseline.
        sigma: median moving range of the baseline, divided by 0.954; where that is 0, the mean moving range
            divided by 1.128. A slow drift hardly widens it, nor does a bad part among the first.
    """

    centre: float
    sigma: float

    @property
    def lower(self) -> float:
        """The lower control limit, 3 sigma below the centre line."""
        return self.centre - 3 * self.sigma

    @property
    def upper(self) -> float:
        """The upper control limit, 3 sigma above the centre line."""
        return self.centre + 3 * self.sigma


def control_limits(values: npt.NDArray[np.float64], baseline: int) -> ControlLimits | None:
    """The limits of an individuals chart.

    Args:
        values: (N,) finite, in the order of time.
        baseline: number of values, from the first, that the limits are computed from.

    Returns:
        The limits; None: there are fewer than eight values.
    """
    first = values[:baseline]
    if len(first) < LEAST_BASELINE:
        return None
    ranges = np.abs(np.diff(first))
    sigma = np.median(ranges) / _MEDIAN_RANGE or np.mean(ranges) / _MEAN_RANGE
    return ControlLimits(float(np.median(first)), float(sigma))


def signals(values: npt.NDArray[np.float64], limits: ControlLimits) -> npt.NDArray[np.uint8]:
    """Which of the rules each value completes, (N,): bit 0 for the first rule.

    A value completes a rule if it is beyond the rule's distance itself, and so are enough of the values before it
    on the same side.
    """
    found = np.zeros(len(values), np.uint8)
    for bit, (enough, window, distance) in enumerate(_WINDOWS):
        for side in (1.0, -1.0):
            beyond = side * (values - limits.centre) > distance * limits.sigma
            total = np.cumsum(beyond, dtype=np.int64)
            counts = total - np.concatenate([np.zeros(min(window, len(total)), np.int64), total[:-window]])
            found |= (beyond & (counts >= enough)).astype(np.uint8) << bit
    return found
