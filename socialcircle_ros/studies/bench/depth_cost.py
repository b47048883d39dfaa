# SPDX-License-Identifier: Apache-2.0
"""What a frame of a focus stack costs: processor time, frames per second by cores, memory."""

import time
import tracemalloc
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from socialcircle_ros.focus import FocusStack, Frame
from socialcircle_ros.kernels import bands
from socialcircle_ros.kernels.machine import usable_cores
from socialcircle_ros.simulation import simulate

SHAPES = ((960, 1280), (3000, 4000))
_SIDE = 480
_WARM = 2
"""Frames that are not timed: the first ones allocate memory."""


@dataclass(frozen=True)
class FrameCost:
    """The cost of the frames of a stack, each measured as it comes.

    Attributes:
        shape: (H, W) of the frames.
        register: whether they are registered.
        cores: how many share the work.
        processor_ms: mean processor time of a frame, all cores together.
        frames_per_s: by the median time of a frame.
        finish_s: time from the last frame to the result.
        running_bytes: memory of the running stack for each pixel, without the picture in focus.
        peak_bytes: most memory for each pixel, at the end of the stack, with the results.
    """

    shape: tuple[int, int]
    register: bool
    cores: int
    processor_ms: float
    frames_per_s: float
    finish_s: float
    running_bytes: float
    peak_bytes: float


def frame_costs() -> Iterator[FrameCost]:
    """Measure the default settings on a simulated groove that is repeated over the frame."""
    frames = [frame.image for frame in simulate('metal_groove', _SIDE, _SIDE, seed=1).frames()]
    _measure(frames, (96, 120), register=True, cores=1)  # compiles
    for shape in SHAPES:
        for register in (False, True):
            for cores in (1,) if register else range(1, usable_cores() + 1):
                yield _measure(frames, shape, register=register, cores=cores)


def _measure(tiles: list[Frame], shape: tuple[int, int], *, register: bool, cores: int) -> FrameCost:
    times, processor = [], []
    pixels = shape[0] * shape[1]
    limit, bands.limit = bands.limit, cores
    try:
        stack = FocusStack(register=register)
        for number, tile in enumerate(tiles):
            frame = _tiled(tile, shape)
            start, used = time.perf_counter(), time.process_time()
            stack.add(frame, number)
            times.append(time.perf_counter() - start)
            processor.append(time.process_time() - used)
        start = time.perf_counter()
        stack.finish()
        finish_s = time.perf_counter() - start
        running, peak = _memory(tiles[: 2 * _WARM + 16], shape, register=register)
    finally:
        bands.limit = limit
    return FrameCost(
        shape,
        register,
        cores,
        1e3 * float(np.mean(processor[_WARM:])),
        1 / float(np.median(times[_WARM:])),
        finish_s,
        running / pixels - frame.itemsize,
        peak / pixels,
    )


def _memory(tiles: list[Frame], shape: tuple[int, int], *, register: bool) -> tuple[int, int]:
    """Bytes of the running stack, and the most while it is finished."""
    whole: list[Frame] = [_tiled(tile, shape) for tile in tiles[:3]]
    tracemalloc.start()
    try:
        stack = FocusStack(register=register)
        for number in range(len(tiles)):
            stack.add(whole[number % len(whole)], number)
        running = tracemalloc.get_traced_memory()[0]
        stack.finish()
        return running, tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def _tiled(tile: Frame, shape: tuple[int, int]) -> Frame:
    """A tile, repeated over a frame."""
    frame = np.empty(shape, tile.dtype)
    for row in range(0, shape[0], _SIDE):
        for column in range(0, shape[1], _SIDE):
            part = frame[row : row + _SIDE, column : column + _SIDE]
            part[:] = tile[: part.shape[0], : part.shape[1]]
    found: Frame = frame
    return found
