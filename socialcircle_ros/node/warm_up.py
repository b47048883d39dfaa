# SPDX-License-Identifier: Apache-2.0
"""Compilation before the first cloud, on a thread that a signal does not wait for. No rclpy."""

import contextlib
import os
import subprocess
import sys
import threading
import zlib
from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from socialcircle_ros.circle.adaptive.communities import communities_of
from socialcircle_ros.circle.adaptive.far import far_points
from socialcircle_ros.circle.adaptive.likelihood import probable_outliers
from socialcircle_ros.circle.adaptive.spread import estimate_spread
from socialcircle_ros.circle.network.features import Part, Rounding, squares_of
from socialcircle_ros.circle.network.inference import write_probabilities
from socialcircle_ros.circle.network.scales import scales_of
from socialcircle_ros.cloud import load_row, measured_points
from socialcircle_ros.errors import SettingError, SocialCircleError
from socialcircle_ros.focus import FocusStack
from socialcircle_ros.kernels.compiled import cache_folder, folder_of, is_cached, kernel
from socialcircle_ros.kernels.imports import without_module
from socialcircle_ros.kernels.memory import unmap_code
from socialcircle_ros.messages.gray import gray_of_colour, gray_of_mosaic
from socialcircle_ros.messages.header import Header
from socialcircle_ros.messages.image import encode_image
from socialcircle_ros.messages.point_cloud import encode_point_cloud
from socialcircle_ros.pipeline.clouds import filter_cloud
from socialcircle_ros.pipeline.stacks import StackAssembler
from socialcircle_ros.settings import (
    CPU_PROVIDER,
    CircleSettings,
    FocusSettings,
    Judge,
    Mode,
    OutputSettings,
    PipelineSettings,
    RepairSettings,
    StackSettings,
    require_runtime,
)

_HelperPart = Literal['stack', 'rare']  # what a helper process compiles, apart from clouds in a mode

_PERIOD_S = 0.05  # between two checks whether the caller still waits


class WarmUp:
    """Compiles the kernels for clouds and frames, or loads them from the cache: the common ones first.

    The first start compiles for seconds and cannot be interrupted. Therefore it runs on a thread of its own, which
    may still run when the process ends. The rare kernels need only be in the cache: loading one takes 10 to 250 ms
    when it is used first, 13 MB for all of them, and the interpreter's lock, for which a cloud would wait.
    """

    def __init__(self) -> None:
        self._thread: threading.Thread | None = None
        self._ready = threading.Event()
        self._error: Exception | None = None

    @property
    def running(self) -> bool:
        """Whether kernels are still being compiled."""
        return self._thread is not None and self._thread.is_alive()

    def wait(self, wanted: Callable[[], bool], mode: Mode, judge: Judge, provider: str) -> bool:
        """Begin on the first call, and wait until the common kernels are ready.

        Args:
            wanted: called periodically; the wait ends when it returns False.
            mode: the mode of the filter that is compiled first.
            judge: what decides in the adaptive mode; the network is read.
            provider: what computes the network; it is tried.

        Returns:
            Whether they are ready.

        Raises:
            SocialCircleError: a kernel could not be compiled, or the provider cannot be used.
        """
        if self._thread is None:
            self._thread = threading.Thread(
                target=self._run, args=(mode, judge, provider), name='warm_up', daemon=True
            )
            self._thread.start()
        while wanted():
            if self._ready.wait(_PERIOD_S):
                if self._error is not None:
                    raise SocialCircleError(f'The filter cannot be compiled: {self._error}')
                return True
        return False

    def _run(self, mode: Mode, judge: Judge, provider: str) -> None:
        cold = False
        try:
            # Numba would import it with its first kernel, for 16 MB and a tenth of the start; no kernel uses it.
            with without_module('scipy.linalg'):
                cold = _is_cold()
            _compile_common(mode, judge, provider, cold=cold)
        except Exception as error:  # noqa: BLE001 - raised in the thread that waits
            self._error = error
        self._ready.set()
        try:
            if self._error is None:
                _cache_rare()
        finally:
            unmap_code('libllvmlite')  # 50 MB, which only compiling and loading need


