# SPDX-License-Identifier: Apache-2.0
"""What a matrix of heights as text must not have: labels beside its heights, and words among them."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.errors import ImportFileError

from .text import open_text

_FEWEST_COUNTED, _FEWEST_EVEN = 4, 6  # labels; fewer heights may have their form by chance
_EVEN = 1e-6  # of the step
_NOT_MEASURED = ('bad', 'infinite')  # in the place of a number, for SurfaceTopography and not for Python


def check_labels(path: Path, heights: NDArray[np.floating]) -> None:
    """See that the first row and column of a matrix are heights, not labels of the columns and rows.

    They are labels if one of them counts 0, 1, 2, …, or if both are evenly spaced, as coordinates are; but not
    where all other rows or columns are evenly spaced as well, as on an inclined plane.

    Args:
        path: of the file, for the message.
        heights: (rows, columns) float32 or float64; NaN where not measured.

    Raises:
        ImportFileError: they are labels.
    """
    sides = {'row': heights, 'column': heights.T}
    even = [name for name, lines in sides.items() if _is_odd_one_out(lines)]
    counted = [name for name in even if _counts(sides[name][0])]
    both = len(even) == len(sides) and min(heights.shape) > _FEWEST_EVEN
    if both or counted:
        lines = ' and the first '.join(even if both else counted)
        raise ImportFileError(
            f'{path} seems to have labels in its first {lines}, which would become heights: the numbers there are'
            ' evenly spaced, unlike all others. Save it without labels.'
        )


def _is_odd_one_out(lines: NDArray[np.floating]) -> bool:
    """Whether the first line, without its corner, rises or falls evenly, and another one does not."""
    first, others = lines[0, 1:], lines[1:, 1:]
    with np.errstate(invalid='ignore'):
        steps, bends = np.diff(first), np.diff(others, n=2)
    if not steps.size or not np.isfinite(steps).all() or not steps[0]:
        return False
    limit = _EVEN * abs(steps[0])
    return bool((np.abs(steps - steps[0]) <= limit).all() and (np.abs(bends) > limit).any())


def _counts(line: NDArray[np.floating]) -> bool:
    """Whether a line is 0, 1, 2, …, or is that behind an empty corner."""
    labels = line if np.isfinite(line[0]) else line[1:]
    return labels.size >= _FEWEST_COUNTED and np.array_equal(labels, np.arange(labels.size))


def check_rows(path: Path) -> None:
    """See that each row of a text with spaces between the heights has numbers only.

    SurfaceTopography takes a row with another word for a line of a header, and leaves it out.

    Raises:
        ImportFileError: a row has as many words as the first, but one of them is no number.
        OSError: the file cannot be read.
    """
    width = 0
    with open_text(path) as file:
        for place, line in enumerate(file, 1):
            words = line.split()
            numbers = sum(_is_number(word) for word in words)
            if not width and words and numbers == len(words):
                width = numbers
            elif width and len(words) == width and 0 < numbers < width and not words[0].startswith('#'):
                raise ImportFileError(
                    f'{path} has a word that is no number among the heights of line {place}: write nan for what'
                    ' was not measured.'
                )


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return word.lower() in _NOT_MEASURED
    return True
