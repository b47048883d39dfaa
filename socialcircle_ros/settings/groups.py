"""Every parameter of the node, once.

The fields of the frozen dataclasses below are the table. The node's descriptors, `config/social_circle.yaml` and
the documents read it through `PARAMETERS`.
"""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, TypeVar

from socialcircle_ros.errors import SettingError

from .schema import Parameter, RosValue, Settings, setting

VOTERS = 40_000
"""Most points that a vote region may have."""


Mode = Literal['paper', 'adaptive']


@dataclass(frozen=True)
class CircleSettings(Settings):
    """The filter (section 3.2 of the paper)."""

    group: ClassVar[str] = 'circle'

    mode: Mode = setting(
        'paper',
        "The method: 'paper' is the social circle of the paper, bit for bit; 'adaptive' takes its scales from the"
        ' surface and keeps several communities: of the other circle parameters it uses depth_of_field alone.',
        choices=('paper', 'adaptive'),
    )
    window: int = setting(
        3,
        'Side of the search window; only 3 makes the result independent of the order in which points join.',
        unit='points',
        minimum=3,
        maximum=31,
        odd=True,
    )
    vote_region: tuple[int, int, int, int] | None = setting(
        None,
        'Region T that elects the seed, as [row, column, height, width]; zeros: the smoothest, most fully'
        ' measured 60×60 region is chosen.',
        unit='points',
        minimum=0,
        empty=[0, 0, 0, 0],
    )
    radius: float | None = setting(
        None,
        'Radius of the social circle, in the unit of the cloud; 0: found from the ring (eq. 7).',
        unit='cloud',
        minimum=0.0,
        empty=0.0,
    )
    radius_scale: float = setting(
        1.0,
        'Factor on the radius, given or found: above 1 keeps more points, below 1 removes more.',
        minimum=0.01,
        maximum=100.0,
    )
    depth_of_field: float | None = setting(
        None,
        'For the adaptive mode, depth of field of the microscope that made the cloud, in the unit of the cloud:'
        ' what is off by less than a third of it stays, what is beside a wall goes; 0: as the frames of a stack'
        ' show it, not known for other clouds.',
        unit='cloud',
        minimum=0.0,
        empty=0.0,
    )

    def of_a_stack(self, depth_of_field: float | None) -> 'CircleSettings':
        """The settings for a cloud that was a stack: its depth of field counts where none is given.

        Args:
            depth_of_field: in the unit of the cloud; None: the cloud was no stack, or it does not tell.
        """
        if depth_of_field is None or self.depth_of_field:
            return self
        return dataclasses.replace(self, depth_of_field=depth_of_field)

    def _check_together(self) -> None:
        region = self.vote_region
        if region is not None and (region[2] == 0 or region[3] == 0):
            raise SettingError(
                f'circle.vote_region {list(region)} is empty; give a height and a width of at least 1,'
                ' better 60, or [0, 0, 0, 0] to have it chosen.'
            )
        if region is not None and region[2] * region[3] > VOTERS:
            raise SettingError(
                f'circle.vote_region {list(region)} has {region[2] * region[3]} points; at most {VOTERS} can'
                ' vote, such as 200×200, since each votes for each.'
            )
        if self.radius == 0.0:
            raise SettingError('circle.radius must be above 0; None has it found by eq. 7.')
        if self.depth_of_field == 0.0:
            raise SettingError('circle.depth_of_field must be above 0; None where it is not known.')


Fit = Literal['gauss', 'gauss3']


@dataclass(frozen=True)
class FocusSettings(Settings):
    """From focus stack to depth (section 3.1 of the paper)."""

    group: ClassVar[str] = 'focus'

    step: int = setting(
        2,
        'Step s of the modified Laplacian (eq. 1): 1 sees the finest texture, 2 or 3 stand more noise.',
        unit='pixels',
        minimum=1,
        maximum=8,
    )
    half_window: int = setting(
        4,
        'Half-window N of the focus measure (eq. 2): larger averages noise, smaller resolves finer steps.',
        unit='pixels',
        minimum=0,
        maximum=15,
    )
    threshold: int = setting(
        0,
        'Threshold T on the modified Laplacian (eq. 3): what is below counts as 0; 0 keeps everything.',
        unit='gray levels',
        minimum=0,
        maximum=262140,
    )
    fit: Fit = setting(
        'gauss',
        "How the peak is found between frames: 'gauss' uses as many frames as the curve is wide, 'gauss3'"
        " is Nayar's fit through three.",
        choices=('gauss', 'gauss3'),
    )
    saturation: int | None = setting(
        None,
        'Gray level from which a pixel counts as saturated; 0: the largest that its data type holds.'
        ' A 12-bit camera that sends mono16 needs 4095.',
        unit='gray levels',
        minimum=0,
        maximum=65535,
        empty=0,
    )

    def _check_together(self) -> None:
        if self.saturation == 0:
            raise SettingError('focus.saturation must be above 0; None has it follow the data type.')


ZSource = Literal['step', 'joint_states']


