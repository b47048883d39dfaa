# SPDX-License-Identifier: Apache-2.0
"""Names of the array types that the kernels of this room take. Shapes are in the docstrings of the kernels."""

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Floats, Real

__all__ = ['Floats', 'Floats32', 'Floats64', 'Indices', 'Integers', 'Real', 'Words']

Floats32 = npt.NDArray[np.float32]
Floats64 = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Indices = npt.NDArray[np.intp]

Words = npt.NDArray[np.uint64]
"""Bits: each stands for a point or for a link of two points."""
