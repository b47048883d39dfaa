"""What the page needs of a node, whoever provides it: over ROS it is `node.remote.RemoteNode`."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Protocol

import numpy as np
import numpy.typing as npt

from socialcircle_ros.messages.diagnostics import Status
from socialcircle_ros.settings import RosValue


class ParameterKind(Enum):
    """What a parameter holds."""

    BOOLEAN = 'true or false'
    INTEGER = 'a whole number'
    REAL = 'a number'
    TEXT = 'a text'
    INTEGERS = 'whole numbers'


@dataclass(frozen=True)
class Descriptor:
    """A parameter as its node describes it."""

    name: str
    kind: ParameterKind
    sentence: str
    unit: str = ''
    allowed: str = ''
    """In words, which values are accepted."""
    choices: tuple[str, ...] = ()
    low: float | None = None
    high: float | None = None
    step: float = 0.0
    """Distance of two allowed values from `low` on; 0: none."""
    read_only: bool = False


class Presence(Enum):
    """How far the node can be reached."""

    ABSENT = 'absent'
    SILENT = 'silent'
    """It is in the graph, but does not answer: it starts, hangs, or was killed."""
    INACTIVE = 'inactive'
    ACTIVE = 'active'


@dataclass(frozen=True)
class ShownCloud:
    """A cloud and what the node made of it."""

    number: int
    """Counts the answers."""
    cloud: bytes
    """The PointCloud2 that came in."""
    mask: npt.NDArray[np.uint8]
    """(H, W) as on outlier_mask."""
    measurement: Status | None
    """None where it has not come yet."""

    @property
    def depth_of_field(self) -> float | None:
        """Of the stack that the cloud was; None for other clouds."""
        told = self.measurement.values.get('stack_depth_of_field') if self.measurement else None
        return None if told is None else float(told)


@dataclass(frozen=True)
class LogEntry:
    """A line of the log."""

    time: float
    """Seconds since the epoch."""
    text: str
    bad: bool = False


@dataclass(frozen=True)
class Snapshot:
    """All that is known of the node at one moment."""

    revision: int = 0
    """Higher than that of any snapshot before."""
    presence: Presence = Presence.ABSENT
    sentence: str = ''
    """How the node is, or what is waited for."""
    level: int = 0
    """0 good, 1 warning, 2 error, as in diagnostics."""
    descriptors: tuple[Descriptor, ...] = ()
    """Of every parameter, in the node's order; kept while the node is away."""
    values: Mapping[str, RosValue] = field(default_factory=dict)
    shown_cloud: ShownCloud | None = None
    log: tuple[LogEntry, ...] = ()
    """The newest ones, oldest first."""
    log_total: int = 0
    """How many events there were in all."""


class Link(Protocol):
    """A connection to one node, which may come and go. Its methods may be called from any thread."""

    @property
    def name(self) -> str:
        """The node's full name."""

    def wait(self, revision: int, timeout: float) -> Snapshot:
        """The newest snapshot, as soon as it is newer than `revision`, or after `timeout` seconds."""

    def change(self, values: Mapping[str, RosValue]) -> str:
        """Set parameters, all or none; '' where they were accepted, else the reason of the refusal."""

    def publish(self, cloud: bytes) -> str:
        """Send a serialized PointCloud2 to the node; '' where it was delivered, else what was in the way."""

    def save(self) -> str:
        """Have the node write its parameters to its file; its answer in words."""
