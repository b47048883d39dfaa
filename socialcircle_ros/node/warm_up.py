"""Compiling before the first cloud comes, on a thread that a signal need not wait for. No rclpy."""

import os
import subprocess
import sys
import threading
from collections.abc import Callable
from typing import Any, cast, get_args

import numpy as np

from socialcircle_ros.cloud import load_row, measured_points
from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.messages.gray import gray_of_colour, gray_of_mosaic
from socialcircle_ros.messages.header import Header
from socialcircle_ros.messages.image import encode_image
from socialcircle_ros.messages.point_cloud import encode_point_cloud
from socialcircle_ros.pipeline.clouds import filter_cloud
from socialcircle_ros.pipeline.stacks import StackAssembler
from socialcircle_ros.settings import (
    CircleSettings,
    FocusSettings,
    Mode,
    OutputSettings,
    RepairSettings,
    StackSettings,
)

_LOOK = 0.05  # s between two looks whether somebody still waits


class WarmUp:
    """Compiles, or loads from the cache, what clouds and frames need: first the common, then the rare.

    Compiling takes seconds on the very first start, and cannot be interrupted; so it has a thread of its own,
    which the process may leave behind when it ends.
    """

    def __init__(self) -> None:
        self._thread: threading.Thread | None = None
        self._ready = threading.Event()
        self._error: Exception | None = None
        self._mode: Mode = 'paper'

    @property
    def running(self) -> bool:
        """Whether something is still being compiled."""
        return self._thread is not None and self._thread.is_alive()

    def wait(self, wanted: Callable[[], bool], mode: Mode) -> bool:
        """Begin, if that has not been done, and wait until the common is ready.

        Args:
            wanted: asked again and again; once it says no, nothing is waited for.
            mode: of the filter, which is compiled first.

        Returns:
            Whether it is ready.

        Raises:
            SocialCircleError: something could not be compiled.
        """
        if self._thread is None:
            self._mode = mode
            self._thread = threading.Thread(target=self._run, name='warm_up', daemon=True)
            self._thread.start()
        while wanted():
            if self._ready.wait(_LOOK):
                if self._error is not None:
                    raise SocialCircleError(f'The filter cannot be compiled: {self._error}')
                return True
        return False

    def _run(self) -> None:
        try:
            _compile_common(self._mode)
        except Exception as error:  # noqa: BLE001 - told to whom waits
            self._error = error
        self._ready.set()
        if self._error is None:
            _compile_rare()


def _compile_common(mode: Mode) -> None:
    """Clouds of both types under default settings, and a stack of 8 bits.

    On the very first start another process compiles for the stack meanwhile: numba compiles one thing at a time,
    and what the other leaves in the cache is loaded here.
    """
    helper = _helper() if _is_cold() else None
    for kind in (np.float32, np.float64):
        filter_cloud(_cloud(kind), CircleSettings(mode=mode), depth_of_field=1.0)
    if helper is not None:
        with helper:
            helper.wait()
    _measure(np.uint8)


def _is_cold() -> bool:
    """Whether what every cloud needs first was not in the cache, so that the rest is not either."""
    measured_points(np.zeros((1, 1, 3), np.float32))
    return bool(cast('Any', load_row).stats.cache_misses)


def _helper() -> 'subprocess.Popen[bytes]':
    """A process that runs `_help`."""
    program = f'from {__name__} import _help; _help()'
    return subprocess.Popen([sys.executable, '-c', program], stdin=subprocess.PIPE)  # noqa: S603 - our own


def _help() -> None:
    """Compile for the stack into the cache, unless the process that asked for it ends."""

    def end_with_parent() -> None:
        sys.stdin.read()  # until the parent closes it, or is gone
        os._exit(0)

    threading.Thread(target=end_with_parent, daemon=True).start()
    _measure(np.uint8)
    os._exit(0)


def _compile_rare() -> None:
    """What a setting or another camera asks for."""
    for other in get_args(Mode):
        filter_cloud(_cloud(np.float32), CircleSettings(mode=other), depth_of_field=1.0)
    # Where the points begin in a message goes with the name of the frame; float64 may lie at half of its size.
    for kind, frame in ((np.float32, ''), (np.float64, ''), (np.float64, 'four')):
        cloud = _cloud(kind, frame)
        filter_cloud(cloud, CircleSettings(window=5))
        for method in ('biharmonic', 'spline'):
            filter_cloud(cloud, None, OutputSettings(repaired=True), RepairSettings(method=method))
    _measure(np.uint16)
    pixels = np.frombuffer(bytes(48), np.uint8)  # read-only, as in a message
    for blue_first in (False, True):
        gray_of_colour(pixels.reshape(4, 4, 3), blue_first=blue_first)
    gray_of_mosaic(pixels.reshape(6, 8))


def _cloud(kind: type[np.floating], frame: str = '') -> bytes:
    """A rough plane with a spike: something to remove and to repair, and large enough for every step."""
    rows, columns = np.mgrid[:40, :36]
    heights = (rows % 2).astype(float)
    heights[6, 5] = 99.0
    return encode_point_cloud(Header.at(0, frame), np.dstack([columns, rows, heights]).astype(kind))


def _measure(kind: type[np.unsignedinteger]) -> None:
    assembler = StackAssembler()
    assembler.configure(FocusSettings(), StackSettings(pitch_x=1.0, z_step=1.0, frames=3))
    texture = (np.indices((12, 10)).sum(axis=0) % 3).astype(kind)
    for brightness in (1, 9, 2):
        list(assembler.add_frame(encode_image(Header(), texture * kind(brightness))))
