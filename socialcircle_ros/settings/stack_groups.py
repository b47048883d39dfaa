# SPDX-License-Identifier: Apache-2.0
"""The parameters of focus stacks: how focus is measured, and how frames become stacks and clouds."""

from dataclasses import dataclass
from typing import ClassVar, Literal

from socialcircle_ros.errors import SettingError

from .schema import Settings, setting

Fit = Literal['gauss', 'gauss3']


@dataclass(frozen=True)
class FocusSettings(Settings):
    """Settings of depth from focus (section 3.1 of the paper)."""

    group: ClassVar[str] = 'focus'

    step: int = setting(
        0,
        'Step s of the modified Laplacian (eq. 1). 0: chosen from the frames of each stack: 2, or 4 on frames that'
        ' are binned 4×4 where many more pixels are then reliable, as where the camera resolves more than the'
        ' optics. 1 responds to the finest texture, 2 or 3 tolerate more noise.',
        unit='pixels',
        minimum=0,
        maximum=8,
    )
    half_window: int = setting(
        4,
        'Half-width N of the window of the focus measure (eq. 2). Larger windows average noise, smaller windows'
        ' resolve finer steps. Twice as wide where a step of 4 is chosen.',
        unit='pixels',
        minimum=0,
        maximum=15,
    )
    threshold: int = setting(
        0,
        'Threshold T on the modified Laplacian (eq. 3). Smaller values count as 0. 0: all values count.',
        unit='gray levels',
        minimum=0,
        maximum=262140,
    )
    fit: Fit = setting(
        'gauss',
        "Fit of the focus curve between frames. 'gauss': uses as many frames as the curve is wide. 'gauss3':"
        " Nayar's fit through three frames.",
    )
    normalize: bool = setting(
        True,
        'Whether the focus measure of each frame is divided by the mean light of the frame, so that a lamp that'
        ' flickers or an exposure that changes moves no peak.',
    )
    saturation: int | None = setting(
        None,
        'Gray level from which a pixel counts as saturated. 0: the largest value of the data type. A 12-bit camera'
        ' that sends mono16 needs 4095.',
        unit='gray levels',
        minimum=0,
        maximum=65535,
        empty=0,
    )

    def _check_together(self) -> None:
        if self.saturation == 0:
            raise SettingError(
                'focus.saturation must be above 0; use None for the largest value of the data type.'
            )


ZSource = Literal['step', 'joint_states']


@dataclass(frozen=True)
class StackSettings(Settings):
    """Settings that group frames into stacks and scale clouds to metres. A change applies to the next stack."""

    group: ClassVar[str] = 'stack'

    pitch_x: float = setting(
        0.0,
        'Distance of neighbouring pixels along x on the part. It must be set before a stack can become a cloud.',
        unit='m',
        minimum=0.0,
        maximum=1.0,
    )
    pitch_y: float = setting(
        0.0,
        'Distance of neighbouring pixels along y on the part. 0: the same as pitch_x.',
        unit='m',
        minimum=0.0,
        maximum=1.0,
    )
    z_source: ZSource = setting(
        'step',
        "Source of the z of each frame. 'step': z_start plus z_step for each frame. 'joint_states': the stage"
        ' position, interpolated at the stamp of the frame.',
    )
    z_start: float = setting(0.0, 'z of the first frame, with z_source step.', unit='m')
    z_step: float = setting(
        0.0,
        'Change of z from frame to frame, negative for a downward scan. It must be set with z_source step.',
        unit='m',
    )
    check_stamps: bool = setting(
        True,
        'Whether z is counted by the stamps of the frames, with z_source step: a gap of whole periods counts as'
        ' lost frames, and a stack whose stamps fit no steady period is refused. false: each frame counts as one'
        ' step, whatever its stamp, as for a stage that stops for each frame.',
    )
    joint: str = setting('', 'Name of the joint that gives z, with z_source joint_states. Empty: the first joint.')
    latency: float = setting(
        0.0,
        'Time from the position of the stage to the stamp of the frame that shows it, with z_source joint_states;'
        ' negative if the stamp comes first. socialcircle calibrate latency measures it.',
        unit='s',
        minimum=-1.0,
        maximum=1.0,
    )
    frames: int = setting(
        0, 'Number of frames after which a stack ends. 0: no limit.', unit='frames', minimum=0, maximum=30000
    )
    max_pixels: int = setting(
        25_000_000,
        'Largest frame. A larger one is refused: a stack needs 86 bytes per pixel.',
        unit='pixels',
        minimum=1,
        maximum=1_000_000_000,
    )
    timeout: float = setting(
        1.0, 'Time without a frame after which a stack ends. 0: no limit.', unit='s', minimum=0.0, maximum=3600.0
    )
    end_at_turn: bool = setting(
        False, 'Whether a stack ends when z reverses. The first frame after the reversal begins the next stack.'
    )
    register: bool = setting(
        False,
        'Whether each frame is moved and scaled to where the first one shows the part, for macro stacks that move'
        ' sideways or change their magnification. Pixels that leave the picture have no depth.',
    )
    preview: int = setting(
        0,
        'Number of frames between two clouds of the unfinished stack on stack/preview. 0: none are published.',
        unit='frames',
        minimum=0,
        maximum=30000,
    )
