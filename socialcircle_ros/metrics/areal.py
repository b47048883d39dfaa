"""Areal surface texture parameters (ISO 25178-2) of a height map."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class Texture:
    """Of the heights less their least squares plane, in the unit of the heights; form is not removed."""

    sa: float
    """Arithmetical mean height: the mean of |z|."""
    sq: float
    """Root mean square height."""
    sz: float
    """Maximum height: the highest peak less the deepest pit, so that one outlier is enough to change it."""


def texture(heights: npt.NDArray[Any]) -> Texture:
    """Sa, Sq and Sz of a height map (H, W); NaN is not measured, and does not count.

    All are NaN where fewer than three points are measured.
    """
    there = np.isfinite(heights)
    count = int(np.count_nonzero(there))
    if count < 3:
        return Texture(float('nan'), float('nan'), float('nan'))
    z = np.where(there, heights, 0.0).astype(np.float64, copy=False)
    # The plane's equations from sums over rows and columns: less than half the time of a list of points. Centred
    # coordinates and heights keep them well conditioned on large maps.
    in_rows, in_columns = there.sum(axis=1), there.sum(axis=0)
    rows, columns = (np.arange(len(n)) - n @ np.arange(len(n)) / count for n in (in_rows, in_columns))
    middle = z.sum() / count
    of_rows, of_columns = z.sum(axis=1) - middle * in_rows, z.sum(axis=0) - middle * in_columns
    mixed = rows @ (there @ columns)
    squares = [[in_rows @ rows**2, mixed], [mixed, in_columns @ columns**2]]
    (down, right), *_ = np.linalg.lstsq(np.array(squares), np.array([of_rows @ rows, of_columns @ columns]))
    z -= middle + (down * rows)[:, None] + right * columns
    rest = z[there]
    return Texture(float(np.mean(np.abs(rest))), float(np.sqrt(np.mean(rest**2))), float(np.ptp(rest)))
