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
"""Largest cloud, in points, that is one tile."""
TILE = 640
"""Side of the tiles of a larger cloud, in points; even, as `features.squares_of` needs it. With its surroundings a
tile takes about 100 MB."""

FEATURES, LOGITS = 'features', 'logits'
"""Names of the input and of the output."""
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
            raise SocialCircleError(f'{path} cannot be read as a network: {error}') from None
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
        side = max(heights.shape) if heights.size <= WHOLE else TILE
        for top in range(0, height, side):
            for left in range(0, width, side):
                core = Part(top, min(top + side, height), left, min(left + side, width))
                part = Part(
                    max(0, core.top - self._halo),
                    min(height, core.bottom + self._halo),
                    max(0, core.left - self._halo),
                    min(width, core.right + self._halo),
                )
                rows, columns = self._half(part.bottom - part.top), self._half(part.right - part.left)
                squares = squares_of(heights, scales, part, rows, columns, self._rounding)
                (logits,) = self._session.run([LOGITS], {FEATURES: squares[None]})
                write_probabilities(logits[0], self._bytes, part, core, heights, found)
        return found

    def _half(self, size: int) -> int:
        """Rows or columns of the planes of a part, which is filled up to a multiple."""
        return -(-size // self._multiple) * self._multiple // 2


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
