# SPDX-License-Identifier: Apache-2.0
"""Calibration of an instrument from its own recordings and images: the latency of the stamps, and the pitch."""

import dataclasses
import itertools
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from socialcircle_ros.errors import ImportFileError, StackError
from socialcircle_ros.focus import TRUSTED_QUALITY
from socialcircle_ros.interface import STACK_FRAMES, STACK_JOINT_STATES
from socialcircle_ros.messages.point_cloud import PointCloud
from socialcircle_ros.pipeline.stack_cloud import FIELDS, StackCloud
from socialcircle_ros.pipeline.stacks import Refusal, StackAssembler, StackEvent
from socialcircle_ros.settings import PipelineSettings

from .any_file import open_recording
from .offline import stacks_of
from .pictures import ImagePage, read_pictures

PASSES = 3
"""How often `measure_latency` reads the recording, each time with a better latency."""

_LEAST_PIXELS = 100
_LEAST_PERIODS = 4
_FINER = 4  # padding of the spectrum
_CLEAR = 20.0  # least height of the peak of a grating over the median of the spectrum


@dataclass(frozen=True)
class Latency:
    """The latency of the stamps of frames, from scans in both directions.

    Attributes:
        latency_s: to set as `stack.latency`.
        pairs: scans up and down that were compared.
        spread_s: largest difference of a pair from the median; 0 where there is one pair.
        before_m: difference of the heights of an up and a down scan with the latency that was set.
        after_m: the same with the new latency.
        refused: reasons with which messages or scans were refused, and how often.
        damage: where the recording breaks off; None: it is sound.
    """

    latency_s: float
    pairs: int
    spread_s: float
    before_m: float
    after_m: float
    refused: Mapping[str, int]
    damage: str | None


@dataclass(frozen=True)
class GratingPitch:
    """The distance of two pixels, from the image of a grating.

    Attributes:
        pitch_m: distance of neighbouring pixels.
        period_px: of the grating, pixels.
        angle_deg: of the normal of the lines from the x axis, -90 to 90.
        periods: across the image.
    """

    pitch_m: float
    period_px: float
    angle_deg: float
    periods: float


def measure_latency(
    recording: str | Path, settings: PipelineSettings, seen: Callable[[int], None] = lambda count: None
) -> Latency:
    """Measure the time between the position of the stage and the stamp of the frame that shows it.

    A latency shifts the heights of a scan by the speed of the stage times the latency, in opposite directions for
    a scan up and a scan down. The latency is the difference of the heights divided by that of the speeds.

    Args:
        recording: frames and joint states of at least one scan up and one scan down of the same, unmoved part.
        settings: as for the filter; z must come from joint states.
        seen: called after each message with their number.

    Raises:
        StackError: the recording has no such scans.
        RecordingError: it cannot be read.
    """
    if settings.stack.z_source != 'joint_states':
        raise StackError('A latency needs the positions of the stage: set stack.z_source to joint_states.')
    stack = dataclasses.replace(settings.stack, end_at_turn=True, preview=0)
    settings = dataclasses.replace(settings, stack=stack)
    latency = stack.latency
    apart_m: list[float] = []
    latencies: list[float] = []
    for _ in range(PASSES):  # the frames at a turn may belong to another scan with another latency
        at_latency = dataclasses.replace(settings, stack=dataclasses.replace(stack, latency=latency))
        stage = _read_stage(recording, at_latency, seen)
        pairs = [
            (one, other)
            for one, other in itertools.pairwise(stage.scans)
            if one.speed * other.speed < 0 and one.points.shape == other.points.shape
        ]
        found = [(_difference(one, other), one.speed - other.speed) for one, other in pairs]
        found = [(apart, speeds) for apart, speeds in found if np.isfinite(apart)]
        if not found:
            count = len(stage.scans)
            raise stage.error(
                f'{recording} has {count} scan{"" if count == 1 else "s"}, and no scan up next to a scan'
                f' down with {_LEAST_PIXELS} pixels of quality {TRUSTED_QUALITY:g} in both.'
            )
        latencies = [latency + apart / speeds for apart, speeds in found]
        latency = float(np.median(latencies))
        apart_m.append(float(np.median([abs(apart) for apart, _ in found])))
    return Latency(
        latency_s=latency,
        pairs=len(latencies),
        spread_s=float(np.abs(np.array(latencies) - latency).max()),
        before_m=apart_m[0],
        after_m=apart_m[-1],
        refused=stage.refused,
        damage=stage.damage,
    )


@dataclass(frozen=True, eq=False)
class _StageScan:
    """One scan of the stage."""

    points: npt.NDArray[np.float32]
    """(H, W, 5)"""

    speed: float


