# SPDX-License-Identifier: Apache-2.0
"""The trained network with 8-bit weights and planes: what the product uses, in half the time of float32.

Needs ONNX and ONNX Runtime, and is imported only on demand. The runtime's own tool merges the norms with the
convolutions and rounds them after calibration [1]. The first and the last convolution stay in float32: otherwise a
last bit of the heights, which an offset can change, would become a step of 8 bits in the input. Weights have 7
bits, since sums of products of 8 bits overflow on processors without VNNI.

1. B. Jacob et al.: Quantization and training of neural networks for efficient integer-arithmetic-only inference.
   CVPR 2018. DOI 10.1109/CVPR.2018.00286
"""

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import onnx
from onnx import helper
from onnxruntime.quantization import (
    CalibrationDataReader,
    CalibrationMethod,
    QuantFormat,
    QuantType,
    quant_pre_process,
    quantize_static,
)

from socialcircle_ros.storage import write_file

from .export import INPUT
from .training import Corpus

if TYPE_CHECKING:
    from collections.abc import Iterator

_BATCHES, _BATCH, _SEED = 12, 4, 99
"""Crops that the ranges of the planes are measured on."""
_PERCENTILE = 99.99
"""Range of a plane, in percent of its values; what is beyond it is clipped."""


class _Crops(CalibrationDataReader):  # type: ignore[misc] # the base has no types
    """Crops of a corpus, as the calibration wants them."""

    def __init__(self, corpus: Corpus) -> None:
        self._batches: Iterator[npt.NDArray[np.float32]] = (
            corpus.batch(_BATCH, np.random.default_rng([_SEED, number])).planes.numpy()
            for number in range(_BATCHES)
        )

    def get_next(self) -> dict[str, npt.NDArray[np.float32]] | None:
        """Return the next crops, or None after the last."""
        planes = next(self._batches, None)
        return None if planes is None else {INPUT: planes}


def write_integers(trained: Path, corpus: Corpus, path: Path) -> None:
    """Write a network with 8-bit weights and planes; the same network and corpus give the same bytes.

    Args:
        trained: ONNX file that `export.write_onnx` wrote.
        corpus: the ranges of planes are measured on some of its crops.
        path: ONNX file to write; it has the metadata of the other.
    """
    card = {entry.key: entry.value for entry in onnx.load(trained).metadata_props}
    with tempfile.TemporaryDirectory() as folder:
        merged, rounded = Path(folder) / 'merged.onnx', Path(folder) / 'rounded.onnx'
        quant_pre_process(trained, merged, skip_symbolic_shape=True)
        convolutions = [node.name for node in onnx.load(merged).graph.node if node.op_type == 'Conv']
        quantize_static(
            merged, rounded, _Crops(corpus), quant_format=QuantFormat.QDQ, per_channel=True, reduce_range=True,
            activation_type=QuantType.QUInt8, weight_type=QuantType.QInt8,
            nodes_to_exclude=[convolutions[0], convolutions[-1]],
            calibrate_method=CalibrationMethod.Percentile, extra_options={'CalibPercentile': _PERCENTILE},
        )  # fmt: skip
        model = onnx.load(rounded)
    helper.set_model_props(model, card)
    write_file(path, model.SerializeToString(deterministic=True))
