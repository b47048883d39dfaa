# SPDX-License-Identifier: Apache-2.0
"""What a matrix of heights as text must not have: labels beside its heights, and words among them."""

from collections import Counter
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.errors import ImportFileError

from .text import open_text

_FEWEST = 6  # labels; fewer heights may count 0, 1, 2, … by chance
_EVEN = 1e-6  # of the step
_NEXT = 9  # lines after the first, which tell how heights go on
_JUMP, _LEAST_JUMP = 5.0, 0.01  # of the changes between heights, and of the step of the labels
_AS_ROUGH = 0.5  # of what the next lines usually are
_NOT_MEASURED = ('bad', 'infinite')  # in the place of a number, for SurfaceTopography and not for Python


def check_labels(path: Path, heights: NDArray[np.floating]) -> None:
    """See that the first row and column of a matrix are heights, not labels of the columns and rows.

    They are labels if one of them counts 0, 1, 2, …, or if both are evenly spaced, as coordinates are; but not
    where all other rows or columns are evenly spaced as well, as on an inclined plane, nor where the first goes
    over into the second, as on such a plane with a bump.

    Args:
        path: of the file, for the message.
        heights: (rows, columns) float32 or float64; NaN where not measured.

    Raises:
        ImportFileError: they are labels.
    """
    sides = {'row': heights, 'column': heights.T}
    even = [name for name, lines in sides.items() if _is_odd_one_out(lines)]
    counted = [name for name in even if _counts(sides[name][0])]
    both = len(even) == len(sides) and min(heights.shape) > _FEWEST
    if both or counted:
        lines = ' and the first '.join(even if both else counted)
        raise ImportFileError(
            f'{path} seems to have labels in its first {lines}, which would become heights: the numbers there are'
            ' evenly spaced, unlike those beside them. Save it without labels, or as .npy if they are heights.'
        )


def _is_odd_one_out(lines: NDArray[np.floating]) -> bool:
    """Whether the first line, without its corner, rises or falls evenly, and the others do not go on from it."""
    first, others = lines[0, 1:], lines[1:, 1:]
    with np.errstate(invalid='ignore', over='ignore'):
        steps, bends = np.diff(first), np.diff(others, n=2)
        if not steps.size or not np.isfinite(steps).all() or not steps[0]:
            return False
        limit = _EVEN * abs(steps[0])
        if (np.abs(steps - steps[0]) > limit).any() or not (np.abs(bends) > limit).any():
            return False
    measured = np.isfinite(bends).any(axis=1)
    return not _goes_on(steps[0], others[measured][:_NEXT])


def _goes_on(step: float, nearest: NDArray[np.floating]) -> bool:
    """Whether a line that rises by one step from place to place goes over into the lines after it.

    Where heights are smooth, the rise changes little from line to line, and labels differ from the heights beside
    them far more than these from each other. Where heights are rough, the line after labels is as rough as the
    next; beside a line that is not rough at all, heights are hardly rough yet.
    """
    if len(nearest) < 2:
        return True
    with np.errstate(invalid='ignore', over='ignore'):
        rises = np.diff(nearest)
        change = _usual(rises[0] - step)
        changes = [_usual(each) for each in np.diff(rises, axis=0)]
        bend, *bends = (_usual(each) for each in np.diff(rises))
    jumps = change > max(_JUMP * max(changes), _LEAST_JUMP * abs(step))
    is_rough = bend > max(_AS_ROUGH * float(np.median(bends)), _EVEN * abs(step))
    return not (jumps or is_rough)


def _usual(values: NDArray[np.floating]) -> float:
    """The median of the magnitudes that are known; 0 if none is."""
    known = np.abs(values[np.isfinite(values)])
    return float(np.median(known)) if known.size else 0.0


def _counts(line: NDArray[np.floating]) -> bool:
    """Whether a line is 0, 1, 2, …, or is that behind an empty corner."""
    labels = line if np.isfinite(line[0]) else line[1:]
    return labels.size >= _FEWEST and np.array_equal(labels, np.arange(labels.size))


def check_rows(path: Path) -> None:
    """See that each row of a text with spaces between the heights has numbers only.

    SurfaceTopography takes a row with another word for a line of a header, and leaves it out.

    Raises:
        ImportFileError: a line has as many words as a row of the matrix, not all of them numbers, and it is no
            entry of a header or footer, such as "RMS = 3".
        OSError: the file cannot be read.
    """
    with open_text(path) as file:
        sizes = [_size_of_row(line.split()) for line in file]
    # Numbers of a header are in few lines, heights in most.
    width, _ = Counter(filter(None, sizes)).most_common(1)[0] if any(sizes) else (0, 0)
    rows = [place for place, size in enumerate(sizes, 1) if width and size == width]
    with open_text(path) as file:
        for place, line in enumerate(file, 1):
            words = line.split()
            if not words or len(words) != width or words[0].startswith('#'):
                continue
            others = [word.lower() for word in words if not _is_number(word)]
            if 0 < len(others) < width and not _is_entry(words[0], others, rows[0] < place < rows[-1]):
                raise ImportFileError(
                    f'{path} has a word that is no number among the heights of line {place}: write nan for what'
                    ' was not measured.'
                )


def _size_of_row(words: list[str]) -> int:
    """How many numbers a line has, if it has nothing else; 0 otherwise."""
    return len(words) if all(map(_is_number, words)) else 0


def _is_entry(first: str, others: list[str], is_within: bool) -> bool:
    """Whether a line begins with a name, and not with a word for heights that are not measured.

    Such words are all alike within the matrix; only before and behind it, one at the beginning may be a name.
    """
    return first[0].isalpha() and not _is_number(first) and (not is_within or len(set(others)) > 1)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return word.lower() in _NOT_MEASURED
    return True