def _compile_common(mode: Mode, judge: Judge, provider: str = CPU_PROVIDER, *, cold: bool) -> None:
    """Clouds of both types under default settings, and a stack of 8 bits.

    If the cache is `cold`, two helper processes fill it: Numba compiles one kernel at a time, and compiling leaves
    130 MB in a process. This process then loads the kernels.
    """
    if cold:
        _wait_for(_helper(mode), _helper('stack'))
    _filter(mode, judge, provider)
    _measure(np.uint8)


def _read_network(circle: CircleSettings) -> None:
    """Try the network, if ONNX Runtime is installed; the command says so if it is not."""
    try:
        require_runtime()
    except SettingError:
        return
    _filter(circle.mode, circle.judge)


def _filter(mode: Mode, judge: Judge, provider: str = CPU_PROVIDER) -> None:
    """Filter clouds of both types: with a depth of field by the rules, and by the network if it judges."""
    circle = CircleSettings(mode=mode, judge=judge, provider=provider)
    by_network = mode == 'adaptive' and judge == 'network'
    if by_network:
        _see()
    for kind in (np.float32, np.float64):
        for depth_of_field in (1.0, None) if by_network else (1.0,):
            filter_cloud(_cloud(kind), PipelineSettings(circle=circle), depth_of_field=depth_of_field)


def steps() -> Iterator[Callable[[], object]]:
    """Calls that compile all kernels of the node, the default mode's first; a kernel that fails is an error.

    The kernels before and after the network are compiled without ONNX Runtime, too.
    """
    yield lambda: _compile_common(CircleSettings().mode, 'rules', cold=_is_cold())
    yield partial(_read_network, CircleSettings())
    yield from _rare()


def is_warm() -> bool:
    """Whether all kernels of this version are in a cache; none is compiled."""
    return is_cached(_all_rare())


def folder() -> Path | None:
    """The folder under which the cache holds all kernels, once `steps` were done; None: there is none.

    Numba gives each package its own folder there, and `__pycache__` in a package that can be written.
    """
    used = folder_of(_all_rare())
    if used is None:
        return None
    path = Path(used)
    return path.parents[1] if path.name == '__pycache__' else path.parent


def _is_cold() -> bool:
    """Whether the first kernel of every cloud was not in the cache; then the others are not either."""
    measured_points(np.zeros((1, 1, 3), np.float32))
    statistics = getattr(load_row, 'stats')  # noqa: B009 - Numba's, which a plain function does not have
    return bool(statistics.cache_misses)


def _helper(part: 'Mode | _HelperPart') -> 'subprocess.Popen[bytes] | None':
    """A process that runs `_help`; None: it would be of no use, or no process can be started."""
    if not os.access(cache_folder() or '', os.W_OK):
        return None  # this process could not load what the helper compiles
    program = f'from {__name__} import _help; _help({part!r})'
    with contextlib.suppress(OSError):
        # Ctrl-C in a terminal is for the node alone: the helper ends with it.
        return subprocess.Popen(  # noqa: S603 - our own
            [sys.executable, '-c', program], stdin=subprocess.PIPE, start_new_session=True
        )
    return None


def _wait_for(*helpers: 'subprocess.Popen[bytes] | None') -> None:
    for helper in helpers:
        if helper is not None:
            with helper:
                helper.wait()


def _help(part: 'Mode | _HelperPart') -> None:
    """Compile into the cache for clouds in a mode, for a stack or what is rare, unless the parent process ends.

    What cannot be compiled is left to the parent process, which says so.
    """

    def end_with_parent() -> None:
        sys.stdin.read()  # returns when the parent closes it or ends
        os._exit(0)

    threading.Thread(target=end_with_parent, daemon=True).start()
    with contextlib.suppress(Exception):
        if part == 'stack':
            _measure(np.uint8)
        elif part == 'rare':
            _compile_rare()
        else:
            _filter(part, 'rules')
            _see()
    os._exit(0)


def _cache_rare() -> None:
    """Put the kernels that other settings or another camera need into the cache, unless they are there.

    A helper process compiles them, so that this one need not load them. Where nothing can be cached, this process
    compiles them.
    """
    if is_warm():
        return
    helper = _helper('rare')
    if helper is None:
        _compile_rare()
    else:
        _wait_for(helper)


def _compile_rare() -> None:
    """Compile the rare kernels. What cannot be compiled fails by itself, and says so, when it is used."""
    for compile_some in _rare():
        with contextlib.suppress(Exception):
            compile_some()


