"""Goals with a number, and whether a measurement reaches them."""

from collections.abc import Sequence
from dataclasses import dataclass

from socialcircle_ros.report.content import Column, Table


@dataclass(frozen=True)
class Goal:
    """What is asked of a figure, and the figure.

    Attributes:
        text: what is measured.
        measured: the figure; NaN, where it could not be taken, reaches nothing.
        asked: the goal.
        least: whether it is the least that is asked; else the most.
        form: how both are written, a format specification.
    """

    text: str
    measured: float
    asked: float
    least: bool = True
    form: str = '.3f'

    @property
    def holds(self) -> bool:
        """Whether the figure reaches the goal."""
        return self.measured >= self.asked if self.least else self.measured <= self.asked

    @property
    def asked_in_words(self) -> str:
        """The goal, such as `at least 0.920`."""
        return f'{"at least" if self.least else "at most"} {self.asked:{self.form}}'

    @property
    def verdict(self) -> str:
        """In one word."""
        return 'holds' if self.holds else 'missed'

    @property
    def sentence(self) -> str:
        """All of it."""
        return f'{self.text}: {self.measured:{self.form}}, asked {self.asked_in_words}: {self.verdict}.'


def goals_table(name: str, goals: Sequence[Goal]) -> Table:
    """The goals, one a line."""
    columns = [Column('goal'), Column('asked'), Column('measured'), Column('')]
    rows = [[goal.text, goal.asked_in_words, f'{goal.measured:{goal.form}}', goal.verdict] for goal in goals]
    held = sum(goal.holds for goal in goals)
    return Table(name, f'{held} of {len(goals)} goals hold', columns, rows)
