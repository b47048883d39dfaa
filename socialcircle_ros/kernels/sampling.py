# SPDX-License-Identifier: Apache-2.0
"""Which rows of a large cloud stand for all."""

import numpy as np
import numpy.typing as npt

SAMPLES = 60_000
"""Approximate number of points in the rows, where a caller wants no other."""

_FEWEST_ROWS, _RUN = 60, 12
"""So many rows at least, in runs of so many: a run sees all places of a fine ruling. Of rows that are longer
than two samples for each of these, fewer are taken."""


def sampled_rows(height: int, width: int, samples: int = SAMPLES) -> npt.NDArray[np.int64]:
    """Rows that stand for all, (n,) ascending: a run in each band, at random but always the same.

    Evenly spaced rows could all be at one place of a ruling. Between its lines they would show no step, and at
    their edges nothing but steps. The last row is left out where not all are taken: nothing is below it.
    """
    number = max(samples // width, min(_FEWEST_ROWS, 2 * samples // width), 1)
    stride, run = max(1, height // number), min(_RUN, number)
    end = height - (stride > 1)
    bands = np.arange(0, end, run * stride)
    first = bands + np.random.default_rng(0).integers(run * (stride - 1) + 1, size=bands.size)
    rows: npt.NDArray[np.int64] = (np.minimum(first, max(end - run, 0))[:, np.newaxis] + np.arange(run)).ravel()
    return np.unique(rows[rows < height])
