# SPDX-License-Identifier: Apache-2.0
"""Goals: a measured quantity, the bound that is asked of it, and whether it is met."""

from collections.abc import Sequence
from dataclasses import dataclass

from socialcircle_ros.report.content import Column, Section, Table
from socialcircle_ros.studies.steps import rows_of

GOALS = 'adaptive_goals'
"""The table of the goals of the adaptive mode."""


@dataclass(frozen=True)
class Goal:
    """A measured quantity and its bound.

    Attributes:
        quantity: what is measured.
        measured: its value; NaN, where it could not be measured, misses the goal.
        bound: the goal.
        at_least: whether the bound is a lower bound; else it is an upper one.
        form: format specification of both values.
    """

    quantity: str
    measured: float
    bound: float
    at_least: bool = True
    form: str = '.3f'

    @property
    def is_met(self) -> bool:
        """Whether the value is on the right side of the bound."""
        return self.measured >= self.bound if self.at_least else self.measured <= self.bound

    @property
    def bound_text(self) -> str:
        """The bound, such as `at least 0.920`."""
        return f'{"at least" if self.at_least else "at most"} {self.bound:{self.form}}'

    @property
    def verdict(self) -> str:
        """`met` or `missed`."""
        return 'met' if self.is_met else 'missed'

    @property
    def sentence(self) -> str:
        """Quantity, value, bound and verdict."""
        return f'{self.quantity}: {self.measured:{self.form}} (goal: {self.bound_text}, {self.verdict}).'


def goals_section(name: str, goals: Sequence[Goal]) -> Section:
    """The goals, one a row and one a finding. Sections of several steps are merged into one.

    Args:
        name: of the table.
        goals: those that a step decides.
    """
    columns = [Column('quantity'), Column('goal'), Column('measured'), Column('result')]
    rows = [[goal.quantity, goal.bound_text, f'{goal.measured:{goal.form}}', goal.verdict] for goal in goals]
    table = Table(name, 'Goals and measured values', columns, rows)
    return Section('Goals', findings=[goal.sentence for goal in goals], items=[table])


def goals_met(name: str, made: Sequence[Section]) -> Section:
    """How many of the goals of all steps are met."""
    results = [row[-1] for row in rows_of(made, name)]
    return Section('Goals', findings=[f'{results.count("met")} of {len(results)} goals are met.'])
