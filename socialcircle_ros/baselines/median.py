# SPDX-License-Identifier: Apache-2.0
"""The residual to a median window: a point far above or below its surroundings is an outlier."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from socialcircle_ros.arguments import settings_or_default
from socialcircle_ros.cloud import Cloud, organized
from socialcircle_ros.errors import SettingError, shown
from socialcircle_ros.kernels.compiled import kernel
from socialcircle_ros.kernels.order_statistics import MAD_TO_SIGMA
from socialcircle_ros.kernels.sorting_networks import Comparators, merge_network, run_network, sort_network

from .result import FilterResult, Score, judge
from .settings import MedianSettings
from .window import STRIP

_Line = npt.NDArray[np.float32] | npt.NDArray[np.float64]


class _WindowPlan(NamedTuple):
    """How the columns of a window are sorted and merged in a buffer that begins with the rows of the window.

    Attributes:
        comparators: of all steps, one after the other.
        steps: (S, 8): first row of list A in the buffer, its length, first row of list B, its length (0: list A is
            sorted), columns that B lies to the right of A, first row of the result, first comparator, end of the
            comparators.
        orders: (S, keep): row of the work area that holds each value of the result.
        buffer_rows: rows of the buffer.
        work_rows: rows of the work area.
    """

    comparators: Comparators
    steps: npt.NDArray[np.int64]
    orders: npt.NDArray[np.int64]
    buffer_rows: int
    work_rows: int


def median_filter(xyz: npt.ArrayLike, settings: MedianSettings | None = None) -> FilterResult:
    """Remove the points that differ in height from the median of their window by more than a threshold.

    Args:
        xyz: (H, W, 3) float32 or float64 organized cloud; a point with a NaN or Inf is not measured.
        settings: the parameters; None: their defaults.

    Returns:
        Masks, and as the score |z - median| in the unit of the cloud.

    Raises:
        CloudError: not an organized cloud.
    """
    settings = settings_or_default(MedianSettings, settings)
    cloud = organized(xyz)
    score = np.abs(cloud[:, :, 2] - window_median(cloud, settings.window))
    threshold = settings.threshold
    if threshold is None:
        residuals = score[np.isfinite(score)]
        middle = len(residuals) // 2
        sigma = MAD_TO_SIGMA * float(np.partition(residuals, middle)[middle]) if len(residuals) else 0.0
        threshold = settings.sigmas * sigma
    return judge(score, threshold)


def window_median(xyz: npt.ArrayLike, window: int) -> Score:
    """Compute the exact median height of the measured points in the window around each measured point.

    The median of n heights in ascending order is the height at index ⌊n/2⌋, also where n is even. The window is
    cut at the border of the cloud.

    Args:
        xyz: (H, W, 3) float32 or float64 organized cloud; a point with a NaN or Inf is not measured.
        window: side of the window in points, odd.

    Returns:
        (H, W) in the cloud's data type and unit, NaN where the point is not measured.

    Raises:
        SettingError: the window is not odd.
        CloudError: not an organized cloud.
    """
    if (
        isinstance(window, (bool, np.timedelta64))
        or not isinstance(window, (int, np.integer))
        or window < 1
        or window % 2 == 0
    ):
        raise SettingError(f'The window must be an odd number of points, such as 5, not {shown(window)}.')
    window = int(window)
    cloud = organized(xyz)
    median: Score = np.empty(cloud.shape[:2], cloud.dtype)
    _window_median(cloud, window, _plan(window), median)
    return median


@lru_cache(maxsize=16)
def _plan(window: int) -> _WindowPlan:
    """Plan how the sorted columns of a window are merged: sorted lists of 1, 2, 4, ... columns, then their sum.

    Windows of neighbouring points share columns. A sorted list of 2k columns is the merge of two lists of k
    columns, k columns apart. With 11 = 8 + 2 + 1, a point costs one column to sort and five merges. Only the
    lower half of the last list can contain a median, and the networks keep only the comparators for that half.
    """
    keep = window * window // 2 + 1
    networks: list[Comparators] = []
    steps: list[tuple[int, ...]] = []
    orders: list[list[int]] = []
    lists: dict[int, tuple[int, int]] = {}  # columns in a list: its first row in the buffer, its length
    used = window  # the rows of the window lie at the top of the buffer

    def add(columns: int, first: tuple[int, int], second: tuple[int, int], shift: int) -> None:
        nonlocal used
        if second[1]:
            comparators, order = merge_network(first[1], second[1], keep)
        else:
            comparators, order = sort_network(first[1], keep), list(range(min(first[1], keep)))
        start = sum(len(network) for network in networks)
        steps.append((*first, *second, shift, used, start, start + len(comparators)))
        networks.append(comparators)
        orders.append(order)
        lists[columns] = used, len(order)
        used += len(order)

    add(1, (0, window), (0, 0), 0)
    columns = 1
    while 2 * columns <= window:
        add(2 * columns, lists[columns], lists[columns], columns)
        columns *= 2
    total = 1  # the window is odd
    for bit in range(1, window.bit_length()):
        columns = 1 << bit
        if window & columns:
            add(total + columns, lists[columns], lists[total], columns)
            total += columns
    table = np.zeros((len(steps), keep), np.int64)
    for row, order in zip(table, orders, strict=True):
        row[: len(order)] = order
    return _WindowPlan(
        comparators=np.concatenate(networks),
        steps=np.array(steps, np.int64),
        orders=table,
        buffer_rows=used,
        work_rows=max(step[1] + step[3] for step in steps),
    )


@kernel
def _window_median(xyz: Cloud, window: int, plan: _WindowPlan, median: Score) -> None:
    """Fill `median`, strip by strip and row by row."""
    height, width = xyz.shape[:2]
    reach = window // 2
    padded = min(STRIP, width) + 2 * reach
    # The first rows are the rows of the window, in a ring: row r of the cloud lies in row r % window.
    buffer = np.empty((plan.buffer_rows, padded), xyz.dtype)
    work = np.empty((plan.work_rows, padded), xyz.dtype)
    measured = np.empty(padded, np.int32)
    infinite = xyz.dtype.type(np.inf)
    steps, orders = plan.steps, plan.orders
    result = steps[-1, 5]
    for left in range(0, width, STRIP):
        count = min(STRIP, width - left)
        for row in range(-reach, reach):
            _load_heights(xyz, row, left - reach, buffer[row % window])
        for row in range(height):
            _load_heights(xyz, row + reach, left - reach, buffer[(row + reach) % window])
            for step in range(steps.shape[0]):
                first, first_length, second, second_length, shift, target, start, stop = steps[step]
                used = padded - shift
                for item in range(first_length):
                    _copy(buffer[first + item], work[item], used)
                for item in range(second_length):
                    _copy(buffer[second + item, shift:], work[first_length + item], used)
                run_network(plan.comparators[start:stop], work, used)
                for item in range(min(first_length + second_length, orders.shape[1])):
                    _copy(work[orders[step, item]], buffer[target + item], used)
            measured[:] = 0
            for item in range(window):
                heights = buffer[item]
                for column in range(padded):
                    measured[column] += 1 if heights[column] < infinite else 0
            in_window = 0
            for column in range(window - 1):
                in_window += measured[column]
            here = buffer[row % window]
            for column in range(count):
                in_window += measured[column + window - 1]
                if here[column + reach] < infinite:
                    median[row, left + column] = buffer[result + in_window // 2, column]
                else:
                    median[row, left + column] = np.nan
                in_window -= measured[column]


@kernel
def _copy(source: _Line, target: _Line, count: int) -> None:
    """Copy the first `count` items; a slice assignment would first test whether the two overlap."""
    for column in range(count):
        target[column] = source[column]


@kernel
def _load_heights(xyz: Cloud, row: int, left: int, heights: _Line) -> None:
    """Copy the heights from column `left` on; +Inf where not measured or outside of the cloud."""
    height, width = xyz.shape[:2]
    first = max(-left, 0)
    last = max(min(width - left, heights.shape[0]), 0)
    if row < 0 or row >= height:
        last = 0
    heights[:first] = np.inf
    for column in range(first, last):
        x, y, z = xyz[row, left + column, 0], xyz[row, left + column, 1], xyz[row, left + column, 2]
        heights[column] = z if (x * 0 + y * 0) + z * 0 == 0 else heights.dtype.type(np.inf)
    heights[last:] = np.inf
