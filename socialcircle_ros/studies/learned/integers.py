# SPDX-License-Identifier: Apache-2.0
"""The trained network with 8-bit weights and planes: what the product uses, in a fraction of the time of float32.

Needs ONNX and ONNX Runtime, and is imported only on demand. The runtime's own tool merges the norms with the
convolutions and rounds them after calibration [1]. A mean of 2×2 points becomes a convolution, which the runtime
computes in a fifth of the time, and the nearest neighbours of twice the resolution become copies. Input and output
are bytes, and the numbers of a square lie side by side, as the runtime computes. Weights have 7 bits, since sums
of products of 8 bits overflow on processors without VNNI.

1. B. Jacob et al.: Quantization and training of neural networks for efficient integer-arithmetic-only inference.
   CVPR 2018. DOI 10.1109/CVPR.2018.00286
"""

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import socialcircle_ros.onnx_runtime  # noqa: F401 - before ONNX Runtime's tool, since it turns telemetry off

# isort: split
import numpy as np
import numpy.typing as npt
import onnx
from onnx import TensorProto, helper, numpy_helper
from onnxruntime.quantization import (
    CalibrationDataReader,
    CalibrationMethod,
    QuantFormat,
    QuantType,
    quant_pre_process,
    quantize_static,
)

from socialcircle_ros.circle.network.inference import FEATURES, LOGITS, VERSION
from socialcircle_ros.storage import write_file

from .training import Corpus

if TYPE_CHECKING:
    from collections.abc import Iterator

_LAST = [0, 2, 3, 1]
"""Axes of planes so that the channels are the last one."""
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
        return None if planes is None else {FEATURES: planes}


def write_integers(trained: Path, corpus: Corpus, path: Path) -> None:
    """Write a network with 8-bit weights and planes; the same network and corpus give the same bytes.

    Args:
        trained: ONNX file that `export.write_onnx` wrote.
        corpus: the ranges of planes are measured on some of its crops.
        path: ONNX file to write; it has the metadata of the other.
    """
    card = {entry.key: entry.value for entry in onnx.load(trained).metadata_props}
    model = rounded(trained, corpus)
    card |= with_bytes(model)
    helper.set_model_props(model, card)
    write_file(path, model.SerializeToString(deterministic=True))


def rounded(trained: Path, corpus: Corpus) -> onnx.ModelProto:
    """The network with 8-bit weights and planes, which still takes and gives floats; arguments as above."""
    with tempfile.TemporaryDirectory() as folder:
        merged, out = Path(folder) / 'merged.onnx', Path(folder) / 'rounded.onnx'
        quant_pre_process(trained, merged, skip_symbolic_shape=True)
        model = onnx.load(merged)
        _convolve_means(model.graph)
        onnx.save(model, merged)
        quantize_static(
            merged, out, _Crops(corpus), quant_format=QuantFormat.QDQ, per_channel=True, reduce_range=True,
            activation_type=QuantType.QUInt8, weight_type=QuantType.QInt8,
            calibrate_method=CalibrationMethod.Percentile, extra_options={'CalibPercentile': _PERCENTILE},
        )  # fmt: skip
        model = onnx.load(out)
    _keep_used_operators(model)
    return model


def with_bytes(model: onnx.ModelProto) -> dict[str, str]:
    """Let a rounded network take and give bytes, and copy them where it doubles the resolution; in place.

    Returns:
        The entries of the card that say what the bytes mean.
    """
    graph = model.graph
    stored = {tensor.name: numpy_helper.to_array(tensor) for tensor in graph.initializer}
    graph.initializer.append(numpy_helper.from_array(np.array(_LAST, np.int64), 'channels last'))
    for place, node in enumerate(graph.node):
        if node.op_type == 'Resize':
            _copy_points(graph, place, stored)
    card = {'features': VERSION}
    for name, end in ((FEATURES, graph.input[0]), (LOGITS, graph.output[0])):
        card[f'{name}_step'] = repr(float(stored[f'{name}_scale']))
        card[f'{name}_zero'] = str(int(stored[f'{name}_zero_point']))
        batch, channels, rows, columns = (each.dim_param or each.dim_value for each in _dimensions(end))
        end.CopyFrom(helper.make_tensor_value_info(name, TensorProto.UINT8, [batch, rows, columns, channels]))
    for place, node in enumerate(graph.node):
        if node.op_type == 'QuantizeLinear' and node.input[0] == FEATURES:
            graph.node[place].CopyFrom(_channels_first(FEATURES, node.output[0]))
        elif node.op_type == 'DequantizeLinear' and node.output[0] == LOGITS:
            graph.node[place].CopyFrom(_channels_last(node.input[0], LOGITS))
    used = {name for node in graph.node for name in node.input}
    for unused in [tensor for tensor in graph.initializer if tensor.name not in used]:
        graph.initializer.remove(unused)
    return card


def _copy_points(graph: onnx.GraphProto, place: int, stored: Mapping[str, npt.NDArray[np.generic]]) -> None:
    """Replace a Resize, and the numbers around it, by copies of bytes: ONNX Runtime resizes in one thread."""
    resize = graph.node[place]
    name = resize.name
    makers = {node.output[0]: node for node in graph.node}
    users = {node.input[0]: node for node in graph.node if node.input}
    coarse, fine = makers[resize.input[0]], users[resize.output[0]]  # numbers of bytes, bytes of numbers
    join = makers[makers[coarse.input[0]].input[0]]
    channels = stored[makers[join.input[1]].input[0]].shape[0]
    graph.initializer.append(numpy_helper.from_array(np.array([0, 0, -1, channels], np.int64), f'{name}.wide'))
    added = users[users[fine.output[0]].output[0]]
    beside = makers[added.input[1]].input[0]  # bytes of the resolution that is wanted
    copies = [
        _channels_last(coarse.input[0], f'{name}.last'),
        helper.make_node('Concat', [f'{name}.last'] * 2, [f'{name}.pairs'], axis=3),
        helper.make_node('Reshape', [f'{name}.pairs', f'{name}.wide'], [f'{name}.columns']),
        helper.make_node('Concat', [f'{name}.columns'] * 2, [f'{name}.lines'], axis=2),
        helper.make_node('Shape', [beside], [f'{name}.shape']),
        helper.make_node('Gather', [f'{name}.shape', 'channels last'], [f'{name}.size'], axis=0),
        helper.make_node('Reshape', [f'{name}.lines', f'{name}.size'], [f'{name}.twice']),
        _channels_first(f'{name}.twice', fine.output[0]),
    ]
    nodes = [node for node in graph.node if node not in (coarse, fine)]
    at = nodes.index(resize)
    nodes[at : at + 1] = copies
    del graph.node[:]
    graph.node.extend(nodes)


def _channels_last(source: str, result: str) -> onnx.NodeProto:
    """ONNX Runtime computes with bytes in this order, and drops such nodes in pairs."""
    return helper.make_node('Transpose', [source], [result], perm=_LAST)


def _channels_first(source: str, result: str) -> onnx.NodeProto:
    return helper.make_node('Transpose', [source], [result], perm=[0, 3, 1, 2])


def _dimensions(end: onnx.ValueInfoProto) -> Sequence[onnx.TensorShapeProto.Dimension]:
    dimensions: Sequence[onnx.TensorShapeProto.Dimension] = end.type.tensor_type.shape.dim
    return dimensions


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
