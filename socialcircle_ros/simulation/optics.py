"""The microscope's optics: how sharp a point is imaged, in focus and out of it.

Incoherent imaging in air, the same over the whole field: the transfer function is that of the diffraction
at a circular pupil, times the pixel's aperture, times the geometric circle of confusion. No aberrations, no
field curvature, no change of magnification with focus (object-side telecentric).
Source: J. W. Goodman, Introduction to Fourier Optics, 6.4; P. A. Stokseth, J. Opt. Soc. Am. 59 (1969) 1314.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.errors import SettingError


@dataclass(frozen=True)
class Optics:
    """An objective on a camera.

    Attributes:
        magnification: of the objective and tube.
        numerical_aperture: NA, in air.
        wavelength: mean, µm.
        pixel: side of a camera pixel, µm; on the object it is `pitch`.
    """

    magnification: float = 10.0
    numerical_aperture: float = 0.3
    wavelength: float = 0.55
    pixel: float = 10.0

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            SettingError: one is out of its range.
        """
        if not 0 < self.numerical_aperture < 1:
            raise SettingError(f'A numerical aperture of {self.numerical_aperture} in air needs 0 to below 1.')
        if not (self.magnification > 0 and self.wavelength > 0 and self.pixel > 0):
            raise SettingError('Magnification, wavelength and pixel must all be above 0.')

    @property
    def pitch(self) -> float:
        """Distance of two points on the object, µm."""
        return self.pixel / self.magnification

    @property
    def depth_of_field(self) -> float:
        """λ / NA², µm: the depth within which diffraction hides the defocus."""
        return self.wavelength / self.numerical_aperture**2

    @property
    def cone(self) -> float:
        """Tangent of the half angle of the light cone: radius of confusion per µm of defocus."""
        return math.tan(math.asin(self.numerical_aperture))

    def sharp_transfer(self, fx: NDArray[np.float64], fy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Transfer in focus: diffraction at a circular pupil, and the pixel's square aperture.

        Args:
            fx: frequencies along x, 1/µm.
            fy: along y, broadcast against `fx`.

        Returns:
            0 to 1, without unit.
        """
        nu = np.minimum(np.hypot(fx, fy) * self.wavelength / (2 * self.numerical_aperture), 1.0)
        pupil = (2 / np.pi) * (np.arccos(nu) - nu * np.sqrt(1 - nu**2))
        transfer: NDArray[np.float64] = pupil * np.sinc(fx * self.pitch) * np.sinc(fy * self.pitch)
        return transfer

    def defocus_transfer(self, frequency: NDArray[np.float64], defocus: float) -> NDArray[np.float64]:
        """Transfer of the circle of confusion: 2 J1(x) / x with x = 2π · radius · frequency.

        Args:
            frequency: 1/µm, any shape.
            defocus: distance from the plane in focus, µm, of either sign.

        Returns:
            As `frequency`, 1 at most; below 0 where a disc turns the contrast round.
        """
        x = 2 * np.pi * abs(defocus) * self.cone * frequency
        table = np.linspace(0.0, max(float(x.max()), 1e-6), 4096)
        # 2 J1(x) / x = 2/π ∫ √(1-t²) cos(xt) dt, by Gauss and Chebyshev's rule; exact while n > x / 2.
        n = 16 + int(table[-1])
        angle = np.arange(1, n // 2 + 1) * np.pi / (n + 1)
        bessel = 4 / (n + 1) * (np.sin(angle) ** 2 @ np.cos(np.cos(angle)[:, np.newaxis] * table))
        if n % 2:
            bessel += 2 / (n + 1)
        transfer: NDArray[np.float64] = np.interp(x, table, bessel)
        return transfer


INSTRUMENTS: dict[str, Optics] = {
    '5x': Optics(5.0, 0.15),
    '10x': Optics(10.0, 0.3),
    '20x': Optics(20.0, 0.4),
    '50x': Optics(50.0, 0.6),
}
"""Objectives as focus variation uses them, on a camera of 10 µm pixels."""
