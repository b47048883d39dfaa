# SPDX-License-Identifier: Apache-2.0
"""The network, run by ONNX Runtime: the probability of each point, tile by tile."""

import math
import os
import threading
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from socialcircle_ros.circle.adaptive import Probabilities
from socialcircle_ros.circle.adaptive.heights import RelativeHeights
from socialcircle_ros.circle.adaptive.likelihood import ONE
from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.kernels import bands
from socialcircle_ros.kernels.compiled import kernel
from socialcircle_ros.kernels.machine import usable_cores
from socialcircle_ros.settings import CPU_PROVIDER, require_runtime

from .features import Part, Planes, planes_of, scales_of

if TYPE_CHECKING:
    from collections.abc import Mapping

WEIGHTS = Path(__file__).with_name('network.onnx')
"""The weights of the package."""
WHOLE = 1_400_000
"""Largest cloud, in points, that is one tile."""
TILE = 640
"""Side of the tiles of a larger cloud, in points; even, as `features.planes_of` needs it. With its surroundings a
tile takes about 100 MB."""

_FEATURES, _LOGITS = 'features', 'logits'
_VERSION = '2'


class NetworkJudge:
    """A network that is ready to judge; it may be used by several threads at a time.

    Attributes:
        card: the metadata of the file: what the network was trained on.
    """

    def __init__(self, path: Path, threads: int, provider: str = CPU_PROVIDER) -> None:
        """Read the file.

        Args:
            path: of an ONNX file that the training wrote.
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
        if self.card.get('features') != _VERSION:
            raise SocialCircleError(f'{path} is no network that the training of this version wrote.')
        self._halo, self._multiple = int(self.card['halo']), int(self.card['multiple'])

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
                planes = planes_of(heights, scales, part, rows, columns)
                (logits,) = self._session.run([_LOGITS], {_FEATURES: planes[None]})
                write_probabilities(logits[0], part.top, part.left, core, heights, found)
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


@kernel
def write_probabilities(
    logits: Planes, top: int, left: int, core: Part, heights: RelativeHeights, found: Probabilities
) -> None:
    """Write the probabilities of a tile, 0 where not measured; `top` and `left` are those of the logits."""
    for row in range(core.top, core.bottom):
        down = row - top
        for column in range(core.left, core.right):
            right = column - left
            logit = logits[2 * (down & 1) + (right & 1), down // 2, right // 2]
            probability = np.float32(1) / (np.float32(1) + np.exp(-logit))
            known = math.isfinite(heights[row, column])
            found[row, column] = np.uint8(ONE * probability + np.float32(0.5)) if known else np.uint8(0)
