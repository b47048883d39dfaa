# SPDX-License-Identifier: Apache-2.0
"""The teacher: a larger network at full resolution. The network is trained towards its probabilities [1].

It is too slow for the product. Needs PyTorch, and is imported only where the network is trained.

1. G. Hinton, O. Vinyals, J. Dean: Distilling the knowledge in a neural network. 2015. arXiv:1503.02531
"""

import io
import json
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from socialcircle_ros.circle.network.features import CHANNELS
from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.storage import write_file

from .corpus import HEIGHT_CHANNELS, files_of, opinions_beside

Opinions = NDArray[np.uint8]
"""(100, 320, 320) uint8, probabilities of the patches of a file, 255 for 1."""

WEIGHTS = Path(__file__).with_name('teacher.pt')
"""Not in an installed package, for its size."""
_WIDTHS = (24, 48, 96, 160)
"""Channels at the full resolution, 1/2, 1/4 and 1/8."""


class _Block(nn.Module):
    """Two convolutions 3×3, each normalised over the batch and rectified."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.a = nn.Conv2d(inputs, outputs, 3, padding=1, bias=False)
        self.n = nn.BatchNorm2d(outputs)
        self.b = nn.Conv2d(outputs, outputs, 3, padding=1, bias=False)
        self.k = nn.BatchNorm2d(outputs)

    def forward(self, planes: Tensor) -> Tensor:
        """Convolve planes (B, inputs, H, W)."""
        return torch.relu(self.k(self.b(torch.relu(self.n(self.a(planes))))))


class Teacher(nn.Module):
    """A U-Net at full resolution, with the weights of `teacher.pt`, which has the names of its layers."""

    def __init__(self) -> None:
        """Read the weights.

        Raises:
            SocialCircleError: they are not there, as in an installed package.
        """
        super().__init__()
        self.d = nn.ModuleList(
            _Block(_WIDTHS[level - 1] if level else CHANNELS + 1, width) for level, width in enumerate(_WIDTHS)
        )
        self.u = nn.ModuleList(
            _Block(_WIDTHS[level + 1] + width, width) for level, width in enumerate(_WIDTHS[:-1])
        )
        self.o = nn.Conv2d(_WIDTHS[0], 1, 1)
        require_weights()
        self.load_state_dict(torch.load(WEIGHTS, map_location='cpu', weights_only=True))
        self.eval()

    def forward(self, planes: Tensor) -> Tensor:
        """Logits of a batch.

        Args:
            planes: (B, 7, H, W) float32, H and W multiples of 8: `inputs_of`.

        Returns:
            (B, 1, H, W) float32.
        """
        kept = []
        for level, block in enumerate(self.d):
            if level:
                planes = nn.functional.avg_pool2d(planes, 2)
            planes = block(planes)
            kept.append(planes)
        for level in reversed(range(len(self.u))):
            raised = nn.functional.interpolate(planes, scale_factor=2.0, mode='nearest')
            planes = self.u[level](torch.cat([raised, kept[level]], 1))
        logits: Tensor = self.o(planes)
        return logits


def require_weights() -> None:
    """Raise an error if the weights are not there.

    Raises:
        SocialCircleError: they are not, as in an installed package.
    """
    if not WEIGHTS.exists():
        raise SocialCircleError(f'{WEIGHTS} is not there: train in a checkout of the repository.')


def inputs_of(channels: NDArray[np.float32], grain: float) -> NDArray[np.float32]:
    """The teacher's planes, which have natural logarithms, from those of the network.

    Args:
        channels: (6, H, W) float32, `features.channels_of`.
        grain: of the cloud.

    Returns:
        (7, H, W) float32.
    """
    heights = channels[:HEIGHT_CHANNELS]
    whole = np.floor(np.abs(heights))
    # The network's logarithm is linear between powers of two.
    size = np.exp2(whole) * (1 + np.abs(heights) - whole)
    last = np.full_like(channels[:1], grain * np.log(2))
    return np.concatenate([np.sign(heights) * np.log(size), channels[HEIGHT_CHANNELS:], last])


def write_opinions(path: Path, grains: Sequence[float], real: Sequence[bool], teacher: Teacher) -> None:
    """Write the teacher's probabilities of a file of the corpus beside it.

    On simulated surfaces it may only say that an outlier cannot be seen: it knows few of their kinds, and takes
    good points of the others for outliers.

    Args:
        path: file of the corpus.
        grains: of its patches.
        real: whether each of them is of a real surface.
        teacher: gives the probabilities.
    """
    patches = np.load(path, mmap_mode='r')
    opinions: Opinions = np.empty((len(patches), *patches.shape[2:]), np.uint8)
    for place, patch in enumerate(patches):
        planes = torch.from_numpy(inputs_of(patch[:CHANNELS].astype(np.float32), grains[place]))[None]
        with torch.no_grad(), torch.autocast('cpu', dtype=torch.bfloat16):
            logits = teacher(planes.to(memory_format=torch.channels_last))
        opinions[place] = (torch.sigmoid(logits.float())[0, 0] * 255).round().to(torch.uint8).numpy()
        if not real[place]:
            opinions[place][patch[CHANNELS] < 2] = 0
    content = io.BytesIO()
    np.save(content, opinions)
    write_file(opinions_beside(path), content.getvalue())


def ask_teacher(folder: Path, progress: Callable[[str], None]) -> None:
    """Write the teacher's probabilities of each file of a corpus that has none yet.

    Args:
        folder: of the corpus.
        progress: called with each file that was written.

    Raises:
        SocialCircleError: the weights of the teacher are not there.
    """
    new = [path for path in files_of(folder) if not opinions_beside(path).exists()]
    if not new:
        return
    teacher = Teacher().to(memory_format=torch.channels_last)
    for path in new:
        made = json.loads(path.with_suffix('.json').read_text(encoding='utf-8'))
        write_opinions(path, made['grain'], made['real'], teacher)
        progress(str(opinions_beside(path)))
