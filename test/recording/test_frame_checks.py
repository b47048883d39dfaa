# SPDX-License-Identifier: Apache-2.0
"""Which frames do not belong to a stack."""

import numpy as np
import pytest

from socialcircle_ros.errors import ImportFileError
from socialcircle_ros.recording.frame_checks import FrameChecks
from socialcircle_ros.recording.pictures import FramePicture
from socialcircle_ros.simulation import simulate

GRAY = 'gray, 8 bits'


def stack(specimen='pits', frames=25, **options):
    simulation = simulate(specimen, 96, 128, frames=frames, seed=4, **options)
    return np.array([frame.image for frame in simulation.frames()])


def in_focus(frames):
    """Each pixel from its sharpest frame."""
    blurred = np.array(
        [
            np.abs(np.gradient(frame.astype(float), axis=1)) + np.abs(np.gradient(frame.astype(float), axis=0))
            for frame in frames
        ]
    )
    smooth = np.array([np.pad(one, 2, mode='edge') for one in blurred])
    windows = np.lib.stride_tricks.sliding_window_view(smooth, (5, 5), axis=(1, 2)).mean(axis=(3, 4))
    return np.take_along_axis(frames, windows.argmax(axis=0)[np.newaxis], axis=0)[0]


def check(frames, modes=None):
    checks = FrameChecks()
    for number, pixels in enumerate(frames):
        checks.take(f'f{number}', FramePicture(pixels, GRAY if modes is None else modes[number]))
    checks.finish()


@pytest.mark.parametrize('specimen', ['flat', 'pits'])
@pytest.mark.parametrize('frames', [3, 7, 25, 80])
def test_the_frames_of_a_stack_belong_to_it(specimen, frames):
    check(stack(specimen, frames))


@pytest.mark.parametrize('place', [0, 12, 25])
def test_a_picture_in_focus_everywhere_is_no_frame(place):
    frames = stack()
    with pytest.raises(ImportFileError, match=rf'^f{place} is in focus everywhere'):
        check(np.insert(frames, place, in_focus(frames), axis=0))


def test_a_mask_is_no_frame():
    frames = stack(frames=6)
    mask = np.where(np.arange(128) > 60, 255, 0).astype(np.uint8) * np.ones((96, 1), np.uint8)
    with pytest.raises(ImportFileError, match='f6 has only 2 gray values, as a mask has'):
        check([*frames, mask])
    check([*frames, np.zeros_like(mask)])  # a frame may be dark
    check([mask] * 6)


@pytest.mark.parametrize(
    ('pixels', 'mode'),
    [(np.zeros((3, 4), np.uint8), GRAY), (np.zeros((96, 128), np.uint16), 'gray, 16 bits'), (None, 'RGB')],
)
def test_a_frame_of_another_size_or_mode_is_named(pixels, mode):
    frames = list(stack(frames=6))
    other = frames[0] if pixels is None else pixels
    with pytest.raises(
        ImportFileError,
        match=rf'^f6 is {other.shape[0]} rows × .* {mode}, but f0 is 96 rows × 128 columns gray, 8 bits',
    ):
        check([*frames, other], [GRAY] * 6 + [mode])
