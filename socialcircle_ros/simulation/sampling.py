# SPDX-License-Identifier: Apache-2.0
"""Sampling of fields for the renderers: distances from focus, padding, frequencies."""

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.errors import SettingError

from .optics import Optics
from .specimen import Specimen

Light = NDArray[np.float32]
"""Light on pixels or from points; 1 is flat, bright metal."""


def check_pitch(specimen: Specimen, optics: Optics) -> None:
    """Check that the points of a specimen are the pixels of the optics.

    Raises:
        SettingError: the pitches differ.
    """
    if not np.allclose((specimen.grid.dx, specimen.grid.dy), optics.pitch):
        raise SettingError(
            f'The specimen has a pitch of {specimen.grid.dx}×{specimen.grid.dy} µm, the optics of'
            f' {optics.pitch} µm; make the specimen with pitch={optics.pitch}.'
        )


def layer_distances(farthest: float, optics: Optics) -> NDArray[np.float64]:
    """Distances from focus of the layers, µm: dense near focus, then growing by 10 % from layer to layer."""
    fine = optics.depth_of_field / 12
    near = np.arange(0, 18) * fine
    count = max(int(np.ceil(np.log(farthest / near[-1]) / np.log(1.1))), 0) + 1
    return np.concatenate([near, near[-1] * 1.1 ** np.arange(1, count + 1)])


def margin_of(farthest: float, optics: Optics) -> int:
    """Points by which a field is continued on each side, so that points at its border are blurred too."""
    return int(np.ceil(1.1 * farthest * optics.cone / optics.pitch)) + 8


def mirrored(field: NDArray[np.floating], pad: int) -> NDArray[np.float64]:
    """Continue a field by its mirror image on all sides, to lengths for which the FFT is fast."""
    extra = [(pad, fast_length(size + 2 * pad) - size - pad) for size in field.shape]
    return np.pad(field.astype(np.float64), extra, mode='symmetric')


def fast_length(least: int) -> int:
    """Return the smallest even number of the form 2^a·3^b·5^c that is not below `least`."""
    length = least + least % 2
    while True:
        rest = length
        for factor in (2, 3, 5):
            while rest % factor == 0:
                rest //= factor
        if rest == 1:
            return length
        length += 2


def frequencies(shape: tuple[int, ...], pitch: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Frequencies along x, (1, W / 2 + 1), and along y, (H, 1), of a real FFT, 1/µm."""
    fx = np.fft.rfftfreq(shape[1], pitch).astype(np.float64)
    fy = np.fft.fftfreq(shape[0], pitch).astype(np.float64)
    return fx[np.newaxis, :], fy[:, np.newaxis]
