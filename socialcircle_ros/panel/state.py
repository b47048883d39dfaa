# SPDX-License-Identifier: Apache-2.0
"""What the page shows, in one place: every card, label, picture and control is made from one `State`. No viser.

A state is never changed; each action and each message gives the next one. So all parts of the page show the same
cloud and setting, whatever the order in which a visitor acts and messages come.
"""

import dataclasses
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from socialcircle_ros.errors import MessageError
from socialcircle_ros.focus import FocusCurve
from socialcircle_ros.messages.header import FIRST_DATE, stamp_of, stamp_text
from socialcircle_ros.settings import RosValue
from socialcircle_ros.settings.effects import VOTE_REGION, has_effect
from socialcircle_ros.teaching.clouds import GoodCloud

from .comparison import Comparison
from .display import Display
from .link import ShownCloud, Snapshot
from .recorded import RecordedCloud

Lost = Mapping[str, tuple[RosValue, RosValue]]
"""The value before a restart of the node, and the one after it, by the name of the parameter."""

MOST_GOOD = 8
"""Most clouds that can be called good: each takes its size in memory."""

_CIRCLE = 'circle.'
_DEPTH_OF_FIELD = 'circle.depth_of_field'


@dataclass(frozen=True)
class OpenRecording:
    """The recording that is stepped through.

    Attributes:
        path: of the recording.
        count: number of its clouds.
        number: of the cloud that was asked for last, from 1 on.
        cloud: what is known of that cloud.
        damage: where the recording breaks off; '': it is complete.
    """

    path: Path
    count: int
    number: int
    cloud: RecordedCloud
    damage: str = ''


@dataclass(frozen=True)
class Sent:
    """The cloud that the page has sent last.

    Attributes:
        path: of its recording.
        count: number of clouds in the recording.
        number: of the cloud, from 1 on.
        stamp: of the cloud, in ns; None for a cloud, which is known by its bytes.
        cloud: the serialized PointCloud2; b'' for a stack, whose cloud the node makes.
        refusals: of the node, before it was sent.
        problem: why it was not delivered; '': it was, or is on its way.
        unit: of the cloud; None: the recording does not say.
    """

    path: Path
    count: int
    number: int
    stamp: int | None
    cloud: bytes
    refusals: int = 0
    problem: str = ''
    unit: str | None = None

    def is_of(self, shown: ShownCloud | None) -> bool:
        """Whether a cloud that the node has filtered is the one that was sent."""
        if shown is None:
            return False
        return shown.cloud == self.cloud if self.stamp is None else _stamp(shown) == self.stamp


@dataclass(frozen=True)
class Compared:
    """The two settings that are compared.

    Attributes:
        a: name of the one; '': the settings of the node.
        b: name of the other; '': the settings of the node.
        of: the cloud, and the values of the node where they count, that the result is of.
        result: of both; None: it is not there yet, or was refused.
        problem: why there is none; '': there is one, or it is on its way.
    """

    a: str
    b: str
    of: tuple[bytes, Mapping[str, RosValue]] | None = None
    result: Comparison | None = None
    problem: str = ''


