"""The virtual instrument: a specimen scanned through focus, frame by frame, and the truth about it."""

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


@dataclass(frozen=True)
class StackFrame:
    """One frame of a focus stack.

    Attributes:
        index: from 0.
        stamp: ns from the first frame, the middle of the exposure.
        z: where the encoder saw the stage, µm.
        z_true: where it was, µm.
        image: (H, W) uint8 or uint16.
    """

    index: int
    stamp: int
    z: float
    z_true: float
    image: Frame


@dataclass(frozen=True)
class Simulation:
    """A focus stack that is rendered as it is read.

    Attributes:
        specimen: what is measured.
        optics: through what.
        camera: with what.
        travel: where the stage was at each frame, and what it reported, frames and joint states.
        seed: of the camera's noise and the lamp.
        flicker: root mean square of the lamp's strength from frame to frame, as a share.
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
        """How many frames."""
        return len(self.travel.stamps)

    def frames(self) -> Iterator[StackFrame]:
        """The frames in the order in which they are taken; each call gives the same bytes again.

        Each is rendered when it is asked for: memory does not grow with their number.
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
        """What makes the images, ready for the whole travel."""
        return self._layered if self.renderer_name == 'layered' else RayRenderer(*self._view)

    @cached_property
    def truth(self) -> DepthTruth:
        """The true depth, and where trouble lies; good and bad bounds are shares of the depth of field."""
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

    The same arguments give the same bytes, on one machine and one set of libraries.

    Args:
        specimen: a name of `MATERIALS`, or one of your own with the pitch of the optics.
        rows: of a named specimen.
        columns: of a named specimen.
        instrument: a name of `INSTRUMENTS`, or optics of your own.
        camera: 8 bits and a full well of 10 000 electrons if None.
        stage: 50 frames per second and 0.1 µm of jitter if None.
        frames: how many; as many as the surface asks for if None.
        z_step: between frames, µm; a quarter of the depth of field, or what `frames` asks for, if None.
        flicker: of the lamp from frame to frame, root mean square, as a share.
        renderer: 'layered', or 'rays' for small fields with walls.
        seed: of everything random.

    Raises:
        SettingError: an unknown name, or a value out of its range.

    Example:
        >>> scan = simulate('flat', 60, 80, frames=12, seed=1)
        >>> first = next(scan.frames())
        >>> first.image.shape, len(scan)
        ((60, 80), 12)
    """
    if isinstance(instrument, str) and instrument not in INSTRUMENTS:
        raise SettingError(f'There is no instrument {instrument!r}; use one of: {", ".join(INSTRUMENTS)}.')
    optics = INSTRUMENTS[instrument] if isinstance(instrument, str) else instrument
    if renderer not in ('layered', 'rays'):
        raise SettingError(f"There is no renderer {renderer!r}; use 'layered' or 'rays'.")
    if frames is not None and frames < 2:
        raise SettingError(f'A stack of {frames} frames has no depth; give at least 2.')
    if z_step is not None and not z_step > 0:
        raise SettingError(f'The z step is {z_step} µm; it must be above 0.')
    if flicker < 0:
        raise SettingError(f'The flicker is {flicker}; it cannot be below 0.')
    if isinstance(specimen, str):
        specimen = make_specimen(specimen, rows, columns, pitch=optics.pitch, seed=seed)

    # Curves need their feet: the scan goes on for 1.5 depths of field above and below the surface.
    low, high = float(specimen.surface.min()), float(specimen.surface.max())
    span = high - low + 3 * optics.depth_of_field
    if z_step is None:
        z_step = span / (frames - 1) if frames is not None else optics.depth_of_field / 4
    if frames is None:
        frames = int(np.ceil(span / z_step)) + 1
    start = (low + high - (frames - 1) * z_step) / 2
    moves = travel(Stage() if stage is None else stage, start, z_step, frames, np.random.SeedSequence([seed, 0]))
    return Simulation(
        specimen=specimen,
        optics=optics,
        camera=Camera() if camera is None else camera,
        travel=moves,
        seed=seed,
        flicker=flicker,
        renderer_name=renderer,
    )
