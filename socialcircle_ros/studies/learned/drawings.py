"""Picture of a learning curve, as PNG bytes."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from socialcircle_ros.pictures.style import new_figure
from socialcircle_ros.studies.comparison.plotting import as_png

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def learning_curve(steps: Sequence[int], losses: Sequence[float]) -> bytes:
    """Draw the mean loss against the step, both logarithmic."""
    figure: Figure = new_figure(8, 4)
    axis = figure.subplots()
    axis.loglog(steps, losses)
    axis.set_xlabel('step')
    axis.set_ylabel('loss')
    axis.grid(visible=True, which='both', alpha=0.3)
    return as_png(figure)
