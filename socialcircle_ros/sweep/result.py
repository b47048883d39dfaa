# SPDX-License-Identifier: Apache-2.0
"""The result of a sweep."""

from collections.abc import Sequence
from dataclasses import dataclass

from socialcircle_ros.settings.effects import MODE, has_effect

from .clouds import SweepCloud
from .decision import Decision
from .search_space import ParameterValues, SearchDimension, described, switched_mode
from .trials import Trial


@dataclass(frozen=True, eq=False)
class SweepResult:
    """The result of a sweep.

    Attributes:
        recording: name of the recording.
        search_space: the varied parameters, with `circle.mode` if they need another mode than the one as given.
        base: all parameters as given, by their full names.
        trials: all trials in the order in which they finished.
        best: the trial with the highest score; whether it is better than `given` says `decision`.
        given: the trial with the parameters as given.
        decision: what can be concluded.
        clouds: the clouds as the best setting measures them.
        resumed: how many of the trials came from an earlier, interrupted sweep.
        refused: number of refused clouds and frames, by reason.
        damage: where the recording is damaged; None if it is intact.
    """

    recording: str
    search_space: Sequence[SearchDimension]
    base: ParameterValues
    trials: Sequence[Trial]
    best: Trial
    given: Trial
    decision: Decision
    clouds: Sequence[SweepCloud]
    resumed: int
    refused: dict[str, int]
    damage: str | None

    @property
    def has_truth(self) -> bool:
        """Whether the trials were scored against a truth, and not against the criterion."""
        return self.clouds[0].has_truth

    @property
    def mode_note(self) -> str:
        """A sentence if the settings are tried in another mode than the given one; '' if they are not."""
        if not switched_mode(self.search_space, self.base):
            return ''
        (dimension,) = (each for each in self.search_space if each.name == MODE)
        names = [each.name for each in self.search_space if not has_effect(each.name, self.base)]
        needed = f', which {" and ".join(names)} {"needs" if len(names) == 1 else "need"}' if names else ''
        modes = next(described([dimension]))
        return f'The setting as given has circle.mode {self.base[MODE]}; all others have {modes}{needed}.'

    @property
    def unit(self) -> str | None:
        """The unit of the clouds; None if it is not known, or not the same for all."""
        units = {cloud.unit for cloud in self.clouds}
        return units.pop() if len(units) == 1 else None

    @property
    def score_names(self) -> tuple[str, str, str]:
        """Names of the score, the precision and the recall of a trial."""
        if self.has_truth:
            return 'F1', 'precision', 'recall'
        return 'agreement', 'precision by criterion', 'recall by criterion'
