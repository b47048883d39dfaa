"""How well a mask of outliers agrees with the truth."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class Scores:
    """Shares between 0 and 1; NaN where there is nothing to divide by."""

    precision: float
    """Of the points called outliers, how many are."""
    recall: float
    """Of the outliers, how many were called so."""


def score(found: npt.NDArray[np.bool_], truth: npt.NDArray[np.bool_], counted: npt.NDArray[np.bool_]) -> Scores:
    """Compare a mask with the truth.

    Args:
        found: (H, W) what the filter called outliers.
        truth: (H, W) the outliers.
        counted: (H, W) the points whose truth is certain; the others do not count.
    """
    right = int(np.count_nonzero(found & truth & counted))
    called = int(np.count_nonzero(found & counted))
    there = int(np.count_nonzero(truth & counted))
    return Scores(right / called if called else float('nan'), right / there if there else float('nan'))
