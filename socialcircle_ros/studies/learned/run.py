# SPDX-License-Identifier: Apache-2.0
"""One training from its corpus to the ONNX files, by one or several processes.

Needs PyTorch, ONNX and ONNX Runtime.
"""

import csv
import io
import json
import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import click
import torch
from torch import distributed, multiprocessing

from socialcircle_ros.storage import write_file

from .drawings import learning_curve
from .export import network_from, write_onnx
from .integers import write_integers
from .training import Corpus, Trainer, Training

TRAINED = 'trained.onnx'
"""File in the folder of the work, with the weights as they were trained: a start for a later training."""


@dataclass(frozen=True)
class Run:
    """Options of a training.

    Attributes:
        corpus: folder of the corpus.
        work: folder of the state, of the trained weights and of the learning curve.
        out: ONNX file with 8-bit weights, for the product.
        steps: number of steps.
        workers: processes; each has its own crops, and one thread where there are several.
        seed: of weights and crops.
        start: `TRAINED` of an earlier training to start from, or None.
        names: lists of names that are written to the file.
    """

    corpus: Path
    work: Path
    out: Path
    steps: int
    workers: int
    seed: int
    start: Path | None
    names: Mapping[str, Sequence[str]]


def train(run: Run) -> None:
    """Train, go on with a training that was stopped, and write both files."""
    if run.workers > 1:
        multiprocessing.spawn(_work, (run,), run.workers)
    else:
        _work(0, run)


def _work(worker: int, run: Run) -> None:
    if run.workers > 1:
        torch.set_num_threads(1)
        os.environ.setdefault('GLOO_SOCKET_IFNAME', 'lo')
        store = run.work / f'meeting-{os.getppid()}'
        distributed.init_process_group(
            'gloo', init_method=f'file://{store.resolve()}', rank=worker, world_size=run.workers
        )
    trainer = Trainer(
        Corpus(run.corpus), Training(run.steps, seed=run.seed), network_from(run.start) if run.start else None
    )
    state = run.work / 'state.pt'
    if state.exists():
        trainer.resume(state)
    began, first = time.monotonic(), trainer.step

    def report(step: int, loss: float) -> None:
        if worker == 0:
            pace = (time.monotonic() - began) / (step - first)
            left = pace * (run.steps - step) / 60
            click.echo(f'step {step} of {run.steps}: loss {loss:.4f}; {left:.0f} minutes left', err=True)

    trainer.run(state, report)
    if worker == 0:
        card = {name: json.dumps(list(names)) for name, names in run.names.items()}
        write_onnx(trainer.averaged(), card, run.work / TRAINED)
        write_integers(run.work / TRAINED, trainer.corpus, run.out)
        write_file(run.work / 'curve.csv', _curve(trainer.curve))
        write_file(run.work / 'curve.png', learning_curve(*zip(*trainer.curve, strict=True)))
    if run.workers > 1:
        distributed.destroy_process_group()


def _curve(points: Sequence[tuple[int, float]]) -> str:
    out = io.StringIO()
    writer = csv.writer(out, lineterminator='\n')
    writer.writerow(['step', 'loss'])
    writer.writerows([step, f'{loss:.5f}'] for step, loss in points)
    return out.getvalue()
