"""The camera: from light to numbers, by the linear model of EMVA 1288 (release 4.0, section 2).

Electrons are light times exposure, plus shot noise, plus read noise; numbers are electrons over the full
well, plus black level, rounded and clipped. Fixed patterns are gain (PRNU) and offset (DSNU) per pixel.
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
        bits: 8 gives uint8; 12 and 16 give uint16, 12 in its lower bits.
        full_well: electrons at which a pixel is full, and at which the numbers end.
        read_noise: root mean square, electrons.
        exposure: share of the full well that light of strength 1 fills.
        black_level: number that no light gives, as a share of the range.
        prnu: spread of the pixels' gain, as a share.
        dsnu: spread of the pixels' offset, electrons.
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
            SettingError: one is out of its range.
        """
        if self.bits not in (8, 12, 16):
            raise SettingError(f'A camera of {self.bits} bits is not known; use 8, 12 or 16.')
        if not (self.full_well > 0 and self.exposure > 0):
            raise SettingError('The full well and the exposure of the camera must be above 0.')
        if min(self.read_noise, self.black_level, self.prnu, self.dsnu) < 0:
            raise SettingError('Noise and black level of the camera cannot be below 0.')

    @property
    def top(self) -> int:
        """The highest number."""
        return (1 << self.bits) - 1

    @property
    def saturation(self) -> float:
        """The strength of light that fills a pixel."""
        return (1 - self.black_level) / self.exposure

    def noise(self, light: NDArray[np.float32]) -> NDArray[np.float32]:
        """Root mean square noise of a pixel in one frame, in the unit of `light`, with that of rounding."""
        per_light = self.full_well * self.exposure
        electrons = np.maximum(light, 0) * np.float32(per_light)
        quantum = self.full_well / self.top
        total: NDArray[np.float32] = np.sqrt(electrons + np.float32(self.read_noise**2 + quantum**2 / 12))
        total /= np.float32(per_light)
        return total

    def sensor(self, shape: tuple[int, int], seed: Seed) -> 'Sensor':
        """The camera's pixels, each with the gain and offset of its own; same seed, same pixels."""
        rng = np.random.default_rng(seed)
        gain = 1 + self.prnu * rng.standard_normal(shape, dtype=np.float32)
        offset = self.dsnu * rng.standard_normal(shape, dtype=np.float32)
        return Sensor(self, gain.astype(np.float32), offset.astype(np.float32))


@dataclass(frozen=True)
class Sensor:
    """Pixels of a camera: (H, W) float32 gain, and offset in electrons."""

    camera: Camera
    gain: NDArray[np.float32]
    offset: NDArray[np.float32]

    def expose(self, light: NDArray[np.float32], seed: Seed) -> Frame:
        """One frame.

        Shot and read noise are drawn as one normal number of their common variance: for the tens of
        electrons and more that a pixel here holds, a Poisson count looks the same and costs ten times more.

        Args:
            light: (H, W) float32, 1 fills `exposure` of the full well.
            seed: of this frame's noise.

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
"""Nothing but the steps of 16 bits: for the errors that optics and method make by themselves."""
