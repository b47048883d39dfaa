# SPDX-License-Identifier: Apache-2.0
"""The network, run by ONNX Runtime: the probability of each point, tile by tile."""

import math
import os
import threading
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from socialcircle_ros.circle.adaptive import Probabilities
from socialcircle_ros.circle.adaptive.heights import RelativeHeights
from socialcircle_ros.circle.adaptive.likelihood import ONE
from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.kernels import bands
from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel
from socialcircle_ros.kernels.machine import usable_cores
from socialcircle_ros.settings import CPU_PROVIDER, require_runtime

from .features import Part, Rounding, squares_of
from .scales import scales_of

if TYPE_CHECKING:
    from collections.abc import Mapping

WEIGHTS = Path(__file__).with_name('network.onnx')
"""The weights of the package."""
WHOLE = 1_400_000
"""Largest cloud, in points, that is one tile. The points that it is filled up with to the multiple of the network
count, because they are computed, too."""
TILE = 640
"""Side of the tiles of a larger cloud, in points; a multiple of the network's, so that tiles change nothing. With
its surroundings a tile takes about 100 MB."""

FEATURES, LOGITS = 'features', 'logits'
"""Names of the input and of the output."""
_SHORT = 'thread', 'alloc', 'resource temporarily unavailable'
"""Words of ONNX Runtime where the machine has too little memory or too few threads."""
VERSION = '3'
"""Version of the input, in the metadata of the file."""


Logits = npt.NDArray[np.uint8]
"""(h, w, 4) uint8: of the points of squares, in the order of `features.Squares`."""


