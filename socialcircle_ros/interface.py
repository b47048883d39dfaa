"""The node's interface, once: its topics, its services, and the keys of its measurement and of its diagnostics.

The node's publishers, what `socialcircle filter` writes, the tables of the documents, and the tests of the shipped
viewer layouts read it from here. Parameters are in `settings`.
"""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, TypeVar

from .errors import MessageError
from .messages import diagnostics, image, joint_state, point_cloud
from .settings import Mode, OutputSettings

NODE_NAME = 'social_circle'

_COLUMN = 'socialcircle'


@dataclass(frozen=True)
class NodeTopic:
    """A topic of the node. QoS is reliable, keep last `depth`; `qos_overrides` change it.

    Attributes:
        name: relative to the node's namespace; `~/` stands for the node's own name, `/` for the whole graph.
        type: of the messages.
        direction: as the node sees it.
        depth: how many messages the middleware keeps.
        when: when a message comes.
        sentence: what it is.
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
            namespace: such as `/cell1`; '' or '/': the root.
            node: the node's name, which `~/` stands for.
        """
        if self.name.startswith('/'):
            return self.name
        return f'{namespace.rstrip("/")}/{self.name.replace("~", node, 1)}'

    def namespace_of(self, topic: str) -> str | None:
        """The namespace in which a full name is this topic of a node of the usual name; None: it is another."""
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
    'as the sensor sends it',
    'Organized cloud; x, y, z float32 or float64.',
)
STACK_FRAMES = NodeTopic(
    'stack/image',
    image.TYPE,
    'in',
    50,
    'as the camera sends it',
    'One frame of a focus stack: mono8, mono16, rgb8, bgr8, bayer_*8.',
)
STACK_JOINT_STATES = NodeTopic(
    'stack/joint_states',
    joint_state.TYPE,
    'in',
    500,
    'with stack.z_source joint_states',
    'Position of the stage in m, interpolated at the stamp of each frame.',
)
FILTERED = NodeTopic(
    'points_filtered',
    point_cloud.TYPE,
    'out',
    1,
    'per cloud',
    'The cloud with x, y and z of outliers NaN; every other byte as it came.',
)
MASK = NodeTopic(
    'outlier_mask',
    image.TYPE,
    'out',
    1,
    'per cloud, with output.mask',
    f'mono8, (H, W): {image.KEPT} kept, {image.OUTLIER} outlier, {image.NOT_MEASURED} not measured.',
)
SCORE = NodeTopic(
    'outlier_score',
    image.TYPE,
    'out',
    1,
    'per cloud, with output.score in the adaptive mode',
    '32FC1, (H, W): 0 to 1, above 0.5 for outliers, NaN where not measured.',
)
REPAIRED = NodeTopic(
    'points_repaired',
    point_cloud.TYPE,
    'out',
    1,
    'per cloud, with output.repaired',
    'The filtered cloud with the holes of outliers filled.',
)
MEASUREMENT = NodeTopic(
    '~/measurement',
    diagnostics.TYPE,
    'out',
    1,
    'per cloud',
    'Counts, seed, radius, stage times, settings.',
)
LAST_POINTS = NodeTopic(
    '~/last_points', point_cloud.TYPE, 'out', 1, 'when ~/publish_last is called', 'The last cloud as it came.'
)
STACK_POINTS = NodeTopic(
    'stack/points',
    point_cloud.TYPE,
    'out',
    1,
    'per stack',
    'The cloud of a stack before filtering, in m: x, y, z, intensity, quality.',
)
STACK_IMAGE = NodeTopic(
    'stack/image_in_focus', image.TYPE, 'out', 1, 'per stack', 'Every pixel from its sharpest frame.'
)
STACK_PREVIEW = NodeTopic(
    'stack/preview',
    point_cloud.TYPE,
    'out',
    1,
    'every stack.preview frames',
    'The cloud of the stack so far; it is not filtered.',
)
DIAGNOSTICS = NodeTopic(
    '/diagnostics',
    'diagnostic_msgs/msg/DiagnosticArray',
    'out',
    10,
    'once per second',
    'Rates, latencies, counts of dropped and refused input, and the reason of the last refusal.',
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
"""What can come of a cloud."""

STACK_OUTPUTS = (STACK_POINTS, STACK_IMAGE)
"""What comes of a finished stack, before its cloud is filtered."""

FINISH_STACK = NodeService('~/finish_stack', 'Closes the running stack and makes its cloud.')
RESET = NodeService('~/reset', 'Forgets the last cloud and the running stack, and sets all counts to 0.')
SAVE_PARAMETERS = NodeService('~/save_parameters', 'Writes a parameter file that a node can start from.')
PUBLISH_LAST = NodeService('~/publish_last', 'Publishes the last cloud on ~/last_points, then filters it again.')

SERVICES = (FINISH_STACK, RESET, SAVE_PARAMETERS, PUBLISH_LAST)


def outputs_of(mode: Mode, output: OutputSettings) -> tuple[NodeTopic, ...]:
    """Which topics get a message for each filtered cloud, live and offline.

    Args:
        mode: the mode of the filter; only the adaptive mode gives scores.
        output: which outputs are wanted.
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
    """A key of a status, as the documents show it."""

    name: str
    unit: str
    sentence: str


def _key(sentence: str, unit: str = '') -> dict[str, StatusKey]:
    return {_COLUMN: StatusKey('', unit, sentence)}


Values = TypeVar('Values', bound='StatusValues')


@dataclass(frozen=True)
class StatusValues:
    """Base of the two tables of keys: each field is a key, and its value is written as text."""

    @classmethod
    def keys(cls) -> tuple[StatusKey, ...]:
        """The keys of the table, in the order in which they are written."""
        rows = [(each.name, each.metadata[_COLUMN]) for each in dataclasses.fields(cls)]
        return tuple(StatusKey(name, row.unit, row.sentence) for name, row in rows)

    def to_text(self) -> dict[str, str]:
        """Keys to values as a DiagnosticStatus holds them; what is not known is left out."""
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
    """What `~/measurement` says of a cloud. The settings in force and the stage times follow these keys."""

    stamp: str = field(metadata=_key('Stamp of the cloud.', 's'))
    points: int = field(metadata=_key('Points of the cloud, measured or not.', 'points'))
    measured: int = field(metadata=_key('Measured points.', 'points'))
    kept: int = field(metadata=_key('Points that were kept.', 'points'))
    outliers: int = field(metadata=_key('Points that were removed.', 'points'))
    repaired: int = field(metadata=_key('Points that the repair filled.', 'points'))
    seed_row: int = field(metadata=_key('Row of the seed.'))
    seed_column: int = field(metadata=_key('Column of the seed.'))
    radius: float = field(metadata=_key('Radius in force.', 'cloud'))
    stack_depth_of_field: float | None = field(
        default=None,
        metadata=_key('Depth of field, from the frames of a stack; absent for other clouds.', 'm'),
    )

    @classmethod
    def from_text(cls, values: Mapping[str, str]) -> 'MeasurementValues':
        """Read the values of a status.

        Raises:
            MessageError: a key is missing, or its value is not of its kind.
        """
        found: dict[str, str | int | float | None] = {}
        for each in dataclasses.fields(cls):
            text = values.get(each.name)
            try:
                if text is None and each.default is not dataclasses.MISSING:
                    continue
                if text is None:
                    raise KeyError(each.name)  # noqa: TRY301 - one sentence for both
                found[each.name] = text if each.type is str else int(text) if each.type is int else float(text)
            except (KeyError, ValueError):
                raise MessageError(
                    f'It is not a measurement of the node: its key {each.name!r} is {text!r}.'
                ) from None
        return cls(**found)  # type: ignore[arg-type]


@dataclass(frozen=True)
class HealthValues(StatusValues):
    """What `/diagnostics` says of the node. The bad pixels of the last stack follow, one key for each reason."""

    state: str = field(metadata=_key('State of the lifecycle.'))
    clouds_received: int = field(metadata=_key('Clouds that came on points.', 'clouds'))
    clouds_published: int = field(metadata=_key('Clouds that were filtered and published.', 'clouds'))
    clouds_dropped: int = field(metadata=_key('Clouds that a newer one replaced while they waited.', 'clouds'))
    clouds_refused: int = field(metadata=_key('Clouds that could not be used.', 'clouds'))
    clouds_failed: int = field(metadata=_key('Clouds and frames that met a fault of the node.', 'clouds'))
    frames_received: int = field(metadata=_key('Frames that came on stack/image.', 'frames'))
    frames_dropped: int = field(metadata=_key('Frames that came faster than they could be measured.', 'frames'))
    stack_refusals: int = field(metadata=_key('Frames, joint states and stacks that could not be used.'))
    stacks_finished: int = field(metadata=_key('Stacks that became clouds.', 'stacks'))
    last_reason: str = field(metadata=_key('Why the last input was dropped or refused.'))
    rate_hz: float = field(metadata=_key('Clouds received per second, over the last 10 s.', 'Hz'))
    latency_median_ms: float | None = field(
        default=None, metadata=_key('From arrival to publication, over the last 10 s: median.', 'ms')
    )
    latency_max_ms: float | None = field(
        default=None, metadata=_key('From arrival to publication, over the last 10 s: maximum.', 'ms')
    )
    stack_latency_ms: float | None = field(
        default=None, metadata=_key('From the last frame of the last stack to its cloud.', 'ms')
    )
    publishers: int | None = field(default=None, metadata=_key('Publishers on points; only while active.'))
    connections: str | None = field(
        default=None, metadata=_key('Publishers that cannot be heard, and what to change; only while active.')
    )


STAGE_TIME = 'time_{stage}_ms'
"""Key of a stage time in a measurement; `total` is their sum."""

BAD_PIXELS = 'stack_pixels_{reason}'
"""Key of the number of pixels of the last stack that are bad for a reason."""
