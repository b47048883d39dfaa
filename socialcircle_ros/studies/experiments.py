# SPDX-License-Identifier: Apache-2.0
"""All experiments by name, and the page, tables and pictures that they write."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from socialcircle_ros.circle.network import NetworkJudge, packaged_network
from socialcircle_ros.kernels.machine import hardware, usable_cores
from socialcircle_ros.report.page import render
from socialcircle_ros.storage import write_file

from .adaptive.experiment import adaptive
from .comparison.measured import MeasuredCloud, measured_surfaces
from .comparison.study import Study
from .learned.evaluation import learned
from .paper.contamination import contaminations
from .paper.figures import figure4, figure8, figure10, figure11
from .paper.table1 import table1
from .steps import Finished, Step, forget_steps, run_steps
from .workload import seconds_per_work

FIGURES: dict[str, Callable[[Study], list[Step]]] = {
    'figure4': figure4,
    'figure8': figure8,
    'figure10': figure10,
    'figure11': figure11,
}
"""The figures of the paper."""

_PAPER_TITLE = 'The social circle compared with other filters'
_PAPER_INTRODUCTION = (
    'The experiments of "Fast outlier removing method for point cloud of microscopic 3D measurement based on'
    ' social circle", repeated on clouds with known outliers. Does the social circle keep more points, remove'
    ' more outliers and take less time than other filters? Every sentence under "Findings" is computed from'
    ' this run.'
)
_ADAPTIVE_TITLE = 'The adaptive mode and its goals'
_ADAPTIVE_INTRODUCTION = (
    'The adaptive mode has one setting for all instruments. This page lists its goals and the measured values, on'
    ' simulated clouds and on measured surfaces. No constant of the mode was chosen on the seeds used here. Every'
    ' sentence under "Findings" is computed from this run.'
)
_LEARNED_TITLE = 'The network of the adaptive mode, and the rules'
_LEARNED_INTRODUCTION = (
    'A small network gives each point a probability of being an outlier. This page compares it with the rules of'
    ' the adaptive mode on the same whole surfaces with the same outliers. Every sentence under "Findings" is'
    ' computed from this run.'
)


def learned_steps(study: Study, data: Path, network: Path | None, *, quick: bool = False) -> list[Step]:
    """The steps that compare a network with the rules of the adaptive mode.

    Args:
        study: seeds and repeats.
        data: folder of measured surfaces, with its subfolder `training/`.
        network: ONNX file; None: the packaged one.
        quick: only the first surface.

    Raises:
        SocialCircleError: the network cannot be read, or ONNX Runtime is not installed.
    """
    judge = packaged_network() if network is None else NetworkJudge(network, usable_cores())
    return learned(study, data, judge, quick=quick)


def steps_of(name: str, study: Study, measured: Sequence[MeasuredCloud] = ()) -> list[Step]:
    """The steps of one experiment, or of all of the paper's.

    Args:
        name: 'table1', a key of `FIGURES`, 'all' for these together, or 'adaptive'.
        study: clouds, filters and settings.
        measured: surfaces of real instruments, shown with figure 8 and used by the adaptive mode's experiment.
    """
    if name == 'adaptive':
        return adaptive(study, measured)
    steps: list[Step] = []
    if name in ('table1', 'all'):
        steps += [*table1(study), *contaminations(study)]
    for each, make in FIGURES.items():
        if name in (each, 'all'):
            steps += make(study)
    if name in ('figure8', 'all'):
        steps += measured_surfaces(study, measured)
    return steps


def run(
    folder: Path, name: str, steps: Sequence[Step], fingerprint: str, *, command: str = '', restart: bool = False
) -> Iterator[Finished]:
    """Run an experiment step by step; the page, its tables and its pictures are written after each step.

    The first yield comes before the first step, with an estimate from a small search. Finished steps are kept in
    the folder `NAME.steps`, from which the next run of the same fingerprint continues. It is removed at the end.

    Args:
        folder: an existing directory for the results.
        name: of the experiment; the page is `name.html`.
        steps: from `steps_of` or `learned_steps`.
        fingerprint: of what two runs must have in common to share steps.
        command: the command line, shown on the page.
        restart: whether to forget what an earlier run finished.

    Yields:
        What is known before the first step, and after each.

    Raises:
        SocialCircleError: the folder or a file cannot be written.
    """
    kept = folder / f'{name}.steps'
    if restart:
        forget_steps(kept)
    for finished in run_steps(steps, kept, fingerprint, seconds_per_work):
        write(folder, name, command, finished)
        yield finished
    forget_steps(kept)


def write(folder: Path, name: str, command: str, finished: Finished) -> list[Path]:
    """Write the tables as CSV, the pictures as PNG, and everything as one HTML page, as far as it is finished.

    Args:
        folder: an existing directory.
        name: of the experiment; the page is `name.html`.
        command: the command line, shown on the page.
        finished: the steps so far.

    Returns:
        The written files, the page first.

    Raises:
        SocialCircleError: the folder or a file cannot be written.
    """
    if name == 'adaptive':
        title, introduction = _ADAPTIVE_TITLE, _ADAPTIVE_INTRODUCTION
    elif name == 'learned':
        title, introduction = _LEARNED_TITLE, _LEARNED_INTRODUCTION
    else:
        title, introduction = _PAPER_TITLE, _PAPER_INTRODUCTION
    provenance = (
        f'Command: {command}. Machine: {hardware()}. Times are from this run; compare ratios rather than times.'
    )
    sections = finished.sections
    introduction_texts = [introduction, provenance]
    if finished.done < finished.total:
        introduction_texts.append(f'Not finished: {finished.done} of {finished.total} steps.')
    contents: dict[Path, str | bytes] = {}
    for section in sections:
        contents |= {folder / f'{table.name}.csv': table.csv() for table in section.tables}
        contents |= {folder / f'{picture.name}.png': picture.png for picture in section.pictures}
    for path, content in contents.items():
        write_file(path, content)
    page = folder / f'{name}.html'
    write_file(page, render(title, introduction_texts, sections))
    return [page, *contents]
