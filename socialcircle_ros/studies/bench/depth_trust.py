# SPDX-License-Identifier: Apache-2.0
"""What else than noise spoils a focus stack, on simulated stacks: order, losses, flicker, drift, blank areas."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from socialcircle_ros.focus import TRUSTED_QUALITY, FocusResult, FocusStack, Frame, Reason, depth_from_focus
from socialcircle_ros.messages.header import Header
from socialcircle_ros.messages.image import encode_image
from socialcircle_ros.messages.point_cloud import PointCloud
from socialcircle_ros.pipeline.stack_cloud import FIELDS, StackCloud
from socialcircle_ros.pipeline.stacks import StackAssembler
from socialcircle_ros.settings import FocusSettings, StackSettings
from socialcircle_ros.simulation import NOISELESS, Camera, Optics, Simulation, Stage, simulate

SEEDS = (30, 31)
"""Held-out seeds, as those of `depth_error`."""

SHAPE = (176, 224)
_PERIOD_NS = 20_000_000
_BLANK_CAMERAS = {
    '8 bits, 10 000 e-': Camera(),
    '8 bits, 50 000 e-': Camera(full_well=50_000, read_noise=5),
    '8 bits, a fifth of the exposure': Camera(exposure=0.12),
    '12 bits, 100 000 e-': Camera(bits=12, full_well=100_000),
}
_STEADY = Stage(jitter=0, encoder_noise=0)
MACRO = Optics(magnification=1.0, numerical_aperture=0.1, pixel=5.0)
"""A macro lens at life size, f/2.5."""

_MARGIN = 24
INNER = (slice(_MARGIN, -_MARGIN), slice(_MARGIN, -_MARGIN))
_LOBES = 8
"""Of the interpolation of moved frames, which must be finer than that of what is tested."""


@dataclass(frozen=True)
class TrustRow:
    """One figure.

    Attributes:
        name: what was done to the stacks.
        figure: what was measured.
        value: the result.
        unit: of the value; '%': it is a share of pixels.
    """

    name: str
    figure: str
    value: float
    unit: Literal['%', 'steps'] = '%'

    def __str__(self) -> str:
        """The value with its unit."""
        return f'{100 * self.value:.2f} %' if self.unit == '%' else f'{self.value:.3f} {self.unit}'


def trust_rows(seeds: Sequence[int] = SEEDS) -> Iterator[TrustRow]:
    """Measure everything.

    Args:
        seeds: of surface and noise.
    """
    yield from _order(seeds)
    yield from _losses(seeds)
    yield from _flicker(seeds)
    yield from _drift(seeds)
    yield from _blanks(seeds)


def _order(seeds: Sequence[int]) -> Iterator[TrustRow]:
    """The same frames upward, downward and shuffled."""
    differ, marked = [], []
    for seed in seeds:
        scan = simulate('metal_groove', *SHAPE, seed=seed)
        frames, z = _frames(scan)
        sorted_once = depth_from_focus(frames, z)
        downward = _streamed(frames, z, range(len(z))[::-1])
        upward = _streamed(frames, z, range(len(z)))
        differ += [_differ(sorted_once, downward), _differ(sorted_once, upward)]
        shuffled = _streamed(frames, z, np.random.default_rng(seed).permutation(len(z)).tolist())
        unmarked = shuffled.reasons & Reason.INCOMPLETE == 0
        marked.append((1 - unmarked.mean(), float(np.mean(shuffled.quality[~unmarked] > 0.5))))
    yield TrustRow('upward or downward', 'pixels that differ from depth_from_focus', max(differ))
    yield TrustRow('shuffled', 'pixels marked incomplete', float(np.mean([each[0] for each in marked])))
    yield TrustRow('shuffled', 'of these, with a quality above 0.5', max(each[1] for each in marked))


def _losses(seeds: Sequence[int]) -> Iterator[TrustRow]:
    """Frames that are lost while z is counted: every seventh, and three in a row."""
    for name, lost in (('every 7th frame lost, z counted', 7), ('3 frames in a row lost, z counted', 0)):
        bad = []
        for seed in seeds:
            scan = simulate('metal_groove', *SHAPE, seed=seed, stage=_STEADY)
            images, z = _frames(scan)
            middle = len(z) // 2
            came = [k for k in range(len(z)) if (k % lost != 3 if lost else k not in range(middle, middle + 3))]
            cloud = _assembled([images[k] for k in came], came, float(z[0]), float(np.median(np.diff(z))))
            verdict = scan.truth.classify(cloud[0])
            trusted = (cloud[1] >= TRUSTED_QUALITY) & (verdict.good | verdict.bad)
            bad.append(float(verdict.bad[trusted].mean()))
        yield TrustRow(name, f'pixels of quality >= {TRUSTED_QUALITY:g} that are bad', float(np.mean(bad)))


def _flicker(seeds: Sequence[int]) -> Iterator[TrustRow]:
    """A lamp that flickers by 5 %."""
    for name, flicker, settings in (
        ('steady lamp', 0.0, FocusSettings()),
        ('flicker of 5 %', 0.05, FocusSettings()),
        ('flicker of 5 %, focus.normalize false', 0.05, FocusSettings(normalize=False)),
    ):
        errors = []
        for seed in seeds:
            scan = simulate('flat', *SHAPE, seed=seed, stage=_STEADY, flicker=flicker)
            frames, z = _frames(scan)
            errors.append(_good_errors(scan, depth_from_focus(frames, z, settings), z))
        yield TrustRow(name, 'RMS error', _rms(errors), unit='steps')


def _drift(seeds: Sequence[int]) -> Iterator[TrustRow]:
    """A part that moves sideways during the scan, and a macro lens that magnifies as it focuses."""
    for moved, magnification in ((1.0, 0.0), (5.0, 0.0), (0.0, 0.02), (5.0, 0.03)):
        name = ' and '.join(
            ([f'drift of {moved:g} px'] if moved else [])
            + ([f'{100 * magnification:g} % of magnification'] if magnification else [])
        )
        errors: dict[bool, list[npt.NDArray[np.float64]]] = {False: [], True: []}
        for seed in seeds:
            scan, frames, z = moving_frames('flat', (0.3 * moved, moved), magnification, seed)
            for register, parts in errors.items():
                found = np.full(scan.truth.depth.shape, np.nan)
                found[INNER] = depth_from_focus(frames, z, register=register).depth
                verdict = scan.truth.classify(found)
                error = verdict.error[~verdict.missing]
                parts.append(error[np.abs(error) < scan.optics.depth_of_field] / np.median(np.diff(z)))
        for register, parts in errors.items():
            yield TrustRow(
                f'macro lens, {name}{", stack.register" if register else ""}', 'RMS error', _rms(parts), 'steps'
            )


def moving_frames(
    specimen: str, moved: tuple[float, float], magnification: float, seed: int
) -> tuple[Simulation, list[Frame], npt.NDArray[np.float64]]:
    """Frames of a part that moves and grows steadily; the first one shows `INNER` of the scan.

    Args:
        specimen: name of a material.
        moved: along y and x from the first frame to the last one, pixels.
        magnification: growth from the first frame to the last one, as a share.
        seed: of surface and noise.

    Returns:
        The scan, with a margin around the frames and without their motion; the frames; their z.
    """
    whole = SHAPE[0] + 2 * _MARGIN, SHAPE[1] + 2 * _MARGIN
    scan = simulate(specimen, *whole, seed=seed, instrument=MACRO, stage=_STEADY, camera=NOISELESS, flicker=0.0)
    sensor = Camera().sensor(SHAPE, np.random.default_rng(seed))
    frames, z = [], []
    for frame in scan.frames():
        part = frame.index / (len(scan) - 1)
        light = (frame.image / NOISELESS.top - NOISELESS.black_level) / NOISELESS.exposure
        down, across = (
            _sampled(size, (np.arange(size) - middle - part * shift) / (1 + part * magnification) + middle)
            for size, middle, shift in zip(SHAPE, (np.array(SHAPE) - 1) / 2, moved, strict=True)
        )
        frames.append(sensor.expose((down @ light @ across.T).astype(np.float32), frame.index))
        z.append(frame.z)
    return scan, frames, np.array(z)


def _sampled(size: int, positions: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """The matrix that interpolates an axis, with a margin on either side, at positions in its inner part."""
    distance = positions[:, np.newaxis] + _MARGIN - np.arange(size + 2 * _MARGIN)
    weights = np.where(np.abs(distance) < _LOBES, np.sinc(distance) * np.sinc(distance / _LOBES), 0)
    found: npt.NDArray[np.float64] = weights / weights.sum(axis=1, keepdims=True)
    return found


def _blanks(seeds: Sequence[int]) -> Iterator[TrustRow]:
    """Areas without texture, from black to bright."""
    rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]] / np.array(SHAPE)[:, None, None]
    light = ((0.01 + 1.1 * rows**2) * (1 - 0.15 * columns)).astype(np.float32)
    for name, camera in _BLANK_CAMERAS.items():
        found, trusted = [], []
        for seed in seeds:
            rng = np.random.default_rng(seed)
            sensor = camera.sensor(SHAPE, rng)
            stack = FocusStack()
            for k in range(40):
                stack.add(sensor.expose(light * np.float32(1 + 0.005 * rng.standard_normal()), rng), k)
            result = stack.finish()
            found.append(float(np.isfinite(result.depth).mean()))
            trusted.append(float(np.mean(result.quality >= TRUSTED_QUALITY)))
        yield TrustRow(f'blank, {name}', 'pixels with a depth', float(np.mean(found)))
        yield TrustRow(f'blank, {name}', f'pixels of quality >= {TRUSTED_QUALITY:g}', float(np.mean(trusted)))


def _frames(scan: Simulation) -> tuple[list[Frame], npt.NDArray[np.float64]]:
    frames = list(scan.frames())
    return [frame.image for frame in frames], np.array([frame.z for frame in frames])


def _streamed(frames: Sequence[Frame], z: npt.NDArray[np.float64], order: Sequence[int]) -> FocusResult:
    stack = FocusStack()
    for index in order:
        stack.add(frames[index], float(z[index]))
    return stack.finish()


def _differ(one: FocusResult, other: FocusResult) -> float:
    """Share of the pixels whose depth or quality differs in any bit."""
    same = (one.depth == other.depth) | (np.isnan(one.depth) & np.isnan(other.depth))
    return float(1 - np.mean(same & (one.quality == other.quality)))


def _good_errors(scan: Simulation, result: FocusResult, z: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    verdict = scan.truth.classify(result.depth)
    errors: npt.NDArray[np.float64] = verdict.error[verdict.good] / np.median(np.diff(z))
    return errors


def _rms(errors: Sequence[npt.NDArray[np.float64]]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))


def _assembled(
    frames: Sequence[Frame], numbers: Sequence[int], start: float, step: float
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """Heights and quality of frames whose z is counted, as the node makes them; 1 µm is a metre here."""
    assembler = StackAssembler()
    assembler.configure(FocusSettings(), StackSettings(pitch_x=1e-6, z_start=start, z_step=step))
    for number, frame in zip(numbers, frames, strict=True):
        for _ in assembler.add_frame(encode_image(Header.at(number * _PERIOD_NS, ''), frame)):
            pass
    (event,) = assembler.finish()
    if not isinstance(event, StackCloud):
        raise TypeError(event)
    cloud = PointCloud.decode(event.points)
    values = np.frombuffer(cloud.message, '<f4', cloud.data_length // 4, cloud.data_start)
    values = values.reshape(*frames[0].shape, len(FIELDS))
    return values[..., FIELDS.index('z')], values[..., FIELDS.index('quality')]
