# SPDX-License-Identifier: Apache-2.0
"""The trained network with 8-bit weights and planes: what the product uses, in a third of the time of float32.

Needs ONNX and ONNX Runtime, and is imported only on demand. The runtime's own tool merges the norms with the
convolutions and rounds them after calibration [1]. A mean of 2×2 points becomes a convolution, which the runtime
computes in a fifth of the time. Weights have 7 bits, since sums of products of 8 bits overflow on processors
without VNNI.

1. B. Jacob et al.: Quantization and training of neural networks for efficient integer-arithmetic-only inference.
   CVPR 2018. DOI 10.1109/CVPR.2018.00286
"""

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import socialcircle_ros.onnx_runtime  # noqa: F401 - before ONNX Runtime's tool, since it turns telemetry off

# isort: split
import numpy as np
import numpy.typing as npt
import onnx
from onnx import helper, numpy_helper
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

_BATCHES, _BATCH, _SEED = 40, 4, 99
"""Crops that the ranges of the planes are measured on."""
_PERCENTILE = 99.999
"""Range of a plane, in percent of its values; what is beyond it is clipped. With 99.99 and 48 crops the range of a
plane that answers to single points was left to chance, and single points were lost."""


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
        model = onnx.load(merged)
        _convolve_means(model.graph)
        onnx.save(model, merged)
        quantize_static(
            merged, rounded, _Crops(corpus), quant_format=QuantFormat.QDQ, per_channel=True, reduce_range=True,
            activation_type=QuantType.QUInt8, weight_type=QuantType.QInt8,
            calibrate_method=CalibrationMethod.Percentile, extra_options={'CalibPercentile': _PERCENTILE},
        )  # fmt: skip
        model = onnx.load(rounded)
    _keep_used_operators(model)
    helper.set_model_props(model, card)
    write_file(path, model.SerializeToString(deterministic=True))


def _keep_used_operators(model: onnx.ModelProto) -> None:
    """Declare only the sets of operators that the nodes use: an older runtime refuses a set that it lacks."""
    used = {node.domain for node in model.graph.node}
    declared = [each for each in model.opset_import if each.domain in used]
    del model.opset_import[:]
    model.opset_import.extend(declared)


def _convolve_means(graph: onnx.GraphProto) -> None:
    """Replace each mean of 2×2 points by a convolution, plane by plane, with weights of a quarter."""
    filters = {weight.name: weight.dims[0] for weight in graph.initializer if len(weight.dims) == 4}
    planes = {node.output[0]: filters[node.input[1]] for node in graph.node if node.op_type == 'Conv'}
    source = {node.output[0]: node.input[0] for node in graph.node if node.op_type == 'Relu'}
    for place, node in enumerate(graph.node):
        if node.op_type == 'AveragePool':
            number = planes[source[node.input[0]]]
            weights = numpy_helper.from_array(np.full((number, 1, 2, 2), 0.25, np.float32), f'{node.name}.weights')
            graph.initializer.append(weights)
            convolution = helper.make_node(
                'Conv', [node.input[0], weights.name], list(node.output), node.name, kernel_shape=[2, 2],
                strides=[2, 2], group=number,
            )  # fmt: skip
            graph.node.remove(node)
            graph.node.insert(place, convolution)