@dataclass(frozen=True)
class StackSettings(Settings):
    """How frames become a stack, and a stack a cloud in metres. A change takes effect with the next stack."""

    group: ClassVar[str] = 'stack'

    pitch_x: float = setting(
        0.0,
        'Distance of two pixels along x on the part; must be set before a stack can become a cloud.',
        unit='m',
        minimum=0.0,
        maximum=1.0,
    )
    pitch_y: float = setting(
        0.0, 'Distance of two pixels along y on the part; 0: as along x.', unit='m', minimum=0.0, maximum=1.0
    )
    z_source: ZSource = setting(
        'step',
        "Where a frame's z comes from: 'step' counts from z_start, 'joint_states' interpolates the stage's"
        " position at the frame's stamp.",
        choices=('step', 'joint_states'),
    )
    z_start: float = setting(0.0, 'z of the first frame, for z_source step.', unit='m')
    z_step: float = setting(
        0.0, 'z from frame to frame, negative downward; must be set for z_source step.', unit='m'
    )
    joint: str = setting('', 'Name of the joint whose position is z, for z_source joint_states; empty: the first.')
    frames: int = setting(
        0, 'A stack ends after so many frames; 0: not by their number.', unit='frames', minimum=0, maximum=30000
    )
    timeout: float = setting(
        1.0, 'A stack ends after so long without a frame; 0: never.', unit='s', minimum=0.0, maximum=3600.0
    )
    end_at_turn: bool = setting(
        False, 'Whether a stack ends when z turns round; the frame behind the turn begins the next one.'
    )
    preview: int = setting(
        0,
        'Every so many frames the cloud so far is published on stack/preview; 0: never.',
        unit='frames',
        minimum=0,
        maximum=30000,
    )


RepairMethod = Literal['biharmonic', 'spline']


@dataclass(frozen=True)
class RepairSettings(Settings):
    """Filling the holes that the filter leaves (section 4.2, and a better way)."""

    group: ClassVar[str] = 'repair'

    method: RepairMethod = setting(
        'biharmonic',
        "How heights are found: 'biharmonic' is the smoothest surface through the points round the hole, with"
        " steps kept sharp; 'spline' is the paper's cubic B-spline along rows and columns.",
        choices=('biharmonic', 'spline'),
    )
    largest: int = setting(
        1000,
        'Largest hole that is filled; points that touch only at a corner belong to two holes.',
        unit='points',
        minimum=1,
        maximum=10000,
    )
    sides: int = setting(
        3,
        'On how many of its four sides (left, right, above, below) a point must have the measured rim of its'
        ' hole; two of them are always opposite, so that nothing is extrapolated.',
        minimum=2,
        maximum=4,
    )
    heights_agree: float = setting(
        0.0,
        'A hole is filled only if the measured heights that touch it differ by no more than this, in the unit'
        ' of the cloud; 0: whatever they are.',
        unit='cloud',
        minimum=0.0,
    )


@dataclass(frozen=True)
class OutputSettings(Settings):
    """What the node publishes beside the filtered cloud."""

    group: ClassVar[str] = 'output'

    mask: bool = setting(True, 'Whether outlier_mask is published with each filtered cloud.')
    score: bool = setting(
        False,
        "Whether outlier_score is published with each filtered cloud, where circle.mode is 'adaptive': 0 to 1,"
        ' above 0.5 for outliers.',
    )
    repaired: bool = setting(
        False, 'Whether points_repaired is published: the filtered cloud with the holes of its outliers filled.'
    )


@dataclass(frozen=True)
class NodeSettings(Settings):
    """How the node behaves."""

    autostart: bool = setting(
        True,
        'Whether the node configures and activates itself at the start, without a lifecycle manager.',
        read_only=True,
    )
    reprocess_last: bool = setting(
        True,
        'Whether a change of parameters filters and publishes the last cloud again, to tune on a pause.',
    )
    parameters_file: str = setting(
        '', 'Where ~/save_parameters writes; empty: a file named after the node, in ~/.ros/socialcircle.'
    )
    silence: float = setting(
        5.0,
        'Time without a cloud from a publisher that is there, after which diagnostics say so; 0: never.',
        unit='s',
        minimum=0.0,
        maximum=86400.0,
    )


GROUPS: tuple[type[Settings], ...] = (
    CircleSettings,
    FocusSettings,
    StackSettings,
    RepairSettings,
    OutputSettings,
    NodeSettings,
)
"""The groups that the node has, in the order in which they are shown."""

PARAMETERS: dict[str, Parameter] = {row.name: row for group in GROUPS for row in group.parameters()}
"""Every parameter of the node by its full name."""


AnyPipelineSettings = TypeVar('AnyPipelineSettings', bound='PipelineSettings')


@dataclass(frozen=True)
class PipelineSettings:
    """With what clouds and stacks are filtered, live and offline."""

    circle: CircleSettings = dataclasses.field(default_factory=CircleSettings)
    focus: FocusSettings = dataclasses.field(default_factory=FocusSettings)
    stack: StackSettings = dataclasses.field(default_factory=StackSettings)
    repair: RepairSettings = dataclasses.field(default_factory=RepairSettings)
    output: OutputSettings = dataclasses.field(default_factory=OutputSettings)

    @classmethod
    def from_ros(cls: type[AnyPipelineSettings], values: Mapping[str, Any]) -> AnyPipelineSettings:  # noqa: PYI019 - not in Python 3.10
        """Settings from full ROS names to values.

        Raises:
            SettingError: a value that cannot be, or values that do not go together.
        """
        groups: dict[str, Any] = {each.name: each.default_factory for each in dataclasses.fields(cls)}
        return cls(**{name: group.from_ros(values) for name, group in groups.items()})

    def to_ros(self) -> dict[str, RosValue]:
        """Every parameter under its full name."""
        groups = (getattr(self, each.name) for each in dataclasses.fields(self))
        return {name: value for group in groups for name, value in group.to_ros().items()}
