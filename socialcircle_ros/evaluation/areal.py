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
    z = heights[there].astype(np.float64)
    if len(z) < 3:
        return Texture(float('nan'), float('nan'), float('nan'))
    rows, columns = np.nonzero(there)
    # Centred coordinates keep the 3×3 equations well conditioned on large maps.
    terms = np.stack([np.ones(len(z)), rows - rows.mean(), columns - columns.mean()])
    plane, *_ = np.linalg.lstsq(terms @ terms.T, terms @ z, rcond=None)
    z -= plane @ terms
    return Texture(float(np.mean(np.abs(z))), float(np.sqrt(np.mean(z**2))), float(np.ptp(z)))
