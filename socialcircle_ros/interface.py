# SPDX-License-Identifier: Apache-2.0
"""The interface of the node: its topics, its services, and the keys of `~/measurement` and `/diagnostics`.

The node, `socialcircle filter`, `docs/topics.md` and the tests of the viewer layouts read it from here. The
parameters are declared in `settings`.
"""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, TypeVar

from .errors import MessageError
from .messages import diagnostics, image, joint_state, point_cloud
from .settings import Mode, OutputSettings, markdown_table

NODE_NAME = 'social_circle'

ACTIVE = 'Active: waiting for clouds on'
"""How the sentence begins that the node logs when it is active."""

PASSED, FAILED = 'passed', 'failed'
"""Values of the key `verdict` of `~/measurement`."""

_COLUMN = 'socialcircle'
_MOST_COUNTED = 2**63 - 1


@dataclass(frozen=True)
class NodeTopic:
    """A topic of the node. Its QoS is reliable, keep last `depth`; the `qos_overrides` parameters change it.

    Attributes:
        name: Relative to the namespace of the node. A leading `~/` stands for the name of the node, a leading `/`
            for a topic outside the namespace.
        type: Of the messages.
        direction: 'in': the node subscribes; 'out': the node publishes.
        depth: Number of messages that the middleware keeps.
        when: When a message is published.
        sentence: What a message holds.
    """

    name: str
    type: str
    direction: Literal['in', 'out']
    depth: int
    when: str
    sentence: str

    def within(self, namespace: str, node: str = NODE_NAME) -> str:
        """The full name in a namespace, such as `/cell1/points`.

        Args:
            namespace: Such as `/cell1`; '' or '/' for the root.
            node: Name of the node, for topics with `~/`.
        """
        if self.name.startswith('/'):
            return self.name
        return f'{namespace.rstrip("/")}/{self.name.replace("~", node, 1)}'

    def namespace_of(self, topic: str) -> str | None:
        """The namespace of a full name that is this topic of a node of the default name; None for other topics."""
        suffix = self.within('')
        return topic[: -len(suffix)] if topic.endswith(suffix) else None


@dataclass(frozen=True)
class NodeService:
    """A service of the node, of type std_srvs/srv/Trigger."""

    name: str
    sentence: str


POINTS = NodeTopic(
    'points',
    point_cloud.TYPE,
    'in',
    1,
    'published by the sensor',
    'Organized cloud; x, y, z float32 or float64.',
)
STACK_FRAMES = NodeTopic(
    'stack/image',
    image.TYPE,
    'in',
    50,
    'published by the camera',
    'One frame of a focus stack: mono8, mono16, rgb8, bgr8, bayer_*8.',
)
STACK_JOINT_STATES = NodeTopic(
    'stack/joint_states',
    joint_state.TYPE,
    'in',
    500,
    'published by the stage; used if stack.z_source is joint_states',
    'Position of the stage, in m; it is interpolated at the stamp of each frame.',
)
FILTERED = NodeTopic(
    'points_filtered',
    point_cloud.TYPE,
    'out',
    1,
    'per cloud',
    'The input cloud with x, y and z of outliers set to NaN and is_dense set to match; no other byte changes.',
)
MASK = NodeTopic(
    'outlier_mask',
    image.TYPE,
    'out',
    1,
    'per cloud, if output.mask is true',
    f'mono8, (H, W): {image.KEPT} kept, {image.OUTLIER} outlier, {image.NOT_MEASURED} not measured.',
)
SCORE = NodeTopic(
    'outlier_score',
    image.TYPE,
    'out',
    1,
    'per cloud, if output.score is true and circle.mode is adaptive',
    '32FC1, (H, W): 0 to 1, above 0.5 for outliers, NaN where not measured.',
)
REPAIRED = NodeTopic(
    'points_repaired',
    point_cloud.TYPE,
    'out',
    1,
    'per cloud, if output.repaired is true',
    'The filtered cloud with the holes of outliers filled.',
)
MEASUREMENT = NodeTopic(
    '~/measurement',
    diagnostics.TYPE,
    'out',
    1,
    'per cloud',
    'Counts, seed, radius, settings and times of the stages.',
)
LAST_POINTS = NodeTopic(
    '~/last_points',
    point_cloud.TYPE,
    'out',
    1,
    'when ~/publish_last is called',
    'The last input cloud, unchanged.',
)
STACK_POINTS = NodeTopic(
    'stack/points',
    point_cloud.TYPE,
    'out',
    1,
    'per stack',
    'The cloud of the stack before filtering: x, y and z in m, intensity, quality; rgb if the frames have it.',
)
STACK_IMAGE = NodeTopic(
    'stack/image_in_focus',
    image.TYPE,
    'out',
    1,
    'per stack',
    'All-in-focus image: each pixel is taken from its sharpest frame.',
)
STACK_PREVIEW = NodeTopic(
    'stack/preview',
    point_cloud.TYPE,
    'out',
    1,
    'every stack.preview frames of a stack',
    'The cloud of the unfinished stack, not filtered.',
)
DIAGNOSTICS = NodeTopic(
    '/diagnostics',
    'diagnostic_msgs/msg/DiagnosticArray',
    'out',
    10,
    'once per second',
    'State, rate, latencies, counts of dropped and refused input, and the reason of the last refusal.',
)

