# SPDX-License-Identifier: Apache-2.0
"""A node without ROS: it filters with the pipeline, checks with the settings, and can be made absent."""

import dataclasses
import threading
import time

from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.interface import MASK, STACK_FRAMES, STACK_JOINT_STATES
from socialcircle_ros.messages.image import decode_mono8
from socialcircle_ros.panel.link import Descriptor, LogEntry, ParameterKind, Presence, ShownCloud, Snapshot
from socialcircle_ros.pipeline.clouds import filter_cloud
from socialcircle_ros.pipeline.stacks import StackAssembler, StackCloud
from socialcircle_ros.settings import GROUPS, PARAMETERS, CircleSettings, PipelineSettings

KINDS = {
    bool: ParameterKind.BOOLEAN,
    int: ParameterKind.INTEGER,
    float: ParameterKind.REAL,
    str: ParameterKind.TEXT,
    list: ParameterKind.INTEGERS,
}


def descriptors():
    return tuple(
        Descriptor(
            row.name, KINDS[row.kind], row.sentence, row.unit, row.allowed, row.limits.choices, row.limits.minimum,
            row.limits.maximum, (2 if row.limits.odd else 1) if row.kind is int else 0, row.read_only,
        )
        for row in PARAMETERS.values()
    )  # fmt: skip


class FakeLink:
    """A `Link` to a node in this process."""

    def __init__(self, name='/cell1/social_circle'):
        self.name = name
        self.changed = threading.Condition()
        self.published = []
        self.asked = []
        self.entries = []
        self.snapshot = Snapshot(
            revision=1, presence=Presence.ACTIVE, starts=1, sentence='Clouds are filtered as they come.',
            descriptors=descriptors(),
            values={name: row.default for name, row in PARAMETERS.items()} | {'circle.mode': 'paper'},
        )  # fmt: skip

    def update(self, **changes):
        with self.changed:
            self.snapshot = dataclasses.replace(
                self.snapshot, revision=self.snapshot.revision + 1, log=tuple(self.entries),
                log_total=len(self.entries), **changes,
            )  # fmt: skip
            self.changed.notify_all()

    @property
    def newest(self):
        with self.changed:
            return self.snapshot

    def wait(self, revision, timeout_s):
        with self.changed:
            self.changed.wait_for(lambda: self.snapshot.revision > revision, timeout_s)
            return self.snapshot

    def change(self, values):
        self.asked.append(dict(values))
        wanted = {**self.snapshot.values, **values}
        try:
            for group in GROUPS:
                group.from_ros(wanted)
        except SocialCircleError as error:
            return str(error)
        for name, value in values.items():
            self.entries.append(
                LogEntry(time.time(), f'{name}: {self.snapshot.values[name]} → {value} (this page)')
            )
        self.update(values=wanted)
        if self.published:
            self.filter(self.published[-1])
        return ''

    def publish(self, cloud):
        self.published.append(cloud)
        self.filter(cloud)
        return ''

    def publish_stack(self, messages):
        assembler = StackAssembler()
        settings = PipelineSettings.from_ros(self.snapshot.values)
        assembler.configure(settings.focus, settings.stack)
        add = {STACK_FRAMES: assembler.add_frame, STACK_JOINT_STATES: assembler.add_joint_state}
        events = [event for message in messages for event in add[message.topic](message.data)]
        for event in [*events, *assembler.finish()]:
            if isinstance(event, StackCloud):
                self.published.append(event.points)
                self.filter(event.points, event.depth_of_field)
        return ''

    def save(self):
        return 'Saved to ~/.ros/socialcircle/cell1.social_circle.yaml.'

    def filter(self, cloud, depth_of_field=None):
        settings = PipelineSettings(circle=CircleSettings.from_ros(self.snapshot.values))
        outputs = filter_cloud(cloud, settings, depth_of_field)
        number = self.snapshot.shown_cloud.number + 1 if self.snapshot.shown_cloud else 1
        mask, status = decode_mono8(outputs.messages[MASK]), outputs.measurement.status(timed=True)
        self.update(shown_cloud=ShownCloud(number, cloud, mask, status))

    def wait_for(self, condition):
        """Wait until the current values meet a condition."""
        with self.changed:
            assert self.changed.wait_for(lambda: condition(self.snapshot.values), 60)


class FakeGraph:
    """A `Graph` of fake nodes."""

    def __init__(self, *links, taken=None):
        self.links = {link.name: link for link in links}
        self.first = taken

    def nodes(self):
        return tuple(self.links)

    def taken(self):
        return self.first or (next(iter(self.links)) if len(self.links) == 1 else None)

    def sentence(self):
        return f'Nodes: {len(self.links)}.'

    def link(self, name):
        return self.links[name]
