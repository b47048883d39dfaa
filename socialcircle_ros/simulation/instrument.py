# SPDX-License-Identifier: Apache-2.0
"""The virtual instrument: a specimen scanned through focus, frame by frame, and its true depth."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from socialcircle_ros.errors import SettingError
from socialcircle_ros.focus import Frame

from .camera import Camera
from .optics import INSTRUMENTS, Optics
from .rendering import LayeredRenderer, RayRenderer, Renderer
from .specimen import Specimen, make_specimen
from .stage import Stage, Travel, travel
from .truth import DepthTruth, causes

RendererName = Literal['layered', 'rays']

_LEAST_FRAMES = 3  # from which a depth is measured


@dataclass(frozen=True, eq=False)
class StackFrame:
    """One frame of a focus stack.

    Attributes:
        index: from 0.
        stamp: middle of the exposure, ns from the first frame.
        z: position of the stage that the encoder reports, µm.
        z_true: true position of the stage, µm.
        image: (H, W) uint8 or uint16.
    """

    index: int
    stamp: int
    z: float
    z_true: float
    image: Frame


@dataclass(frozen=True)
class Simulation:
    """A simulated focus stack. Its frames are rendered when they are read.

    Attributes:
        specimen: the specimen.
        optics: of the microscope.
        camera: of the microscope.
        travel: true and reported positions of the stage.
        seed: of the noise of the camera and the lamp.
        flicker: standard deviation of the light of the lamp from frame to frame, as a share.
        renderer_name: 'layered' or 'rays'.
    """

    specimen: Specimen
    optics: Optics
    camera: Camera
    travel: Travel
    seed: int
    flicker: float
    renderer_name: RendererName

    def __len__(self) -> int:
        """The number of frames."""
        return len(self.travel.stamps)

    def frames(self) -> Iterator[StackFrame]:
        """Render the frames in the order in which they are taken. Each call gives the same bytes.

        A frame is rendered when the iterator reaches it, so that memory does not grow with their number.
        """
        lamp, pattern, noise = np.random.SeedSequence([self.seed, 1]).spawn(3)
        strength = 1 + self.flicker * np.random.default_rng(lamp).standard_normal(len(self))
        sensor = self.camera.sensor(self.specimen.grid.shape, np.random.default_rng(pattern))
        moves = self.travel
        for index, seed in enumerate(noise.spawn(len(self))):
            light = self.renderer.render(float(moves.z_true[index])) * np.float32(strength[index])
            yield StackFrame(
                index=index,
                stamp=int(moves.stamps[index]),
                z=float(moves.z[index]),
                z_true=float(moves.z_true[index]),
                image=sensor.expose(light, seed),
            )

    @cached_property
    def renderer(self) -> Renderer:
        """The renderer, prepared for the whole travel."""
        return self._layered if self.renderer_name == 'layered' else RayRenderer(*self._view)

    @cached_property
    def truth(self) -> DepthTruth:
        """The true depth and the causes of failure; the bounds are 0.25 and 0.5 of the depth of field."""
        flags = causes(
            self.specimen.surface,
            self.specimen.grid,
            self._layered.sharp,
            self._layered.glare(),
            self.camera,
        )
        field = self.optics.depth_of_field
        return DepthTruth(self.specimen.surface, flags, good_bound=0.25 * field, bad_bound=0.5 * field)

    @cached_property
    def _layered(self) -> LayeredRenderer:
        return LayeredRenderer(*self._view)

    @property
    def _view(self) -> tuple[Specimen, Optics, float, float]:
        z = self.travel.z_true
        return self.specimen, self.optics, float(z.min()), float(z.max())


def simulate(
    specimen: str | Specimen = 'metal_groove',
    rows: int = 480,
    columns: int = 640,
    *,
    instrument: str | Optics = '10x',
    camera: Camera | None = None,
    stage: Stage | None = None,
    frames: int | None = None,
    z_step: float | None = None,
    flicker: float = 0.005,
    renderer: RendererName = 'layered',
    seed: int = 0,
) -> Simulation:
    """Scan a specimen through focus.

    The same arguments give the same bytes, on one machine with one set of libraries.

    Args:
        specimen: a name of `MATERIALS`, or a specimen with the pitch of the optics.
        rows: of a named specimen.
        columns: of a named specimen.
        instrument: a name of `INSTRUMENTS`, or the optics.
        camera: None: 8 bits and a full well of 10 000 electrons.
        stage: None: 50 frames per second and a jitter of 0.1 µm.
        frames: number of frames; None: as many as the surface needs.
        z_step: distance of two frames, µm; None: given by `frames`, or else a quarter of the depth of field.
        flicker: standard deviation of the light of the lamp from frame to frame, as a share.
        renderer: 'layered'; or 'rays', for small fields with walls.
        seed: of everything random.

    Returns:
        The stack, not yet rendered.

    Raises:
        SettingError: a name is unknown, or a value is out of its range.

    Example:
        >>> scan = simulate('flat', 60, 80, frames=12, seed=1)
        >>> first = next(scan.frames())
        >>> first.image.shape, len(scan)
        ((60, 80), 12)
    """
    optics = _named_optics(instrument) if isinstance(instrument, str) else instrument
    _check_scan(frames, z_step, flicker, renderer)
    if isinstance(specimen, str):
        specimen = make_specimen(specimen, rows, columns, pitch=optics.pitch, seed=seed)
    start, z_step, frames = _plan_scan(specimen, optics, frames, z_step)
    return Simulation(
        specimen=specimen,
        optics=optics,
        camera=Camera() if camera is None else camera,
        travel=travel(stage or Stage(), start, z_step, frames, np.random.SeedSequence([seed, 0])),
        seed=seed,
        flicker=flicker,
        renderer_name=renderer,
    )


def _named_optics(name: str) -> Optics:
    if name not in INSTRUMENTS:
        raise SettingError(f'There is no instrument {name!r}; use one of: {", ".join(INSTRUMENTS)}.')
    return INSTRUMENTS[name]


def _check_scan(frames: int | None, z_step: float | None, flicker: float, renderer: RendererName) -> None:
    if renderer not in ('layered', 'rays'):
        raise SettingError(f"There is no renderer {renderer!r}; use 'layered' or 'rays'.")
    if frames is not None and frames < _LEAST_FRAMES:
        raise SettingError(f'A stack of {frames} frames has no depth; give at least {_LEAST_FRAMES}.')
    if z_step is not None and not z_step > 0:
        raise SettingError(f'The z step is {z_step} µm; it must be above 0.')
    if flicker < 0:
        raise SettingError(f'The flicker is {flicker}; it cannot be below 0.')


def _plan_scan(
    specimen: Specimen, optics: Optics, frames: int | None, z_step: float | None
) -> tuple[float, float, int]:
    """Place the frames symmetrically about the surface.

    The default scan extends 1.5 depths of field above and below the surface, so that focus curves are complete.

    Returns:
        z of the first frame, the distance of two frames, both in µm, and the number of frames.
    """
    low, high = float(specimen.surface.min()), float(specimen.surface.max())
    span = high - low + 3 * optics.depth_of_field
    if z_step is None:
        z_step = span / (frames - 1) if frames is not None else optics.depth_of_field / 4
    if frames is None:
        frames = max(int(np.ceil(span / z_step)) + 1, _LEAST_FRAMES)
    return (low + high - (frames - 1) * z_step) / 2, z_step, frames