TOPICS = (
    POINTS,
    STACK_FRAMES,
    STACK_JOINT_STATES,
    FILTERED,
    MASK,
    SCORE,
    REPAIRED,
    MEASUREMENT,
    LAST_POINTS,
    STACK_POINTS,
    STACK_IMAGE,
    STACK_PREVIEW,
    DIAGNOSTICS,
)

CLOUD_OUTPUTS = (FILTERED, MASK, SCORE, REPAIRED, MEASUREMENT)
"""The topics that may get a message for each filtered cloud."""

STACK_OUTPUTS = (STACK_POINTS, STACK_IMAGE)
"""The topics that get a message for each finished stack."""

FINISH_STACK = NodeService('~/finish_stack', 'Ends the current stack and publishes its cloud.')
RESET = NodeService('~/reset', 'Discards the last cloud and the current stack, and sets all counts to 0.')
SAVE_PARAMETERS = NodeService('~/save_parameters', 'Writes the parameters to a file that a node can start from.')
PUBLISH_LAST = NodeService(
    '~/publish_last', 'Publishes the last cloud on ~/last_points, then filters it and publishes its results again.'
)

SERVICES = (FINISH_STACK, RESET, SAVE_PARAMETERS, PUBLISH_LAST)


def outputs_of(mode: Mode, output: OutputSettings) -> tuple[NodeTopic, ...]:
    """The topics that get a message for each filtered cloud, live and offline.

    Args:
        mode: Mode of the filter; only the adaptive mode computes scores.
        output: The outputs that are switched on.
    """
    wanted = {
        FILTERED: True,
        MASK: output.mask,
        SCORE: output.score and mode == 'adaptive',
        REPAIRED: output.repaired,
        MEASUREMENT: True,
    }
    return tuple(topic for topic in CLOUD_OUTPUTS if wanted[topic])


@dataclass(frozen=True)
class StatusKey:
    """A key of a DiagnosticStatus, with its unit and its description."""

    name: str
    unit: str
    sentence: str


def _key(sentence: str, unit: str = '') -> dict[str, StatusKey]:
    return {_COLUMN: StatusKey('', unit, sentence)}


Values = TypeVar('Values', bound='StatusValues')


@dataclass(frozen=True)
class StatusValues:
    """Base of the two tables of keys: each field is a key, and its value is sent as text."""

    @classmethod
    def keys(cls) -> tuple[StatusKey, ...]:
        """The keys, in the order in which they are sent."""
        rows = [(each.name, each.metadata[_COLUMN]) for each in dataclasses.fields(cls)]
        return tuple(StatusKey(name, row.unit, row.sentence) for name, row in rows)

    def to_text(self) -> dict[str, str]:
        """Keys and values as a DiagnosticStatus holds them; unknown values are left out."""
        named = {each.name: getattr(self, each.name) for each in dataclasses.fields(self)}
        return {name: _text(name, value) for name, value in named.items() if value is not None}


