# SPDX-License-Identifier: Apache-2.0
"""The stage: the position of the focus over time, and what the encoder reports of it."""

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
        jitter: root mean square deviation from the motion at constant speed, µm; below 20 Hz.
        encoder_noise: root mean square error of the reported positions, µm.
        joint_rate: reported positions per second.
    """

    frame_rate: float = 50.0
    jitter: float = 0.1
    encoder_noise: float = 0.01
    joint_rate: float = 250.0

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            SettingError: a value is out of its range.
        """
        if not (self.frame_rate > 0 and self.joint_rate > 0):
            raise SettingError('The rates of the stage must be above 0.')
        if min(self.jitter, self.encoder_noise) < 0:
            raise SettingError('Jitter and encoder noise of the stage cannot be below 0.')


@dataclass(frozen=True, eq=False)
class Travel:
    """One run of the stage: positions in µm, times in ns from the first frame.

    Attributes:
        stamps: (N,) int64, the middle of the exposure of each frame.
        z_nominal: (N,) float64, nominal position of each frame: start + index · step.
        z_true: (N,) float64, true position of each frame.
        z: (N,) float64, position of each frame that the encoder reports.
        joint_stamps: (M,) int64, times of the reports, from before the first frame to after the last one.
        joint_z: (M,) float64, the reported positions at these times.
    """

    stamps: NDArray[np.int64]
    z_nominal: NDArray[np.float64]
    z_true: NDArray[np.float64]
    z: NDArray[np.float64]
    joint_stamps: NDArray[np.int64]
    joint_z: NDArray[np.float64]


def travel(stage: Stage, start: float, step: float, frames: int, seed: Seed) -> Travel:
    """Move the stage through a scan.

    The jitter is a sum of sines. Positions between the reported ones can therefore be interpolated, as the node
    does for the stamps of the frames.

    Args:
        stage: the stage.
        start: nominal z of the first frame, µm.
        step: distance of two frames, µm.
        frames: number of frames.
        seed: of the jitter and the encoder noise.
    """
    rng = np.random.default_rng(seed)
    frequency = rng.uniform(0.5, 20.0, 12)
    phase = rng.uniform(0, 2 * np.pi, 12)

    def position(time_s: NDArray[np.float64]) -> NDArray[np.float64]:
        sines = np.sin(2 * np.pi * np.outer(time_s, frequency) + phase).sum(axis=1) / np.sqrt(6)
        z: NDArray[np.float64] = start + step * stage.frame_rate * time_s + stage.jitter * sines
        return z

    index = np.arange(frames, dtype=np.float64)
    time_s = index / stage.frame_rate
    count = int(np.ceil(time_s[-1] * stage.joint_rate)) + 5
    joint_time_s = (np.arange(count) - 2) / stage.joint_rate
    z_true = position(time_s)
    return Travel(
        stamps=np.rint(time_s * 1e9).astype(np.int64),
        z_nominal=start + step * index,
        z_true=z_true,
        z=z_true + stage.encoder_noise * rng.standard_normal(frames),
        joint_stamps=np.rint(joint_time_s * 1e9).astype(np.int64),
        joint_z=position(joint_time_s) + stage.encoder_noise * rng.standard_normal(count),
    )
