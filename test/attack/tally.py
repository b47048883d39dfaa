# SPDX-License-Identifier: Apache-2.0
"""What became of hostile inputs, counted by kind."""

from dataclasses import dataclass, field


@dataclass
class Tally:
    """The counts of one kind of attack.

    Attributes:
        kind: of the attack.
        tried: hostile inputs.
        survived: those after which the program went on: with a result, or with a refusal in a sentence.
        wrong: results that differ from the results of the clean run.
        lost: good inputs that gave no result.
        faults: what went wrong, for the reader; the first few.
        skipped: why the attack was not possible here; '': it was.
    """

    kind: str
    tried: int = 0
    survived: int = 0
    wrong: int = 0
    lost: int = 0
    faults: list[str] = field(default_factory=list)
    skipped: str = ''

    def tell(self, fault: str) -> None:
        if len(self.faults) < 5:
            self.faults.append(fault)

    def sound(self) -> bool:
        return (self.survived, self.wrong, self.lost) == (self.tried, 0, 0)

    def add(self, other: 'Tally') -> None:
        """Add another run of the same kind."""
        self.tried += other.tried
        self.survived += other.survived
        self.wrong += other.wrong
        self.lost += other.lost
        self.skipped = other.skipped
        for fault in other.faults:
            self.tell(fault)