def _text(name: str, value: float | str) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, int):
        return str(value)
    return f'{value:.1f}' if name.endswith(('_ms', '_hz')) else repr(value)


@dataclass(frozen=True)
class MeasurementValues(StatusValues):
    """The keys of `~/measurement`. The circle parameters and the times of the stages follow them."""

    stamp: str = field(metadata=_key('Stamp of the cloud.', 's'))
    points: int = field(metadata=_key('Points of the cloud, including those that are not measured.', 'points'))
    measured: int = field(metadata=_key('Measured points.', 'points'))
    kept: int = field(metadata=_key('Measured points that are kept.', 'points'))
    outliers: int = field(metadata=_key('Measured points that are outliers.', 'points'))
    repaired: int = field(metadata=_key('Points filled by the repair.', 'points'))
    seed_row: int = field(metadata=_key('Row of the seed.'))
    seed_column: int = field(metadata=_key('Column of the seed.'))
    radius: float = field(metadata=_key('Radius of the social circle.', 'cloud'))
    stack_depth_of_field: float | None = field(
        default=None,
        metadata=_key('Depth of field, read from the focus curves of a stack; absent for other clouds.', 'm'),
    )
    verdict: str | None = field(
        default=None, metadata=_key('passed or failed, by the limits; absent if no limit is set.')
    )
    verdict_reason: str | None = field(default=None, metadata=_key('Why the measurement failed; else absent.'))

    @classmethod
    def from_text(cls, values: Mapping[str, str]) -> 'MeasurementValues':
        """Read the values of a DiagnosticStatus.

        Raises:
            MessageError: A key is missing, or its value has a wrong type.
        """
        found: dict[str, str | int | float | None] = {}
        for each in dataclasses.fields(cls):
            text = values.get(each.name)
            try:
                if text is None and each.default is not dataclasses.MISSING:
                    continue
                if text is None:
                    raise KeyError(each.name)  # noqa: TRY301 - one message for both
                found[each.name] = (
                    text if each.type in (str, str | None) else _number(text, whole=each.type is int)
                )
            except (KeyError, ValueError):
                raise MessageError(
                    f'The message is not a measurement of the node: its key {each.name!r} is {text!r}.'
                ) from None
        return cls(**found)  # type: ignore[arg-type]


def _number(text: str, *, whole: bool) -> int | float:
    """Read a number; a count or an index of more than 64 bits is none."""
    if not whole:
        return float(text)
    number = int(text)
    if not -_MOST_COUNTED <= number <= _MOST_COUNTED:
        raise ValueError(text)
    return number