@dataclass(frozen=True, eq=False)
class _StageScans:
    """The scans of a recording, and what is not in them."""

    scans: Sequence[_StageScan]

    refused: Mapping[str, int]
    """Reasons with which messages or scans were refused, and how often."""

    damage: str | None
    """Where the recording breaks off; None: it is sound."""

    def error(self, sentence: str) -> StackError:
        """An error for scans that are lacking; it says also what is not in them, which is the likely reason."""
        return StackError(' '.join([sentence, *self.refused, *([self.damage] if self.damage else [])]))


def _read_stage(recording: str | Path, settings: PipelineSettings, seen: Callable[[int], None]) -> _StageScans:
    """The scans of the namespace with frames."""
    with open_recording(recording) as reader:
        namespaces = stacks_of(reader)
        if len(namespaces) != 1:
            raise StackError(f'{recording} must hold the frames of one instrument; it has {len(namespaces)}.')
        frames = STACK_FRAMES.within(namespaces[0])
        assembler = StackAssembler()
        assembler.configure(settings.focus, settings.stack)
        events: list[StackEvent] = []
        for count, message in enumerate(reader.messages([frames, STACK_JOINT_STATES.within(namespaces[0])])):
            is_frame = message.topic == frames
            take = assembler.add_frame if is_frame else assembler.add_joint_state
            events += take(message.data)
            seen(count)
        events += assembler.finish()
        damage = reader.damage
    return _StageScans(
        [_scan(event) for event in events if isinstance(event, StackCloud)],
        Counter(event.reason for event in events if isinstance(event, Refusal)),
        damage,
    )


def _scan(cloud: StackCloud) -> _StageScan:
    decoded = PointCloud.decode(cloud.points)
    values = np.frombuffer(decoded.message, '<f4', decoded.data_length // 4, decoded.data_start)
    return _StageScan(values.reshape(decoded.height, decoded.width, -1), cloud.speed)


def _difference(one: _StageScan, other: _StageScan) -> float:
    """Median height of one scan above the other, in m; NaN where too few pixels are measured in both."""
    z, quality = FIELDS.index('z'), FIELDS.index('quality')
    both = (one.points[..., quality] >= TRUSTED_QUALITY) & (other.points[..., quality] >= TRUSTED_QUALITY)
    if np.count_nonzero(both) < _LEAST_PIXELS:
        return float('nan')
    apart = one.points[both][:, z].astype(np.float64) - other.points[both][:, z]
    return float(np.median(apart))


def measure_pitch(image: npt.NDArray[np.floating] | npt.NDArray[np.integer], period_m: float) -> GratingPitch:
    """Measure the distance of neighbouring pixels from the image of a grating of parallel lines.

    The period in pixels comes from the highest peak of the spectrum, which a parabola through its logarithm places
    between the frequencies. If the lines are neither along x nor along y, pixels must be square.

    Args:
        image: (H, W), gray levels.
        period_m: distance of two lines on the grating.

    Raises:
        StackError: the image shows no grating of four periods or more.
    """
    height, width = image.shape
    window = np.hanning(height + 2)[1:-1, None] * np.hanning(width + 2)[1:-1]
    values = (image - np.average(image, weights=window)) * window
    rows, columns = _FINER * height, _FINER * width
    power = np.abs(np.fft.rfft2(values, (rows, columns)))
    fy, fx = np.fft.fftfreq(rows)[:, None], np.fft.rfftfreq(columns)
    periods = np.hypot(fx * width, fy * height)
    power[periods < _LEAST_PERIODS] = 0
    row, column = np.unravel_index(np.argmax(power), power.shape)
    peak = power[row, column]
    if not peak > _CLEAR * np.median(power[power > 0]):
        raise StackError(
            f'The image shows no grating of {_LEAST_PERIODS} periods or more: focus it, and let its lines fill the'
            ' frame.'
        )
    down = fy[row, 0] + _between(power[:, column], int(row)) / rows
    right = fx[column] + _between(np.abs(power[row]), int(column)) / columns
    frequency = float(np.hypot(right, down))
    angle = float(np.degrees(np.arctan2(down, right)))
    return GratingPitch(
        pitch_m=period_m * frequency,
        period_px=1 / frequency,
        angle_deg=angle if abs(angle) <= 90 else angle - np.copysign(180, angle),
        periods=float(periods[row, column]),
    )


def _between(values: npt.NDArray[np.float64], index: int) -> float:
    """Place of the peak relative to the index of the highest value, by a parabola through three logarithms."""
    mirrored = values[abs(index - 1)], values[index], values[(index + 1) % len(values)]
    before, here, behind = np.log(np.maximum(mirrored, 1e-300))
    bend = before - 2 * here + behind
    return float(0.5 * (before - behind) / bend) if bend < 0 else 0.0


def read_gray(path: Path) -> npt.NDArray[np.uint8] | npt.NDArray[np.uint16]:
    """Read an image as gray levels.

    Raises:
        ImportFileError: it cannot be read, or Pillow is not installed.
    """
    for picture in read_pictures([ImagePage(path, 0)]):
        return picture.pixels
    raise ImportFileError(f'{path} holds no image.')
