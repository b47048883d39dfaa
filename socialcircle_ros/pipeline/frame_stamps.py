# SPDX-License-Identifier: Apache-2.0
"""What the stamps of a stack's frames tell of frames that were lost, where z is counted from frame to frame.

A camera takes its frames at a steady period, so that a lost frame leaves a gap of a whole number of periods. A
stamp may be late for one frame, but a gap delays all frames that follow. Stamps that are all equal tell nothing.
"""

import itertools
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from socialcircle_ros.errors import StackError

GAP_PERIODS = 1.5
"""Time between two frames, in periods, from which frames may be lost between them."""

_NEAR = 5
"""Frames on either side of a gap that tell its length: the earliest of them came in time."""

_TOLERANCE = 0.25
"""Largest difference of a gap from a whole number of periods."""

_DRIFT = 0.5
"""Largest deviation from a steady period over a whole stack, in periods."""


def period_of(stamps: Sequence[int]) -> int:
    """The period of the frames in ns: the median of the times between them, the lower one of two; 0: unknown.

    Args:
        stamps: in ns, ascending.
    """
    times = np.sort(np.diff(np.asarray(stamps, np.int64)))
    return int(times[(len(times) - 1) // 2]) if len(times) > 1 else 0


def frame_numbers(stamps: Sequence[int]) -> npt.NDArray[np.int64] | None:
    """Number the frames of a stack from 0, with a gap in the numbers where frames were lost.

    Args:
        stamps: of the frames that came, ns, ascending.

    Returns:
        (N,) int64, ascending; None: the stamps tell nothing.

    Raises:
        StackError: the stamps do not fit a steady period.
    """
    first_period = period_of(stamps)
    if first_period <= 0:
        return None
    time = (np.asarray(stamps, np.int64) - stamps[0]).astype(np.float64)
    numbers = np.arange(len(time))
    gaps = np.flatnonzero(np.diff(time) >= GAP_PERIODS * first_period) + 1
    parts = np.split(numbers, gaps)
    period = _period(time, parts) or float(first_period)
    phase = time / period - numbers
    lost = np.zeros(len(time), np.int64)
    for before, behind in itertools.pairwise(parts):
        gap = phase[behind[:_NEAR]].min() - phase[before[-_NEAR:]].min()
        count = round(gap)
        if count < 0 or abs(gap - count) > _TOLERANCE:
            raise StackError(
                f'the stamps show {gap + 1:.2f} periods of {period / 1e6:.3g} ms between its frames {before[-1]}'
                f' and {behind[0]}. {_ADVICE}'
            )
        lost[behind[0] :] += count
    late = phase - lost
    earliest = np.array([late[k : k + _NEAR].min() for k in range(max(len(late) - _NEAR, 0) + 1)])
    drift = float(np.abs(earliest - np.median(earliest)).max())
    if drift > _DRIFT:
        raise StackError(
            f'the stamps deviate by {drift:.2f} periods from a steady period of {period / 1e6:.3g} ms. {_ADVICE}'
        )
    return numbers + lost


_ADVICE = (
    'Frames may be lost, so that z cannot be counted. Set stack.z_source to joint_states, or stack.check_stamps to'
    ' false if each frame is one z_step from the last, whatever its stamp.'
)


def _period(time: npt.NDArray[np.float64], parts: Sequence[npt.NDArray[np.intp]]) -> float:
    """The slope of time over the number of the frame, from all parts without a gap; 0: no part has two frames."""
    product = square = 0.0
    for part in parts:
        number = part - part.mean()
        product += float(number @ (time[part] - time[part].mean()))
        square += float(number @ number)
    return product / square if square else 0.0
