"""The experiments by name, the paper's (section 4) and the adaptive mode's, and what they leave on disk."""

from collections.abc import Callable, Sequence
from pathlib import Path

from socialcircle_ros.kernels.machine import hardware
from socialcircle_ros.report.content import Section
from socialcircle_ros.report.page import render, save

from .adaptive.experiment import adaptive
from .comparison.measured import MeasuredCloud, measured_surfaces
from .comparison.study import Study
from .paper.contamination import contaminations
from .paper.figures import figure4, figure8, figure10, figure11
from .paper.table1 import table1

EXPERIMENTS: dict[str, Sequence[Callable[[Study], list[Section]]]] = {
    'table1': (table1, contaminations),
    'figure4': (figure4,),
    'figure8': (figure8,),
    'figure10': (figure10,),
    'figure11': (figure11,),
}
"""What belongs to each experiment of the paper, in the order of the page."""

_INTRODUCTION = (
    'The experiments of "Fast outlier removing method for point cloud of microscopic 3D measurement based on'
    ' social circle", repeated with known truth. Does the social circle keep more points, remove more outliers,'
    ' and take less time than other filters? Every sentence under "What was found" is computed from this run.'
)


_ADAPTIVE_INTRODUCTION = (
    'The adaptive mode has one setting for every instrument. Here stands what is asked of it, and what was'
    ' measured: on simulated clouds and measured surfaces, with seeds that nothing was chosen on. Every sentence'
    ' under "What was found" is computed from this run.'
)
_TITLES = {'adaptive': ('The adaptive mode and its goals', _ADAPTIVE_INTRODUCTION)}


def run(name: str, study: Study, real: Sequence[MeasuredCloud] = ()) -> list[Section]:
    """One experiment, or all of the paper's.

    Args:
        name: of `EXPERIMENTS`, 'all' for all of them, or 'adaptive'.
        study: what takes part.
        real: measured clouds, which are shown with figure 8 and carry outliers for the adaptive mode.
    """
    if name == 'adaptive':
        return adaptive(study, real)
    parts = [part for parts in EXPERIMENTS.values() for part in parts] if name == 'all' else EXPERIMENTS[name]
    sections = [section for part in parts for section in part(study)]
    return sections + measured_surfaces(study, real) if real and name in ('figure8', 'all') else sections


def write(folder: Path, name: str, command: str, sections: Sequence[Section]) -> list[Path]:
    """Write the tables as CSV, the pictures as PNG, and everything as one page.

    Args:
        folder: which is there.
        name: of the page, without its ending.
        command: that made it, for the page.
        sections: what it shows.

    Returns:
        What was written, the page first.

    Raises:
        SocialCircleError: the folder or a file cannot be written.
    """
    page = folder / f'{name}.html'
    title, first = _TITLES.get(name, ('The social circle against other filters', _INTRODUCTION))
    introduction = [
        first,
        f'Made by: {command}. On: {hardware()}. Times are medians, all from this one run; compare their ratios.',
    ]
    tables = [(f'{table.name}.csv', table.csv()) for section in sections for table in section.tables]
    pictures = [(f'{picture.name}.png', picture.png) for section in sections for picture in section.pictures]
    contents: list[tuple[str, str | bytes]] = [*tables, *pictures]
    for file, content in contents:
        save(folder / file, content)
    save(page, render(title, introduction, sections))
    return [page, *(folder / file for file, _ in contents)]
