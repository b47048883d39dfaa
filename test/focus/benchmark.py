# SPDX-License-Identifier: Apache-2.0
"""Time of one frame and of the fit, beside OpenCV. This is a script, because OpenCV is not a dependency.

    python test/focus/benchmark.py

OpenCV runs two filters with the kernel [-1 2 -1], spread by the step, and one box sum, on one thread. All
candidates run in turn on the same frames. Times are CPU times of the calling thread.
"""

import time

import cv2
import numpy as np

from socialcircle_ros.focus import FocusStack, focus_measure
from socialcircle_ros.settings import FocusSettings


def make_frames(count=40, shape=(960, 1280), seed=1):
    """Make a scan of a tilted, rough surface: texture at eight degrees of blur, noise of 2 gray levels."""
    rng = np.random.default_rng(seed)
    texture = rng.standard_normal(shape).astype(np.float32)
    blurred = np.stack([cv2.GaussianBlur(texture, (0, 0), s) for s in (0.9, 1.1, 1.4, 1.9, 2.5, 3.2, 4, 6)])
    rough = cv2.GaussianBlur(rng.standard_normal(shape).astype(np.float32), (0, 0), 12) * 20
    surface = 8 + (count - 16) * np.arange(shape[1]) / shape[1] + rough
    for z in range(count):
        level = np.minimum(np.abs(z - surface).astype(int), 7)
        seen = 110 + 60 * np.take_along_axis(blurred, level[None], 0)[0] + 2 * rng.standard_normal(shape)
        yield np.clip(seen, 0, 255).astype(np.uint8)


def two_filters_and_box_sum(frame, settings):
    """The focus measure by OpenCV."""
    taps = np.zeros((1, 2 * settings.step + 1), np.float32)
    taps[0, 0] = taps[0, -1] = -1
    taps[0, settings.step] = 2
    across, along = cv2.filter2D(frame, cv2.CV_16S, taps), cv2.filter2D(frame, cv2.CV_16S, taps.T)
    laplacian = cv2.add(np.abs(across, out=across), np.abs(along, out=along))
    side = 2 * settings.half_window + 1
    return cv2.boxFilter(laplacian, cv2.CV_32F, (side, side), normalize=False, borderType=cv2.BORDER_CONSTANT)


def run():
    """Median times in ms, and the median ratio."""
    cv2.setNumThreads(1)
    settings = FocusSettings()
    stack, times_ms, frames = FocusStack(settings), [], list(make_frames())
    for z, frame in enumerate(frames):  # compiles, and allocates the memory
        stack.add(frame, z)
    stack.reset()
    for z, frame in enumerate(frames):
        row_ms = []
        for candidate in (
            lambda frame=frame: two_filters_and_box_sum(frame, settings),
            lambda frame=frame: focus_measure(frame, settings),
            lambda frame=frame, z=z: stack.add(frame, z),
        ):
            start = time.thread_time()
            candidate()
            row_ms.append(1e3 * (time.thread_time() - start))
        times_ms.append(row_ms)
    times_ms = np.array(times_ms)
    stack.finish()
    finish_ms = []
    for _ in range(9):
        start = time.thread_time()
        stack.finish()
        finish_ms.append(1e3 * (time.thread_time() - start))
    opencv, measure, add = np.median(times_ms, 0)
    return {
        'opencv': opencv,
        'focus_measure': measure,
        'add': add,
        'add, slowest': times_ms[:, 2].max(),
        'add / opencv': np.median(times_ms[:, 2] / times_ms[:, 0]),
        'finish': np.median(finish_ms),
    }


if __name__ == '__main__':
    for name, value in run().items():
        print(f'{name:16} {value:6.2f}')  # noqa: T201