def _rare() -> Iterator[Callable[[], object]]:
    """Calls that compile rare kernels, each apart from the others; the last one tells that all were called."""
    for other in get_args(Mode):
        settings = PipelineSettings(circle=CircleSettings(mode=other, judge='rules'))
        yield partial(filter_cloud, _cloud(np.float32), settings, depth_of_field=1.0)
    # The length of the frame name decides where the points begin; float64 may lie at half of its size.
    for kind, frame in ((np.float32, ''), (np.float64, ''), (np.float64, 'four')):
        cloud = _cloud(kind, frame)
        yield partial(filter_cloud, cloud, PipelineSettings(circle=CircleSettings(mode='paper', window=5)))
        for method in ('biharmonic', 'spline'):
            repair = RepairSettings(method=method)
            output = OutputSettings(repaired=True)
            settings = PipelineSettings(circle=CircleSettings(judge='rules'), output=output, repair=repair)
            yield partial(filter_cloud, cloud, settings)
    yield _see
    yield _measure_communities
    yield partial(_measure, np.uint16)
    yield partial(_measure, np.uint8, in_colour=True)
    yield partial(_register, np.uint8)
    yield partial(_register, np.uint16)
    pixels = np.frombuffer(bytes(48), np.uint8)  # read-only, as in a message
    for blue_first in (False, True):
        yield partial(gray_of_colour, pixels.reshape(4, 4, 3), blue_first=blue_first)
    yield partial(gray_of_mosaic, pixels.reshape(6, 8))
    yield _all_rare()


@cache
def _all_rare() -> Callable[[], int]:
    """A kernel that does nothing, and is compiled last: if it is in the cache, the others are, too.

    Numba compiles a kernel anew if a variable around it has changed. So any change of the package makes it compile
    this one, like those that it stands for.
    """
    package = Path(__file__).parents[1]
    states = [path.stat() for path in sorted(package.rglob('*.py'))]
    version = zlib.crc32(repr([(each.st_mtime_ns, each.st_size) for each in states]).encode())

    @kernel
    def all_rare() -> int:
        return version

    return all_rare


def _cloud(kind: type[np.floating], frame: str = '') -> bytes:
    """A rough plane with a spike to remove and repair, large enough for every step."""
    rows, columns = np.mgrid[:40, :36]
    heights = (rows % 2).astype(float)
    heights[6, 5] = 99.0
    return encode_point_cloud(Header.at(0, frame), np.dstack([columns, rows, heights]).astype(kind))


def _see() -> None:
    """All kernels round the network, without reading it, which takes memory."""
    heights = np.random.default_rng(0).normal(size=(40, 36)).astype(np.float32)
    heights[2, 3], heights[20, 30] = np.nan, 99.0  # the spike is far off
    whole, measured = Part(0, 40, 0, 36), np.isfinite(heights)
    squares = squares_of(heights, scales_of(heights), whole, 20, 18, Rounding(0.1, 128))
    probabilities = np.empty(heights.shape, np.uint8)
    all_bytes = np.arange(256, dtype=np.uint8)
    write_probabilities(np.ascontiguousarray(squares[..., :4]), all_bytes, whole, whole, heights, probabilities)
    probable_outliers(probabilities, measured)
    far_points(heights, estimate_spread(heights, 16, may_predict=False), ~measured, measured)


def _measure_communities() -> None:
    """The kernels of a lesson."""
    heights = np.random.default_rng(0).normal(size=(40, 36)).astype(np.float32)
    communities_of(heights, heights > 2, np.abs(heights), 1.0)


def _measure(kind: type[np.unsignedinteger], *, in_colour: bool = False) -> None:
    assembler = StackAssembler()
    assembler.configure(FocusSettings(), StackSettings(pitch_x=1.0, z_step=1.0, frames=3))
    texture = (np.indices((40, 34)).sum(axis=0) % 3).astype(kind)
    if in_colour:
        texture = np.dstack([texture] * 3)
    for brightness in (1, 9, 2):
        list(assembler.add_frame(encode_image(Header(), texture * kind(brightness))))


def _register(kind: type[np.unsignedinteger]) -> None:
    """Measure frames that move to the right."""
    texture = np.random.default_rng(0).integers(0, 200, (60, 80)).astype(kind)
    stack = FocusStack(register=True)
    for number in range(3):
        stack.add(np.ascontiguousarray(texture[:, 4 * number : 4 * number + 56]), number)
    stack.finish()
