"""The stage: where the focus is at each moment, and where the encoder says that it is."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.errors import SettingError

from .surfaces import Seed


@dataclass(frozen=True)
class Stage:
    """A stage that moves upward at constant speed while the camera takes its frames.

    Attributes:
        frame_rate: frames per second.
        jitter: root mean square deviation from constant speed, µm; slower than 20 Hz.
        encoder_noise: root mean square error of what is reported, µm.
        joint_rate: reported positions per second.
    """

    frame_rate: float = 50.0
    jitter: float = 0.1
    encoder_noise: float = 0.01
    joint_rate: float = 250.0

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            SettingError: one is out of its range.
        """
        if not (self.frame_rate > 0 and self.joint_rate > 0):
            raise SettingError('The rates of the stage must be above 0.')
        if min(self.jitter, self.encoder_noise) < 0:
            raise SettingError('Jitter and encoder noise of the stage cannot be below 0.')


@dataclass(frozen=True)
class Travel:
    """One run of the stage; all heights in µm, times in ns from the first frame.

    Attributes:
        stamps: (N,) int64, of the frames; the middle of the exposure.
        z_nominal: (N,) float64, where the frames were meant to be: start + index · step.
        z_true: (N,) float64, where they were.
        z: (N,) float64, where the encoder said that they were.
        joint_stamps: (M,) int64, from before the first to after the last frame.
        joint_z: (M,) float64, what the encoder reported then.
    """

    stamps: NDArray[np.int64]
    z_nominal: NDArray[np.float64]
    z_true: NDArray[np.float64]
    z: NDArray[np.float64]
    joint_stamps: NDArray[np.int64]
    joint_z: NDArray[np.float64]


def travel(stage: Stage, start: float, step: float, frames: int, seed: Seed) -> Travel:
    """Move through a scan.

    The jitter is a sum of sines, so that positions between the reported ones can be interpolated, as the
    node does it for the frames' stamps.

    Args:
        stage: how it moves.
        start: z of the first frame, µm.
        step: from frame to frame, µm.
        frames: how many.
        seed: of jitter and encoder noise.
    """
    rng = np.random.default_rng(seed)
    frequency = rng.uniform(0.5, 20.0, 12)
    phase = rng.uniform(0, 2 * np.pi, 12)

    def position(seconds: NDArray[np.float64]) -> NDArray[np.float64]:
        sines = np.sin(2 * np.pi * np.outer(seconds, frequency) + phase).sum(axis=1) / np.sqrt(6)
        z: NDArray[np.float64] = start + step * stage.frame_rate * seconds + stage.jitter * sines
        return z

    index = np.arange(frames, dtype=np.float64)
    seconds = index / stage.frame_rate
    count = int(np.ceil(seconds[-1] * stage.joint_rate)) + 5
    joint_seconds = (np.arange(count) - 2) / stage.joint_rate
    z_true = position(seconds)
    return Travel(
        stamps=np.rint(seconds * 1e9).astype(np.int64),
        z_nominal=start + step * index,
        z_true=z_true,
        z=z_true + stage.encoder_noise * rng.standard_normal(frames),
        joint_stamps=np.rint(joint_seconds * 1e9).astype(np.int64),
        joint_z=position(joint_seconds) + stage.encoder_noise * rng.standard_normal(count),
    )