class NetworkJudge:
    """A network that is ready to judge; it may be used by several threads at a time.

    Attributes:
        card: the metadata of the file: what the network was trained on.
    """

    def __init__(self, path: Path, threads: int, provider: str = CPU_PROVIDER) -> None:
        """Read the file.

        Args:
            path: of an ONNX file with 8-bit weights that the training wrote.
            threads: to compute with.
            provider: execution provider of ONNX Runtime that computes.

        Raises:
            SocialCircleError: ONNX Runtime is not installed, cannot read the file, or cannot use the provider.
        """
        require_runtime()
        from socialcircle_ros.onnx_runtime import onnxruntime  # noqa: PLC0415 - slow to load

        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        options.inter_op_num_threads = 1
        options.use_deterministic_compute = True
        # Threads that spin between clouds would take the cores from the driver of the camera.
        options.add_session_config_entry('session.intra_op.allow_spinning', '0')
        # Otherwise memory for the largest cloud so far is kept.
        options.enable_cpu_mem_arena = False
        try:
            self._session = onnxruntime.InferenceSession(str(path), options, providers=[provider])
        except Exception as error:  # noqa: BLE001 - the errors of ONNX Runtime share no other base
            said = (str(error).splitlines() or [type(error).__name__])[0]
            cause = said.replace(str(path), '').lower()
            if isinstance(error, MemoryError) or any(each in cause for each in _SHORT):
                raise SocialCircleError(
                    f'Memory or threads are short, so that {path.name} cannot be loaded: end other programs, or'
                    f' allow more (ulimit -v, ulimit -u). ONNX Runtime says: {said}'
                ) from None
            raise SocialCircleError(f'{path} cannot be read as a network: {said}') from None
        # ONNX Runtime takes the CPU then, and says so in its log alone.
        if provider not in self._session.get_providers():
            raise SocialCircleError(
                f'circle.provider: {provider} cannot be used on this machine: what it needs is missing, such'
                f' as a driver. Use {CPU_PROVIDER}.'
            )
        self.card: Mapping[str, str] = self._session.get_modelmeta().custom_metadata_map
        if self.card.get('features') != VERSION:
            raise SocialCircleError(
                f'{path} is no rounded network of this version: give what the training wrote for -o.'
            )
        self._halo, self._multiple = int(self.card['halo']), int(self.card['multiple'])
        self._rounding = Rounding(float(self.card['features_step']), int(self.card['features_zero']))
        self._bytes = bytes_of(Rounding(float(self.card['logits_step']), int(self.card['logits_zero'])))

    def probabilities(self, heights: RelativeHeights) -> Probabilities:
        """Compute the probability of each point to be an outlier.

        The tiles depend on the size of the cloud alone, and overlap by what a probability depends on, so that
        they change no probability. Nor does the number of threads.

        Args:
            heights: (H, W) float32, NaN where not measured; at least one point is measured.
        """
        scales = scales_of(heights)
        height, width = heights.shape
        found = np.empty(heights.shape, np.uint8)
        rows, columns = self._tile(height, width)
        for top in range(0, height, rows):
            for left in range(0, width, columns):
                core = Part(top, min(top + rows, height), left, min(left + columns, width))
                part = Part(
                    max(0, core.top - self._halo),
                    min(height, core.bottom + self._halo),
                    max(0, core.left - self._halo),
                    min(width, core.right + self._halo),
                )
                squares = squares_of(
                    heights,
                    scales,
                    part,
                    self._filled(part.bottom - part.top) // 2,
                    self._filled(part.right - part.left) // 2,
                    self._rounding,
                )
                (logits,) = self._session.run([LOGITS], {FEATURES: squares[None]})
                write_probabilities(logits[0], self._bytes, part, core, heights, found)
        return found

    def _tile(self, height: int, width: int) -> tuple[int, int]:
        """Rows and columns of the tiles of a cloud.

        A cloud of few rows or columns has long tiles, of the area of a square one: square tiles would consist
        mostly of their surroundings.
        """
        full, wide = self._filled(height), self._filled(width)
        if full * wide <= WHOLE:
            return height, width
        side = TILE + 2 * self._halo
        if full <= side:
            return height, self._length(side, full)
        if wide <= side:
            return self._length(side, wide), width
        return TILE, TILE

    def _length(self, side: int, across: int) -> int:
        """Length of a tile, without its surroundings, that is `across` wide and has the area of side × side."""
        return side * side // across // self._multiple * self._multiple - 2 * self._halo

    def _filled(self, size: int) -> int:
        """Rows or columns of a part, filled up to a multiple."""
        return -(-size // self._multiple) * self._multiple


_loading = threading.Lock()


def packaged_network(provider: str = CPU_PROVIDER) -> NetworkJudge:
    """The network of the package, read once for this process, the provider, and the number of threads in force.

    Args:
        provider: execution provider of ONNX Runtime that computes.

    Raises:
        SocialCircleError: ONNX Runtime is not installed, or cannot use the provider.
    """
    with _loading:
        return _load(usable_cores() if bands.limit is None else bands.limit, provider)


@lru_cache(maxsize=2)
def _load(threads: int, provider: str) -> NetworkJudge:
    return NetworkJudge(WEIGHTS, threads, provider)


def _close_before_a_fork() -> None:
    """Drop the session: a child process has no threads of it, and would wait for them for ever to drop it."""
    _loading.acquire()
    _load.cache_clear()


os.register_at_fork(before=_close_before_a_fork, after_in_parent=_loading.release, after_in_child=_loading.release)


def bytes_of(rounding: Rounding) -> Probabilities:
    """The probability of each byte that a logit can be, (256,) uint8."""
    logits = np.float32(rounding.step) * (np.arange(256, dtype=np.float32) - np.float32(rounding.zero))
    return (ONE / (1 + np.exp(-logits.astype(np.float64))) + 0.5).astype(np.uint8)


def write_probabilities(
    logits: Logits,
    probabilities: Probabilities,
    part: Part,
    core: Part,
    heights: RelativeHeights,
    found: Probabilities,
) -> None:
    """Write the probabilities of a tile, 0 where not measured.

    Args:
        logits: (h, w, 4) uint8, of the part in squares.
        probabilities: (256,) uint8, of each logit.
        part: that the network saw.
        core: what of it is written.
        heights: (H, W) float32, the whole cloud.
        found: (H, W) uint8, receives the probabilities.
    """

    def write(band: slice) -> None:
        _write(logits, probabilities, part, core, core.top + band.start, core.top + band.stop, heights, found)

    in_bands(write, core.bottom - core.top, core.right - core.left)


@kernel
def _write(
    logits: Logits,
    probabilities: Probabilities,
    part: Part,
    core: Part,
    first: int,
    end: int,
    heights: RelativeHeights,
    found: Probabilities,
) -> None:
    for row in range(first, end):
        down = row - part.top
        line = logits[down // 2]
        for column in range(core.left, core.right):
            right = column - part.left
            probability = probabilities[line[right // 2, 2 * (down & 1) + (right & 1)]]
            found[row, column] = probability if math.isfinite(heights[row, column]) else np.uint8(0)
