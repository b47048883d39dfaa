"""What every step asks of an organized cloud, checked once."""

from typing import Any

import numpy as np
import numpy.typing as npt

from socialcircle_ros.compiled import kernel
from socialcircle_ros.errors import CloudError

Cloud = npt.NDArray[np.float32] | npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]


def organized(xyz: Any) -> Cloud:
    """Check that `xyz` is an organized cloud, and make it readable for the kernels.

    Args:
        xyz: (H, W, 3) float32 or float64, any strides; rows are y, columns are x.

    Returns:
        The same array where its memory is native and aligned, else a copy that is.

    Raises:
        CloudError: another shape or data type, or no point at all.
    """
    cloud: Any = np.asarray(xyz)
    if cloud.ndim != 3 or cloud.shape[2] != 3:
        raise CloudError(f'An organized cloud has the shape (rows, columns, 3), not {cloud.shape}.')
    if cloud.dtype.kind != 'f' or cloud.dtype.itemsize not in (4, 8):
        raise CloudError(f'Coordinates must be float32 or float64, not {cloud.dtype}.')
    if cloud.size == 0:
        raise CloudError(f'The cloud has no point: its shape is {cloud.shape}.')
    if not cloud.dtype.isnative or not cloud.flags.aligned:
        cloud = cloud.astype(cloud.dtype.newbyteorder('='), order='C')
    return cloud  # type: ignore[no-any-return]


@kernel
def measured_points(xyz: Cloud) -> Mask:
    """Mask (H, W) of the measured points: those whose x, y and z are all finite."""
    height, width = xyz.shape[:2]
    measured = np.empty((height, width), np.bool_)
    for row in range(height):
        for column in range(width):
            # 0 · finite is 0, 0 · Inf and 0 · NaN are NaN: one sum tests all three.
            x, y, z = xyz[row, column, 0], xyz[row, column, 1], xyz[row, column, 2]
            measured[row, column] = (x * 0 + y * 0) + z * 0 == 0
    return measured
