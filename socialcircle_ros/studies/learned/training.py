# SPDX-License-Identifier: Apache-2.0
"""The training of the network, on a CPU or a GPU. Needs PyTorch, and is imported only on demand."""

import io
import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, distributed, nn

from socialcircle_ros.circle.network.features import CHANNELS
from socialcircle_ros.storage import write_file

from .corpus import HEIGHT_CHANNELS, PLANES, SHARD, Patch, files_of, opinions_beside
from .network import Network

_SIDE = 192
_LEAST_COUNTED = 0.1
_EVERY = 100
_NORM_BATCHES, _NORM_SEED = 120, 999_983
"""Batches that the norms of the averaged network are measured on."""


@dataclass(frozen=True)
class Training:
    """How to train.

    Attributes:
        steps: number of batches, those of an earlier part of the same training included.
        batch: crops of 192×192 points in a batch.
        rate: learning rate; it is constant but for the first 200 steps and for the last `cooling` of all steps.
        cooling: share of the steps over which the rate falls to 0.
        seed: decides the initial weights and the crops of each step.
        dice: weight of the dice loss beside the cross entropy.
        trust: weight of the teacher's probability in what is learned; the rest is the truth.
    """

    steps: int = 20_000
    batch: int = 8
    rate: float = 3e-3
    cooling: float = 0.4
    seed: int = 1
    dice: float = 0.2
    trust: float = 0.5


class Batch(NamedTuple):
    """Crops, and what is known of their points.

    Attributes:
        planes: (B, 28, 96, 96) float32.
        labels: (B, 4, 96, 96) uint8, as in `corpus`.
        opinions: the same shape, uint8: 255 times the teacher's probabilities, see `teacher.write_opinions`.
    """

    planes: Tensor
    labels: Tensor
    opinions: Tensor