@dataclass(frozen=True)
class State:
    """All that the page shows of one node.

    Attributes:
        snapshot: of the node.
        recording: the recording that is open; None: none is.
        open_problem: why the path that was given last could not be opened; ''.
        sent: what was sent last; None: nothing.
        compared: two settings on the cloud that is shown; None: the result of the node is shown.
        lost: the settings that the node has lost by a restart, and not got back.
        picked: row and column of the point that was clicked, of the cloud that is shown; None: none was.
        curve: the focus curve of that point; None: nobody asked for it.
        region_of_interest: row, column, height and width; (): none. It stays while all clouds have one size.
        restarted: whether the cloud that is shown was filtered before the node was started again.
        good: the clouds that are called good, by their bytes, oldest first.
        display: how the cloud is displayed.
    """

    snapshot: Snapshot = field(default_factory=Snapshot)
    recording: OpenRecording | None = None
    open_problem: str = ''
    sent: Sent | None = None
    compared: Compared | None = None
    lost: Lost = field(default_factory=dict)
    picked: tuple[int, int] | None = None
    curve: FocusCurve | None = None
    region_of_interest: tuple[int, ...] = ()
    restarted: bool = False
    good: Mapping[bytes, GoodCloud] = field(default_factory=dict)
    display: Display = field(default_factory=Display)

    # The next state

    def followed(self, now: Snapshot) -> 'State':
        """With a new snapshot of the node."""
        before = self.snapshot
        is_restart = 0 < before.starts < now.starts
        old, new = before.shown_cloud, now.shown_cloud
        kept = old is not None and new is not None and old.cloud == new.cloud
        return dataclasses.replace(
            self,
            snapshot=now,
            lost=_lost_after(self.lost, before, now),
            restarted=new is not None and new is old and (self.restarted or is_restart),
            picked=self.picked if kept else None,
            curve=self.curve if kept else None,
            region_of_interest=self.region_of_interest if _same_size(old, new) else (),
        )

    def opened(self, recording: OpenRecording) -> 'State':
        """With a recording that was opened; nothing of it was sent yet."""
        return dataclasses.replace(self, recording=recording, open_problem='')

    def not_opened(self, reason: str) -> 'State':
        """With a path that could not be opened: the recording that is open stays open."""
        return dataclasses.replace(self, open_problem=reason)

    def asked(self, number: int, cloud: RecordedCloud) -> 'State':
        """With another cloud of the recording asked for."""
        if self.recording is None:
            return self
        return dataclasses.replace(
            self, open_problem='', recording=dataclasses.replace(self.recording, number=number, cloud=cloud)
        )

    def sending(self, sent: Sent) -> 'State':
        """With a cloud on its way to the node."""
        return dataclasses.replace(self, sent=dataclasses.replace(sent, refusals=self.snapshot.refusals))

    def delivered(self, sent: Sent, problem: str) -> 'State':
        """With a cloud that has come to the node, or has not; of no effect where another one was sent since."""
        if self.sent is None or (self.sent.path, self.sent.number) != (sent.path, sent.number):
            return self
        return dataclasses.replace(self, sent=dataclasses.replace(self.sent, problem=problem))

    def comparing(self, a: str, b: str) -> 'State':
        """With two settings to compare, by their names; '' is the setting of the node."""
        return dataclasses.replace(self, compared=Compared(a, b))

    def with_comparison(
        self, of: tuple[bytes, Mapping[str, RosValue]], result: Comparison | None, problem: str = ''
    ) -> 'State':
        """With the result of comparing; of no effect where the comparison was closed meanwhile."""
        if self.compared is None:
            return self
        return dataclasses.replace(
            self, compared=dataclasses.replace(self.compared, of=of, result=result, problem=problem)
        )

    def not_comparing(self) -> 'State':
        """With the result of the node in place of a comparison."""
        return dataclasses.replace(self, compared=None)

    def picking(self, place: tuple[int, int] | None) -> 'State':
        """With another point that was clicked."""
        return dataclasses.replace(self, picked=place, curve=None)

    def with_curve(self, of: tuple[bytes, tuple[int, int]], curve: FocusCurve) -> 'State':
        """With the focus curve of a point; of no effect where another cloud or point is shown by now.

        Args:
            of: the serialized cloud, and row and column of the point.
            curve: of the point.
        """
        if self.shown is None or of != (self.shown.cloud, self.picked):
            return self
        return dataclasses.replace(self, curve=curve)

    def looking_at(self, region: tuple[int, ...]) -> 'State':
        """With a region of interest: row, column, height and width within the cloud that is shown; (): none."""
        return dataclasses.replace(self, region_of_interest=region)

    def displaying(self, display: Display) -> 'State':
        """With the cloud displayed in another way."""
        return dataclasses.replace(self, display=display)

    def calling_good(self, message: bytes, cloud: GoodCloud) -> 'State':
        """With a cloud called good, by its message; the oldest goes where there are too many."""
        good = {**self.good, message: cloud}
        return dataclasses.replace(self, good=dict(list(good.items())[-MOST_GOOD:]))

    def forgetting_good(self) -> 'State':
        """With no cloud called good."""
        return dataclasses.replace(self, good={})

    def keeping_new_settings(self) -> 'State':
        """Without the offer of the settings before a restart."""
        return dataclasses.replace(self, lost={})

    # What the page shows

    @property
    def shown(self) -> ShownCloud | None:
        """The cloud that every part of the page shows; None: none has come."""
        return self.snapshot.shown_cloud

    @property
    def to_compare(self) -> tuple[bytes, Mapping[str, RosValue]] | None:
        """What a comparison is of now: the cloud, and the node's values where they count; None: nothing."""
        if self.compared is None or self.shown is None:
            return None
        of_node = not (self.compared.a and self.compared.b)
        return self.shown.cloud, (self.snapshot.values if of_node else {})

    @property
    def comparison(self) -> Comparison | None:
        """The comparison that is shown: of the cloud and the settings that are shown, else there is none."""
        compared, wanted = self.compared, self.to_compare
        return compared.result if compared is not None and wanted is not None and compared.of == wanted else None

    @property
    def must_compare(self) -> bool:
        """Whether the comparison is of another cloud or of other settings than those that are shown."""
        wanted = self.to_compare
        return self.compared is not None and wanted is not None and self.compared.of != wanted

    @property
    def title(self) -> str:
        """Which cloud is shown, in words; '' where there is none."""
        if self.shown is None:
            return ''
        if self.sent is not None and self.sent.is_of(self.shown):
            return f'Cloud {self.sent.number} of {self.sent.count} of {self.sent.path.name}'
        stamp = _stamp(self.shown)
        return 'A cloud of the node' if stamp is None else f'The cloud with the stamp {stamp_text(stamp)} s'

    @property
    def stack_number(self) -> int | None:
        """The number of the recorded stack that is shown, from 1 on; None: another cloud is shown."""
        sent, recording = self.sent, self.recording
        if sent is None or sent.stamp is None or recording is None or recording.path != sent.path:
            return None
        return sent.number if sent.is_of(self.shown) else None

    @property
    def unit(self) -> str | None:
        """The unit of the cloud that is shown; None: it is not known. Clouds of focus stacks are in m."""
        if self.sent is not None and self.sent.is_of(self.shown) and self.sent.unit is not None:
            return self.sent.unit
        return 'm' if self.shown is not None and self.shown.depth_of_field is not None else None

    @property
    def region(self) -> tuple[int, ...]:
        """The vote region that is in force: row, column, height and width; empty where there is none."""
        if not self.votes:
            return ()
        region = self.snapshot.values.get(VOTE_REGION)
        return tuple(region) if isinstance(region, list) and any(region) else ()

    @property
    def votes(self) -> bool:
        """Whether the mode of the node has a vote region."""
        return has_effect(VOTE_REGION, self.snapshot.values)

    @property
    def differing(self) -> Mapping[str, tuple[str, str]]:
        """The settings of the result that is shown, and those in force, by name where they differ."""
        shown = self.shown
        if shown is None or shown.measurement is None:
            return {}
        found = shown.measurement.values
        return {
            name: (found[name], str(value))
            for name, value in self.snapshot.values.items()
            if name.startswith(_CIRCLE)
            and name in found
            and found[name] != str(value)
            and not (name == _DEPTH_OF_FIELD and value == 0.0 and shown.depth_of_field is not None)
        }

    @property
    def caveat(self) -> str:
        """Why the result that is shown is not that of the node with the settings in force; ''."""
        if self.differing:
            parts = [f'{name} = {old}, now {new}' for name, (old, new) in self.differing.items()]
            return f'Filtered with other settings: {"; ".join(parts)}.'
        return 'Filtered before the node was started again.' if self.restarted else ''

    @property
    def stepping(self) -> str:
        """Where the recording stands, and what became of the cloud that was sent; '' where none is open."""
        recording = self.recording
        if recording is None:
            return ''
        date = ''
        if recording.cloud.log_time >= FIRST_DATE:
            date = time.strftime(' %Y-%m-%d %H:%M:%S', time.localtime(recording.cloud.log_time / 1e9))
        kind = 'Stack' if recording.cloud.stack is not None else 'Cloud'
        where = f'{kind} {recording.number} of {recording.count} of {recording.path.name}'
        return f'{where}, recorded{date} on {recording.cloud.topic}.'

    @property
    def stepping_problem(self) -> str:
        """Why the cloud that was asked for is not the one that is shown; ''."""
        recording, sent = self.recording, self.sent
        parts = []
        if recording is not None and sent is not None and sent.path == recording.path:
            if sent.problem:
                parts.append(sent.problem)
            elif not sent.is_of(self.shown):
                if self.snapshot.refusals > sent.refusals:
                    parts.append(f'The node has refused it: {self.snapshot.last_reason}')
                else:
                    parts.append('The node has not answered yet.')
        if recording is not None and recording.cloud.stack is not None and recording.cloud.stack.warning:
            parts.append(recording.cloud.stack.warning)
        if recording is not None and recording.damage:
            parts.append(recording.damage)
        return ' '.join(parts)


