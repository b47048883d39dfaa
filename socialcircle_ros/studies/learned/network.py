# SPDX-License-Identifier: Apache-2.0
"""The network: a small U-Net at half resolution that gives each point a logit of being an outlier.

Needs PyTorch, and is imported only where the network is trained.
"""

import itertools

import torch
from torch import Tensor, nn

from socialcircle_ros.circle.network.features import INPUTS

WIDTHS = (32, 32, 64, 96, 96)
"""Channels at 1/2, 1/4, … of the resolution."""
DOWNWARD = (1, 2, 2, 2, 2)
"""Convolutions of each level before the next coarser level."""
UPWARD = (2, 2, 2, 2)
"""Convolutions of each level after the next coarser level."""
MULTIPLE = 2 ** len(WIDTHS)
"""Height and width of the input, in points, are multiples of this."""
HALO = 192
"""A logit depends on no point that is further away than this, in points."""


class Convolution(nn.Module):
    """A convolution 3×3, normalised over the batch, and rectified."""

    def __init__(self, inputs: int, outputs: int) -> None:
        """Start from random weights."""
        super().__init__()
        self.weights = nn.Conv2d(inputs, outputs, 3, padding=1, bias=False)
        self.norm = nn.BatchNorm2d(outputs)

    def forward(self, planes: Tensor) -> Tensor:
        """Convolve planes (B, inputs, H, W)."""
        return torch.relu(self.norm(self.weights(planes)))


class Network(nn.Module):
    """A U-Net whose upward path is added to the downward one.

    References: Ronneberger et al. (2015), DOI 10.1007/978-3-319-24574-4_28; Chaurasia and Culurciello (2017), DOI
    10.1109/VCIP.2017.8305148.
    """

    def __init__(self) -> None:
        """Start from random weights."""
        super().__init__()
        inputs = (INPUTS, *WIDTHS)
        self.down = nn.ModuleList(
            nn.ModuleList(Convolution(inputs[level] if not place else width, width) for place in range(count))
            for level, (width, count) in enumerate(zip(WIDTHS, DOWNWARD, strict=True))
        )
        self.joins = nn.ModuleList(nn.Conv2d(coarse, fine, 1) for fine, coarse in itertools.pairwise(WIDTHS))
        self.up = nn.ModuleList(
            nn.ModuleList(Convolution(width, width) for _ in range(count))
            for width, count in zip(WIDTHS[:-1], UPWARD, strict=True)
        )
        self.last = nn.Conv2d(WIDTHS[0], 4, 1)

    def forward(self, planes: Tensor) -> Tensor:
        """Logits of a batch.

        Args:
            planes: (B, 28, H/2, W/2).

        Returns:
            (B, 4, H/2, W/2): the logits of each 2×2 square, in row order.
        """
        kept = []
        for level, convolutions in enumerate(self.down):
            if level:
                planes = nn.functional.avg_pool2d(planes, 2)
            for convolution in convolutions:
                planes = convolution(planes)
            kept.append(planes)
        for level in reversed(range(len(self.up))):
            raised = nn.functional.interpolate(self.joins[level](planes), scale_factor=2.0, mode='nearest')
            planes = raised + kept[level]
            for convolution in self.up[level]:
                planes = convolution(planes)
        logits: Tensor = self.last(planes)
        return logits
