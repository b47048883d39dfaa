# SPDX-License-Identifier: Apache-2.0
"""The camera: from light to gray levels, by the linear model of EMVA 1288 (release 4.0, section 2).

Electrons are the light times the exposure, with shot noise and read noise. Gray levels are the electrons divided
by the full well, plus the black level, rounded and clipped. Each pixel has its own gain (PRNU) and offset (DSNU).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.errors import SettingError
from socialcircle_ros.focus import Frame

from .surfaces import Seed


@dataclass(frozen=True)
class Camera:
    """A monochrome camera.

    Attributes:
        bits: 8 gives uint8; 12 and 16 give uint16, 12 in the lower bits.
        full_well: electrons at which a pixel saturates, which is the largest gray level.
        read_noise: root mean square, electrons.
        exposure: share of the full well that light of 1 fills.
        black_level: gray level without light, as a share of the largest one.
        prnu: standard deviation of the gains of the pixels, as a share.
        dsnu: standard deviation of the offsets of the pixels, electrons.
    """

    bits: int = 8
    full_well: float = 10_000.0
    read_noise: float = 7.0
    exposure: float = 0.55
    black_level: float = 0.01
    prnu: float = 0.005
    dsnu: float = 3.0

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            SettingError: a value is out of its range.
        """
        if self.bits not in (8, 12, 16):
            raise SettingError(f'A camera of {self.bits} bits is not supported; use 8, 12 or 16.')
        if not (self.full_well > 0 and self.exposure > 0):
            raise SettingError('The full well and the exposure of the camera must be above 0.')
        if min(self.read_noise, self.black_level, self.prnu, self.dsnu) < 0:
            raise SettingError('Noise and black level of the camera cannot be below 0.')

    @property
    def top(self) -> int:
        """The largest gray level."""
        return (1 << self.bits) - 1

    @property
    def saturation(self) -> float:
        """The light that saturates a pixel."""
        return (1 - self.black_level) / self.exposure

    def noise(self, light: NDArray[np.float32]) -> NDArray[np.float32]:
        """Root mean square noise of a pixel in one frame, with that of rounding, in the unit of `light`."""
        per_light = self.full_well * self.exposure
        electrons = np.maximum(light, 0) * np.float32(per_light)
        quantum = self.full_well / self.top
        total: NDArray[np.float32] = np.sqrt(electrons + np.float32(self.read_noise**2 + quantum**2 / 12))
        total /= np.float32(per_light)
        return total

    def sensor(self, shape: tuple[int, int], seed: Seed) -> 'Sensor':
        """Make the pixels of the camera, each with its own gain and offset. A seed gives the same pixels."""
        rng = np.random.default_rng(seed)
        gain = 1 + self.prnu * rng.standard_normal(shape, dtype=np.float32)
        offset = self.dsnu * rng.standard_normal(shape, dtype=np.float32)
        return Sensor(self, gain.astype(np.float32), offset.astype(np.float32))


@dataclass(frozen=True, eq=False)
class Sensor:
    """The pixels of a camera.

    Attributes:
        camera: their camera.
        gain: (H, W) float32, 1 on average.
        offset: (H, W) float32, electrons.
    """

    camera: Camera
    gain: NDArray[np.float32]
    offset: NDArray[np.float32]

    def expose(self, light: NDArray[np.float32], seed: Seed) -> Frame:
        """Take one frame.

        Shot noise and read noise are drawn as one normal variable with the sum of their variances. A pixel has
        tens of electrons or more here: a Poisson count would look the same and take ten times as long.

        Args:
            light: (H, W) float32; light of 1 fills the share `exposure` of the full well.
            seed: of the noise of this frame.

        Returns:
            (H, W) uint8 or uint16.
        """
        camera = self.camera
        electrons = light * self.gain
        electrons *= np.float32(camera.full_well * camera.exposure)
        noise = np.random.default_rng(seed).standard_normal(light.shape, dtype=np.float32)
        noise *= np.sqrt(np.maximum(electrons, 0) + np.float32(camera.read_noise**2))
        electrons += noise
        electrons += self.offset
        electrons *= np.float32(camera.top / camera.full_well)
        electrons += np.float32(camera.black_level * camera.top)
        np.rint(electrons, out=electrons)
        np.clip(electrons, 0, camera.top, out=electrons)
        return electrons.astype(np.uint8) if camera.bits == 8 else electrons.astype(np.uint16)


NOISELESS = Camera(bits=16, full_well=1e12, read_noise=0.0, prnu=0.0, dsnu=0.0)
"""A camera without noise, only with the rounding to 16 bits: it shows the errors of optics and method alone."""
