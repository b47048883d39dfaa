# SPDX-License-Identifier: Apache-2.0
"""Touch judged by a network: its features of a height map, and the network itself, run by ONNX Runtime.

- `scales`: level, tilt and spread of a height map.
- `features`: what the network sees of a height map.
- `inference`: the probability of each point to be an outlier, tile by tile; the weights are in `network.onnx`.

What becomes of the probabilities is in `circle.adaptive.likelihood`. The training is in `studies.learned`.
"""

from .inference import NetworkJudge, packaged_network

__all__ = ['NetworkJudge', 'packaged_network']
