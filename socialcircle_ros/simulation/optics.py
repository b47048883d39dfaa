# SPDX-License-Identifier: Apache-2.0
"""The optics of the microscope: how sharp a point is imaged, in focus and out of focus.

The model is incoherent imaging in air, equal over the whole field. The optical transfer function is the product of
that of the diffraction at a circular pupil, that of the aperture of a pixel, and that of the geometric circle of
confusion. There are no aberrations and no field curvature, and the magnification does not change with focus
(object-side telecentric).

Sources: J. W. Goodman, Introduction to Fourier Optics, section 6.4; P. A. Stokseth, Properties of a defocused
optical system, J. Opt. Soc. Am. 59 (1969) 1314-1321, DOI 10.1364/JOSA.59.001314.
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
        magnification: of objective and tube lens together.
        numerical_aperture: NA, in air.
        wavelength: mean, µm.
        pixel: side of a pixel of the camera, µm.
    """

    magnification: float = 10.0
    numerical_aperture: float = 0.3
    wavelength: float = 0.55
    pixel: float = 10.0

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            SettingError: a value is out of its range.
        """
        if not 0 < self.numerical_aperture < 1:
            raise SettingError(
                f'The numerical aperture is {self.numerical_aperture}; in air it must be above 0 and below 1.'
            )
        if not (self.magnification > 0 and self.wavelength > 0 and self.pixel > 0):
            raise SettingError('Magnification, wavelength and pixel must all be above 0.')

    @property
    def pitch(self) -> float:
        """Side of a pixel on the object, µm."""
        return self.pixel / self.magnification

    @property
    def depth_of_field(self) -> float:
        """λ / NA², µm: the range in which diffraction hides the defocus."""
        return self.wavelength / self.numerical_aperture**2

    @property
    def cone(self) -> float:
        """Tangent of the half angle of the light cone: radius of the circle of confusion per µm of defocus."""
        return math.tan(math.asin(self.numerical_aperture))

    def sharp_transfer(self, fx: NDArray[np.float64], fy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Transfer function in focus: diffraction at a circular pupil, and the square aperture of a pixel.

        Args:
            fx: frequencies along x, 1/µm.
            fy: frequencies along y, 1/µm; broadcast against `fx`.

        Returns:
            The transfer, 1 at most, in the shape of `fx` and `fy`.
        """
        nu = np.minimum(np.hypot(fx, fy) * self.wavelength / (2 * self.numerical_aperture), 1.0)
        pupil = (2 / np.pi) * (np.arccos(nu) - nu * np.sqrt(1 - nu**2))
        transfer: NDArray[np.float64] = pupil * np.sinc(fx * self.pitch) * np.sinc(fy * self.pitch)
        return transfer

    def defocus_transfer(self, frequency: NDArray[np.float64], defocus: float) -> NDArray[np.float64]:
        """Transfer function of the circle of confusion: 2 J1(x) / x with x = 2π · radius · frequency.

        Args:
            frequency: 1/µm, any shape.
            defocus: distance from the plane in focus, µm, of either sign.

        Returns:
            The transfer in the shape of `frequency`, 1 at most; negative where the blur inverts the contrast.
        """
        x = 2 * np.pi * abs(defocus) * self.cone * frequency
        table = np.linspace(0.0, max(float(x.max()), 1e-6), 4096)
        # 2 J1(x) / x = 2/π ∫ √(1-t²) cos(xt) dt, by Gauss-Chebyshev quadrature with n > x / 2 nodes.
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
"""Usual objectives of focus variation, on a camera with pixels of 10 µm."""
