# SPDX-License-Identifier: Apache-2.0
"""The trained network as an ONNX file, and back: what `integers` rounds, and what a later training starts from.

Needs PyTorch and ONNX, and is imported only on demand. The file depends on the weights and the card alone. Weights
are stored as float16 and used as float32. Norms of batches stay in the file, so that a training can go on from it.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import onnx
import torch
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from socialcircle_ros.circle.network.features import INPUTS
from socialcircle_ros.circle.network.inference import FEATURES, LOGITS
from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.storage import write_file

from .network import HALO, MULTIPLE, Network

_OPSET, _IR = 17, 8
_EPSILON = 1e-5


class _Graph:
    """Nodes and weights of the graph, as they are added."""

    def __init__(self, weights: Mapping[str, NDArray[np.float32]]) -> None:
        self.weights = weights
        self.nodes: list[onnx.NodeProto] = []
        self.stored: list[onnx.TensorProto] = []

    def weight(self, name: str) -> str:
        """A weight of a convolution by its name: stored as float16, cast to float32."""
        self.stored.append(numpy_helper.from_array(self.weights[name].astype(np.float16), name))
        return self.node('Cast', [name], f'{name}.float', to=TensorProto.FLOAT)

    def number(self, name: str) -> str:
        """A number of a norm by its name, as it is: a variance may exceed the range of float16."""
        self.stored.append(numpy_helper.from_array(self.weights[name], name))
        return name

    def node(self, kind: str, inputs: list[str], output: str, **attributes: object) -> str:
        self.nodes.append(helper.make_node(kind, inputs, [output], output, **attributes))
        return output

    def convolution(self, name: str, planes: str) -> str:
        """Convolution, norm and rectification, as `network.Convolution`."""
        convolved = self.node('Conv', [planes, self.weight(f'{name}.weights.weight')], f'{name}.sum', pads=[1] * 4)
        norm = [self.number(f'{name}.norm.{part}') for part in ('weight', 'bias', 'running_mean', 'running_var')]
        normed = self.node('BatchNormalization', [convolved, *norm], f'{name}.normed', epsilon=_EPSILON)
        return self.node('Relu', [normed], f'{name}.out')


def to_onnx(network: Network, card: Mapping[str, str]) -> onnx.ModelProto:
    """The network as an ONNX model.

    Args:
        network: its weights.
        card: further entries of the metadata.
    """
    weights = {name: value.detach().cpu().float().numpy() for name, value in network.state_dict().items()}
    graph = _Graph(weights)
    _add_layers(graph, network)
    planes = helper.make_tensor_value_info(FEATURES, TensorProto.FLOAT, ['batch', INPUTS, 'rows', 'columns'])
    logits = helper.make_tensor_value_info(LOGITS, TensorProto.FLOAT, ['batch', 4, 'rows', 'columns'])
    model = helper.make_model(
        helper.make_graph(graph.nodes, 'touch', [planes], [logits], graph.stored),
        opset_imports=[helper.make_opsetid('', _OPSET)], ir_version=_IR, producer_name='socialcircle_ros',
    )  # fmt: skip
    helper.set_model_props(model, {'multiple': str(MULTIPLE), 'halo': str(HALO), **card})
    onnx.checker.check_model(model, full_check=True)
    return model


def _add_layers(graph: _Graph, network: Network) -> None:
    """The layers in the order of `Network.forward`."""
    planes, kept = FEATURES, []
    graph.stored.append(numpy_helper.from_array(np.array([1, 1, 2, 2], np.float32), 'twice'))
    for level, convolutions in enumerate(network.down):
        if level:
            planes = graph.node('AveragePool', [planes], f'pool{level}', kernel_shape=[2, 2], strides=[2, 2])
        for place in range(len(convolutions)):
            planes = graph.convolution(f'down.{level}.{place}', planes)
        kept.append(planes)
    for level in reversed(range(len(network.up))):
        join = [graph.weight(f'joins.{level}.{part}') for part in ('weight', 'bias')]
        joined = graph.node('Conv', [planes, *join], f'joins.{level}.out')
        raised = graph.node(
            'Resize', [joined, '', 'twice'], f'raised.{level}', mode='nearest',
            coordinate_transformation_mode='asymmetric', nearest_mode='floor',
        )  # fmt: skip
        planes = graph.node('Add', [raised, kept[level]], f'added.{level}')
        for place in range(len(network.up[level])):
            planes = graph.convolution(f'up.{level}.{place}', planes)
    graph.node('Conv', [planes, graph.weight('last.weight'), graph.weight('last.bias')], LOGITS)


def write_onnx(network: Network, card: Mapping[str, str], path: Path) -> None:
    """Write the network as an ONNX file; the same weights and card give the same bytes."""
    write_file(path, to_onnx(network, card).SerializeToString(deterministic=True))


def network_from(path: Path) -> Network:
    """The network of an ONNX file, to train it further.

    Raises:
        SocialCircleError: the file holds a network of another shape.
    """
    stored = {tensor.name: numpy_helper.to_array(tensor) for tensor in onnx.load(path).graph.initializer}
    network = Network()
    state = network.state_dict()
    for name, value in state.items():
        if name in stored:
            if stored[name].shape != tuple(value.shape):
                raise SocialCircleError(f'{path} holds a network of another shape; start from random weights.')
            state[name] = torch.from_numpy(stored[name].astype(np.float32)).to(value.dtype)
    network.load_state_dict(state)
    return network