class Corpus:
    """The files of a corpus, from which crops are drawn at random."""

    def __init__(self, *folders: Path, taught: bool = True) -> None:
        """Open the files that are there.

        Args:
            folders: of the files.
            taught: whether the teacher's probabilities are used; without, they are 0, for `Training.trust` of 0.

        Raises:
            FileNotFoundError: there are none.
        """
        self.folders, self.taught = folders, taught
        self.files: list[NDArray[np.float16]] = []
        self.opinions: list[NDArray[np.uint8]] = []
        self.grains: list[list[float]] = []
        self.shapes: list[list[tuple[int, int]]] = []
        self._known: set[Path] = set()
        self.look_for_files()
        if not self.files:
            lacking = ' that has the probabilities of the teacher' if taught else ''
            raise FileNotFoundError(f'{", ".join(map(str, folders))}: no file of a corpus{lacking}.')

    def look_for_files(self) -> None:
        """Open the files that were added since."""
        for path in (path for folder in self.folders for path in files_of(folder)):
            opinions = opinions_beside(path)
            if path not in self._known and (opinions.exists() or not self.taught):
                self._known.add(path)
                patches = np.load(path, mmap_mode='r')
                self.files.append(patches)
                unknown = np.broadcast_to(np.uint8(0), (len(patches), *patches.shape[2:]))
                self.opinions.append(np.load(opinions, mmap_mode='r') if self.taught else unknown)
                made = json.loads(path.with_suffix('.json').read_text(encoding='utf-8'))
                self.grains.append(made['grain'])
                self.shapes.append(made['shape'])

    def batch(self, size: int, random: np.random.Generator) -> Batch:
        """Draw crops, flipped and turned upside down at random."""
        planes = np.empty((size, CHANNELS, _SIDE, _SIDE), np.float32)
        labels = np.empty((size, 1, _SIDE, _SIDE), np.uint8)
        opinions = np.empty((size, 1, _SIDE, _SIDE), np.uint8)
        grain = np.empty((size, 4, _SIDE // 2, _SIDE // 2), np.float32)
        for place in range(size):
            crop, opinion, grain[place] = self._crop(random)
            rows, columns = (slice(None, None, -1) if random.random() < 0.5 else slice(None) for _ in range(2))
            crop, opinions[place, 0] = crop[:, rows, columns], opinion[rows, columns]
            planes[place], labels[place, 0] = crop[:CHANNELS], crop[CHANNELS]
            if random.random() < 0.5:
                planes[place, :HEIGHT_CHANNELS] *= -1
        squares = nn.functional.pixel_unshuffle(torch.from_numpy(planes), 2)
        return Batch(
            torch.cat([squares, torch.from_numpy(grain)], 1),
            nn.functional.pixel_unshuffle(torch.from_numpy(labels), 2),
            nn.functional.pixel_unshuffle(torch.from_numpy(opinions), 2),
        )

    def _crop(self, random: np.random.Generator) -> tuple[Patch, NDArray[np.uint8], float]:
        """A crop of a patch, or a whole small patch, in which at least a tenth of the points count.

        Returns:
            The crop, the teacher's opinions, and the grain of the cloud.
        """
        while True:
            number, place = int(random.integers(len(self.files))), int(random.integers(SHARD))
            height, width = self.shapes[number][place]
            # Even corners: a flipped crop keeps the 2×2 squares.
            rows, columns = (
                2 * int(random.integers(0, max(0, size - _SIDE) // 2 + 1)) for size in (height, width)
            )
            area = (place, ..., slice(rows, rows + _SIDE), slice(columns, columns + _SIDE))
            crop = self.files[number][area][:PLANES]
            if np.count_nonzero(crop[CHANNELS]) >= _LEAST_COUNTED * min(height, _SIDE) * min(width, _SIDE):
                return np.asarray(crop), self.opinions[number][area], self.grains[number][place]


def loss_of(logits: Tensor, batch: Batch, training: Training) -> Tensor:
    """Cross entropy and dice loss over the points that count.

    What is learned lies between the truth and the teacher's probability: the truth holds outliers that nobody can
    see in the texture, and the teacher has seen fewer kinds of surfaces.

    Args:
        logits: (B, 4, h, w).
        batch: labels of the same shape: 0 does not count, 1 good, 2 outlier; and the teacher's probabilities.
        training: `dice` and `trust`.
    """
    counted = (batch.labels > 0).float()
    outlier = counted * torch.lerp((batch.labels > 1).float(), batch.opinions / 255, training.trust)
    entropy = nn.functional.binary_cross_entropy_with_logits(logits, outlier, counted, reduction='sum')
    probability = torch.sigmoid(logits) * counted
    overlap = (2 * (probability * outlier).sum() + 1) / (probability.sum() + outlier.sum() + 1)
    return entropy / counted.sum() + training.dice * (1 - overlap)


class Trainer:
    """A training that can be stopped, saved and resumed at any step with the same result."""

    def __init__(self, corpus: Corpus, training: Training, start: Network | None = None) -> None:
        """Start from random weights, or from those of a network."""
        torch.manual_seed(training.seed)
        self.device = 'cuda' if torch.cuda.is_available() else 'cpu'
        self.corpus, self.training, self.step = corpus, training, 0
        together = distributed.is_initialized()
        self.worker = distributed.get_rank() if together else 0
        self.workers = distributed.get_world_size() if together else 1
        self.network = (start or Network()).to(self.device, memory_format=torch.channels_last)
        self.mean = {name: value.detach().clone() for name, value in self.network.state_dict().items()}
        """Moving average of the weights, which is what is used."""
        self.curve: list[tuple[int, float]] = []
        """Steps, and the mean loss of the last 100 steps."""
        self.optimizer = torch.optim.AdamW(self.network.parameters(), lr=training.rate, weight_decay=1e-3)

    def run(self, checkpoint: Path, progress: Callable[[int, float], None], every: int = 500) -> None:
        """Train to the last step; save the state now and then.

        Args:
            checkpoint: file of the state.
            progress: called with the step and the mean loss of the last 100 steps.
            every: steps between two saves.
        """
        losses = []
        for loss in self._losses():
            losses.append(loss)
            if self.step % _EVERY == 0:
                self.curve.append((self.step, float(torch.stack(losses).mean())))
                progress(*self.curve[-1])
                losses = []
            if self.step % every == 0 or self.step == self.training.steps:
                if self.worker == 0:
                    self.save(checkpoint)
                self.corpus.look_for_files()

    def _losses(self) -> Iterator[Tensor]:
        while self.step < self.training.steps:
            random = np.random.default_rng([self.training.seed, self.step, self.worker])
            yield self._one_step(self.corpus.batch(self.training.batch, random))

    def _one_step(self, batch: Batch) -> Tensor:
        for group in self.optimizer.param_groups:
            group['lr'] = self._rate()
        self.network.train()
        batch = Batch(*(part.to(self.device, memory_format=torch.channels_last) for part in batch))
        with torch.autocast(self.device, dtype=torch.bfloat16):
            logits = self.network(batch.planes)
        loss = loss_of(logits.float(), batch, self.training)
        self.optimizer.zero_grad()
        loss.backward()
        self._share_gradients()
        nn.utils.clip_grad_norm_(self.network.parameters(), 1.0)
        self.optimizer.step()
        self.step += 1
        self._average()
        return loss.detach()

    def _share_gradients(self) -> None:
        """Replace the gradients by their mean over the processes that train together."""
        if self.workers > 1:
            gradients = [parameter.grad for parameter in self.network.parameters() if parameter.grad is not None]
            together = torch.cat([gradient.reshape(-1) for gradient in gradients])
            distributed.all_reduce(together)
            together /= self.workers
            parts = together.split([each.numel() for each in gradients])
            for gradient, mean in zip(gradients, parts, strict=True):
                gradient.copy_(mean.view_as(gradient))

    def _rate(self) -> float:
        done = self.step / self.training.steps
        cooled = min(1.0, (1 - done) / max(self.training.cooling, 1e-9))
        return self.training.rate * min(1.0, (self.step + 1) / 200) * cooled

    def _average(self) -> None:
        decay = min(0.999, self.step / (self.step + 20))
        with torch.no_grad():
            for name, value in self.network.state_dict().items():
                if value.dtype.is_floating_point:
                    self.mean[name].lerp_(value, 1 - decay)
                else:
                    self.mean[name].copy_(value)

    def averaged(self) -> Network:
        """The network with the moving average of the weights, ready to be used.

        The norms are measured again on crops: their averages over the training do not fit the average of the
        weights, and made a network take 8 % of a good surface for outliers.
        """
        network = Network()
        network.load_state_dict(self.mean)
        network.to(self.device, memory_format=torch.channels_last)
        for module in network.modules():
            if isinstance(module, nn.BatchNorm2d):
                module.reset_running_stats()
                module.momentum = None  # the mean over all batches
        network.train()
        with torch.no_grad(), torch.autocast(self.device, dtype=torch.bfloat16):
            for number in range(_NORM_BATCHES):
                random = np.random.default_rng([self.training.seed, number, _NORM_SEED])
                planes = self.corpus.batch(2 * self.training.batch, random).planes
                network(planes.to(self.device, memory_format=torch.channels_last))
        network.cpu().eval()
        return network

    def save(self, path: Path) -> None:
        """Save the state: weights, their average, the optimizer and the step."""
        state = {
            'network': self.network.state_dict(), 'mean': self.mean, 'optimizer': self.optimizer.state_dict(),
            'step': self.step, 'curve': self.curve,
        }  # fmt: skip
        content = io.BytesIO()
        torch.save(state, content)
        write_file(path, content.getvalue())

    def resume(self, path: Path) -> None:
        """Continue from a saved state."""
        state = torch.load(path, map_location=self.device, weights_only=True)
        self.network.load_state_dict(state['network'])
        self.mean = state['mean']
        self.optimizer.load_state_dict(state['optimizer'])
        self.step, self.curve = state['step'], state['curve']
