# SPDX-License-Identifier: Apache-2.0
"""Axes for the scene: lines with ticks along a box round the cloud, and their labels. No viser."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .charts import nice_ticks, tick_texts
from .display import MapSide
from .view import SIDE, View

_TICK = SIDE / 60
_GAP = SIDE / 14  # between an axis and its numbers


@dataclass(frozen=True, eq=False)
class Axes:
    """Axes of a cloud in the scene.

    Attributes:
        lines: (n, 2, 3) ends of the lines.
        labels: texts and their positions; numbers without a unit, and one label with the unit for each axis.
    """

    lines: npt.NDArray[np.float32]
    labels: tuple[tuple[str, tuple[float, float, float]], ...]


def axes_of(view: View, stretch: float) -> Axes:
    """The axes of a cloud: x and y along the front and the left side of its floor, z upright at the right.

    The numbers of z stand at the end of the x axis, to its right, since those of y would cover them at the left.

    Args:
        view: the cloud.
        stretch: factor on z in the scene.
    """
    drawing = view.drawing
    width, depth = view.size
    low, high = drawing.height_span
    floor = view.position(0, 0, low, stretch)[2]
    roof = view.position(0, 0, high, stretch)[2]
    left, front = -width / 2, -depth / 2
    lines = [
        ((left, front, floor), (-left, front, floor)),
        ((left, front, floor), (left, -front, floor)),
        ((-left, front, floor), (-left, front, roof)),
    ]
    labels = []
    lengths, heights = drawing.lengths, drawing.height_scale
    for place, text in _ticks(drawing.across, lengths.factor):
        x = left + width * place
        lines.append(((x, front, floor), (x, front - _TICK, floor)))
        labels.append((text, (x, front - _GAP, floor)))
    for place, text in _ticks(drawing.down, lengths.factor):
        y = -front - depth * place
        lines.append(((left, y, floor), (left - _TICK, y, floor)))
        labels.append((text, (left - _GAP, y, floor)))
    labels.append((lengths.label(drawing.across.name), (0.0, front - 2 * _GAP, floor)))
    labels.append((lengths.label(drawing.down.name), (left, -front + _GAP, floor)))
    if high > low:
        ticks = nice_ticks(low * heights.factor, high * heights.factor, 3)
        for tick, text in zip(ticks, tick_texts(ticks), strict=True):
            z = view.position(0, 0, tick / heights.factor, stretch)[2]
            lines.append(((-left, front, z), (-left + _TICK, front, z)))
            labels.append((text, (-left + 1.5 * _GAP, front, z)))
        labels.append((heights.label('z'), (-left + 1.5 * _GAP, front, roof + _GAP)))
    return Axes(np.array(lines, np.float32), tuple(labels))


def _ticks(side: MapSide, factor: float) -> list[tuple[float, str]]:
    """Round coordinates along a side, from 0 at its first end to 1 at its last, and their texts."""
    first, last = side.first * factor, side.last * factor
    if first == last:
        return []
    ticks = nice_ticks(min(first, last), max(first, last), 5)
    return [((tick - first) / (last - first), text) for tick, text in zip(ticks, tick_texts(ticks), strict=True)]
