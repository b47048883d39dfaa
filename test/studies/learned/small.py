# SPDX-License-Identifier: Apache-2.0
"""Surfaces and crops so small that a training takes a second."""

import numpy as np


def few_small_crops(monkeypatch, corpus, training):
    """Make files of 2 patches, crops of 32×32 points, and a report at each step; both modules need PyTorch."""
    for module, name, value in (
        (corpus, 'SHARD', 2), (training, 'SHARD', 2), (training, '_SIDE', 32), (training, '_EVERY', 1)
    ):  # fmt: skip
        monkeypatch.setattr(module, name, value)


def write_surfaces(folder, names):
    """Write a data folder of white noise; a name may begin with `training/`."""
    (folder / 'training').mkdir(parents=True)
    for seed, name in enumerate(names):
        heights = np.random.default_rng(seed).normal(size=(90, 110)).astype(np.float32)
        np.savez(folder / f'{name}.npz', z=heights, dx=1.0, dy=2.0)
    return folder