@dataclass(frozen=True)
class HealthValues(StatusValues):
    """The keys of `/diagnostics`. Counts of bad pixels of the last stack follow them, one key per reason."""

    state: str = field(metadata=_key('Lifecycle state.'))
    clouds_received: int = field(metadata=_key('Clouds received on points.', 'clouds'))
    clouds_published: int = field(
        metadata=_key('Clouds filtered and published, including clouds of stacks.', 'clouds')
    )
    clouds_dropped: int = field(
        metadata=_key('Clouds that were replaced, or not done at a deactivation or the end.', 'clouds')
    )
    clouds_lost: int = field(
        metadata=_key(
            'Clouds that were published but did not reach the node, as far as the middleware tells.', 'clouds'
        )
    )
    clouds_refused: int = field(metadata=_key('Clouds that cannot be filtered.', 'clouds'))
    clouds_failed: int = field(
        metadata=_key('Clouds and frames that caused an unexpected error in the node.', 'clouds')
    )
    limits_failed: int = field(metadata=_key('Clouds that were published and failed the limits.', 'clouds'))
    frames_received: int = field(metadata=_key('Frames received on stack/image.', 'frames'))
    frames_dropped: int = field(
        metadata=_key(
            'Frames that came faster than they are measured, or of a stack that ran at a deactivation or the end.',
            'frames',
        )
    )
    frames_lost: int = field(metadata=_key('Frames that were published but did not reach the node.', 'frames'))
    joint_states_dropped: int = field(metadata=_key('Joint states that came faster than they could be taken.'))
    stack_refusals: int = field(metadata=_key('Frames, joint states and stacks that cannot be used.'))
    stacks_finished: int = field(metadata=_key('Stacks that gave a cloud.', 'stacks'))
    last_reason: str = field(metadata=_key('Reason of the last drop, refusal or error.'))
    rate_hz: float = field(metadata=_key('Clouds received per second, mean of the last 10 s.', 'Hz'))
    latency_median_ms: float | None = field(
        default=None, metadata=_key('Time from arrival to publication, median of the last 10 s.', 'ms')
    )
    latency_max_ms: float | None = field(
        default=None, metadata=_key('Time from arrival to publication, maximum of the last 10 s.', 'ms')
    )
    stack_latency_ms: float | None = field(
        default=None, metadata=_key('Time from the last frame of the last stack to its cloud.', 'ms')
    )
    stack_flicker: float | None = field(
        default=None,
        metadata=_key(
            'Standard deviation of the mean light of the frames of the last stack, as a share of the mean; it is'
            ' divided out if focus.normalize is true.'
        ),
    )
    stack_focus_step: int | None = field(
        default=None,
        metadata=_key(
            'Step of the focus measure of the last stack: focus.step, or what was chosen from its frames.',
            'pixels',
        ),
    )
    stack_drift_px: float | None = field(
        default=None,
        metadata=_key(
            'How far the frames of the last stack moved sideways; absent if their texture does not tell.', 'pixels'
        ),
    )
    stack_registered_px: float | None = field(
        default=None,
        metadata=_key(
            'How far stack.register moved a corner of the frames of the last stack, at most; absent without it.',
            'pixels',
        ),
    )
    stack_registered_magnification: float | None = field(
        default=None,
        metadata=_key(
            'Largest magnification of one frame of the last stack relative to another, as stack.register found it.'
        ),
    )
    publishers: int | None = field(
        default=None, metadata=_key('Publishers on points; present while the node is active.')
    )
    connections: str | None = field(
        default=None,
        metadata=_key(
            'Publishers that the node cannot receive from, and what to change; present while the node is active.'
        ),
    )
    differences: str | None = field(
        default=None,
        metadata=_key('What the installed rclpy lacks, and what is lost by it; else absent.'),
    )


STAGE_TIME = 'time_{stage}_ms'
"""Key of the time of a stage in `~/measurement`; the stage `total` is their sum."""

BAD_PIXELS = 'stack_pixels_{reason}'
"""Key of the number of bad pixels of the last stack, by reason."""


def interface_tables() -> dict[str, str]:
    """The Markdown tables of `docs/topics.md`, by name."""
    return {
        'subscribed topics': _topic_table('in'),
        'published topics': _topic_table('out'),
        'services': markdown_table(
            ('service', 'effect'), [(f'`{each.name}`', each.sentence) for each in SERVICES]
        ),
        'measurement keys': _key_table(MeasurementValues),
        'diagnostics keys': _key_table(HealthValues),
    }


def _topic_table(direction: Literal['in', 'out']) -> str:
    rows = [
        (f'`{each.name}`', each.type, each.sentence, each.when, str(each.depth))
        for each in TOPICS
        if each.direction == direction
    ]
    return markdown_table(('topic', 'type', 'message', 'when', 'depth'), rows)


def _key_table(values: type[StatusValues]) -> str:
    keys = values.keys()
    return markdown_table(('key', 'unit', 'value'), [(f'`{key.name}`', key.unit, key.sentence) for key in keys])
