# SPDX-License-Identifier: Apache-2.0
"""What the page needs of nodes, whatever the transport.

Over ROS, `clients.remote_node.RemoteNode` is the `Link`, and `clients.finding.NodeFinder` the `NodeGraph`.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from socialcircle_ros.errors import MessageError
from socialcircle_ros.interface import MeasurementValues, NodeTopic
from socialcircle_ros.messages.diagnostics import Status
from socialcircle_ros.settings import RosValue


class ParameterKind(Enum):
    """What a parameter holds, in the words of an error message."""

    BOOLEAN = 'true or false'
    INTEGER = 'a whole number'
    REAL = 'a number'
    TEXT = 'a text'
    INTEGERS = 'whole numbers'


@dataclass(frozen=True)
class Descriptor:
    """A parameter as its node describes it.

    Attributes:
        name: with its group, such as `circle.window`.
        kind: what it holds.
        sentence: what it does.
        unit: '' where it has none.
        allowed: the accepted values, in words.
        choices: the accepted texts; () where any text is accepted, or it holds no text.
        low: the smallest accepted number; None: there is none.
        high: the largest accepted number; None: there is none.
        step: distance between two accepted numbers from `low` on; 0: any distance.
        read_only: whether it is fixed at the start of the node.
    """

    name: str
    kind: ParameterKind
    sentence: str
    unit: str = ''
    allowed: str = ''
    choices: tuple[str, ...] = ()
    low: float | None = None
    high: float | None = None
    step: float = 0.0
    read_only: bool = False


class Presence(Enum):
    """Whether the node can be reached, and its state if it can."""

    ABSENT = 'absent'
    SILENT = 'silent'
    """It is in the graph but does not respond: it is starting, hangs, or was killed."""
    INACTIVE = 'inactive'
    ACTIVE = 'active'


@dataclass(frozen=True, eq=False)
class ShownCloud:
    """A cloud and what the node made of it.

    Attributes:
        number: counts the clouds, from 1 on.
        cloud: the PointCloud2 that the node filtered, serialized.
        mask: (H, W) uint8, with the values of `outlier_mask`.
        measurement: the node's measurement; None where it has not come yet.
    """

    number: int
    cloud: bytes
    mask: npt.NDArray[np.uint8]
    measurement: Status | None

    @property
    def numbers(self) -> MeasurementValues | None:
        """The numbers of the measurement; None where it has not come yet, or cannot be read."""
        try:
            return MeasurementValues.from_text(self.measurement.values) if self.measurement else None
        except MessageError:
            return None

    @property
    def depth_of_field(self) -> float | None:
        """Depth of field in m of the stack that gave the cloud; None for other clouds."""
        return self.numbers.stack_depth_of_field if self.numbers else None


@dataclass(frozen=True)
class LogEntry:
    """A line of the log.

    Attributes:
        time: in s since the epoch.
        text: what happened.
        bad: whether it needs attention.
    """

    time: float
    text: str
    bad: bool = False


@dataclass(frozen=True)
class Snapshot:
    """All that is known of the node at one moment.

    Attributes:
        revision: higher than that of every earlier snapshot.
        presence: whether the node can be reached.
        starts: how often the node was seen to start; a node that is started again has other values.
        sentence: the state of the node, or what the link waits for.
        level: 0 good, 1 warning, 2 error, as in diagnostics.
        descriptors: of all parameters, in the order of the node; kept while the node is away.
        values: the current values of the parameters, by name; kept while the node is away.
        shown_cloud: the last cloud; None: none has come.
        log: the newest entries, oldest first.
        log_total: how many entries there have been.
        refusals: how many clouds, frames and stacks the node has refused, dropped or failed on.
        last_reason: why, of the last of them.
    """

    revision: int = 0
    presence: Presence = Presence.ABSENT
    starts: int = 0
    sentence: str = ''
    level: int = 0
    descriptors: tuple[Descriptor, ...] = ()
    values: Mapping[str, RosValue] = field(default_factory=dict)
    shown_cloud: ShownCloud | None = None
    log: tuple[LogEntry, ...] = ()
    log_total: int = 0
    refusals: int = 0
    last_reason: str = ''

    def writable(self) -> set[str]:
        """Names of the parameters that can be changed while the node runs."""
        return {row.name for row in self.descriptors if not row.read_only}


class StackMessage(NamedTuple):
    """A frame or a stage position of a recorded stack.

    Attributes:
        topic: of the node.
        data: the serialized message.
        time: when it was recorded, in ns.
    """

    topic: NodeTopic
    data: bytes
    time: int


class Link(Protocol):
    """A connection to one node, which may come and go. Its methods may be called from any thread."""

    @property
    def name(self) -> str:
        """The node's full name."""

    @property
    def newest(self) -> Snapshot:
        """All that is known now; a change that was accepted is in it."""

    def wait(self, revision: int, timeout_s: float) -> Snapshot:
        """Return the newest snapshot, as soon as it is newer than `revision`, or after `timeout_s`."""

    def change(self, values: Mapping[str, RosValue]) -> str:
        """Set parameters, all or none; return '' if they were accepted, else the reason of the refusal."""

    def publish(self, cloud: bytes) -> str:
        """Send a serialized PointCloud2 to the node; return '' if it was delivered, else why it was not."""

    def publish_stack(self, messages: Iterable[StackMessage]) -> str:
        """Send frames and stage positions to the node, and end the stack; return '' or why it did not work."""

    def save(self) -> str:
        """Make the node write its parameters to its file; return its response in words."""


class NodeGraph(Protocol):
    """The nodes that can be tuned. Its methods may be called from any thread."""

    def nodes(self) -> tuple[str, ...]:
        """Full names of the nodes that are offered."""

    def taken(self) -> str | None:
        """The node to begin with; None: a person chooses, or there is none."""

    def sentence(self) -> str:
        """What is waited for while no node is chosen, and what there is."""

    def link(self, name: str) -> Link:
        """The connection to one of the nodes."""