class CurrentState:
    """The state that the page shows now. Its methods may be called from any thread.

    Args:
        show: called with each new state; never at the same time in two threads.
    """

    def __init__(self, show: Callable[[State], None]) -> None:
        self._show = show
        self._state = State()
        self._changing = threading.RLock()

    @property
    def now(self) -> State:
        """The state."""
        return self._state

    def change(self, step: Callable[[State], State]) -> State:
        """Take the next state, and show it.

        Args:
            step: gives the next state for the present one.

        Returns:
            The next state.
        """
        with self._changing:
            self._state = step(self._state)
            self._show(self._state)
            return self._state


def _lost_after(lost: Lost, before: Snapshot, now: Snapshot) -> Lost:
    """The settings that the node has lost by its restarts, after the next snapshot.

    A value that is set after the restart, by whomever, is no longer lost.
    """
    if now.starts != before.starts:
        had = {**before.values, **{name: value for name, (value, _) in lost.items()}}
        lost = {
            name: (had[name], now.values[name]) for name in now.writable() if name in had and name in now.values
        }
    return {
        name: (value, after)
        for name, (value, after) in lost.items()
        if now.values.get(name) == after and value != after
    }


def _same_size(old: ShownCloud | None, new: ShownCloud | None) -> bool:
    return old is None or new is None or old.mask.shape == new.mask.shape


def _stamp(shown: ShownCloud) -> int | None:
    try:
        return stamp_of(shown.cloud)
    except MessageError:
        return None
