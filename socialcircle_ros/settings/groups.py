# SPDX-License-Identifier: Apache-2.0
"""The table of parameters: each parameter of the node is declared here, and nowhere else.

Each field of the frozen dataclasses below is a row of the table. The node's descriptors, the parameter file in
`config/` and `docs/parameters.md` read the table through `PARAMETERS`.
"""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, TypeVar

from socialcircle_ros.errors import SettingError

from .effects import needing
from .lessons import Judge, Lesson, finder, read_lesson
from .providers import CPU_PROVIDER, check_provider, require_runtime
from .schema import Parameter, RosValue, Settings, setting
from .stack_groups import FocusSettings, StackSettings

VOTERS = 40_000
"""Largest number of points in a vote region."""


Mode = Literal['paper', 'adaptive']


@dataclass(frozen=True)
class CircleSettings(Settings):
    """Settings of the filter (section 3.2 of the paper)."""

    group: ClassVar[str] = 'circle'

    mode: Mode = setting(
        'adaptive',
        "Method. 'adaptive': takes its scales from the surface and keeps every community; of the other circle"
        ' parameters it uses judge, provider, depth_of_field, lesson and not_measured only.'
        " 'paper': the published method, with one radius and one community; it removes next to nothing"
        ' where the heights are much smaller than the pitch.',
    )
    judge: Judge = setting(
        'network',
        "What decides in the adaptive mode. 'network': a network that has seen many surfaces. 'rules': how steep"
        ' borders are; on unknown textures they remove more good points, and find fewer irregular outliers.'
        ' Where the depth of field is known, as from a stack, the rules decide.',
    )
    provider: str = setting(
        CPU_PROVIDER,
        'What computes the network: the name of an execution provider of ONNX Runtime. Others, such as'
        ' CUDAExecutionProvider for a GPU, need an ONNX Runtime that offers them, and may round otherwise.',
    )
    window: int = setting(
        3,
        'Side of the search window. With 3 the result does not depend on the order in which points join.',
        unit='points',
        minimum=3,
        maximum=31,
        odd=True,
    )
    vote_region: tuple[int, int, int, int] | None = setting(
        None,
        'Region T that elects the seed: [row, column, height, width]. All zeros: the filter chooses the smoothest'
        ' well measured region of 60×60 points.',
        unit='points',
        minimum=0,
        empty=[0, 0, 0, 0],
    )
    radius: float | None = setting(
        None,
        'Radius of the social circle, in the unit of the cloud. 0: found from the ring round the seed (eq. 7).',
        unit='cloud',
        minimum=0.0,
        empty=0.0,
    )
    radius_scale: float = setting(
        1.0,
        'Factor on the radius, whether set or found. Above 1 more points are kept, below 1 more are removed.',
        minimum=0.01,
        maximum=100.0,
    )
    depth_of_field: float | None = setting(
        None,
        'Depth of field of the microscope, in the unit of the cloud; used by the adaptive mode. Islands lower than'
        ' about a third of it are kept, points beside a steep wall are removed. 0: read from the focus curves of a'
        ' stack, unknown for other clouds.',
        unit='cloud',
        minimum=0.0,
        empty=0.0,
    )
    lesson: str = setting(
        '',
        'File that `socialcircle teach` wrote about this kind of part; used by the adaptive mode. It tells the'
        " outliers from the part's own texture. Empty: none.",
    )
    not_measured: str = setting(
        'auto',
        "Which points are not measured, besides NaN: 'auto': many points at exactly one place, such as (0, 0, 0),"
        " or one exact height far from all others; 'nan': none; a number: points of exactly this height.",
    )

    # `lesson`, and what its file held: that is in force until `lesson` is set, whatever becomes of the file.
    _read: tuple[str, Lesson] | None = dataclasses.field(default=None, repr=False, hash=False)

    @classmethod
    def fields_of(cls, values: Mapping[str, object]) -> dict[str, object]:
        """As in every group; where the lesson is set, its file is read again."""
        fields = super().fields_of(values)
        return fields | {'_read': None} if 'lesson' in fields else fields

    def check_machine(self) -> None:
        """Check that ONNX Runtime is installed, if they need it.

        Raises:
            SettingError: It is not.
        """
        if self.uses_network:
            require_runtime()

    @property
    def taught(self) -> Lesson | None:
        """What the lesson file held when `lesson` was set; None: no lesson."""
        return None if self._read is None else self._read[1]

    @property
    def finds_by(self) -> Judge:
        """What finds the outliers in the adaptive mode, as `lessons.finder` defines it."""
        return finder(self.taught, self.judge, has_depth_of_field=self.depth_of_field is not None)

    @property
    def uses_network(self) -> bool:
        """Whether the network is used for clouds that are not from a stack."""
        return self.mode == 'adaptive' and self.finds_by == 'network'

    def without_effect(self) -> tuple[str, ...]:
        """Full names of the parameters that are not at their defaults, but that the mode does not use."""
        if self.mode != 'adaptive':
            return ()
        ours, defaults = self.to_ros(), type(self)().to_ros()
        return tuple(name for name in needing('paper') if ours[name] != defaults[name])

    def of_a_stack(self, depth_of_field: float | None) -> 'CircleSettings':
        """These settings for the cloud of a focus stack: its depth of field is used if none is set.

        Args:
            depth_of_field: Of the stack, in the unit of the cloud. None: the cloud is not from a stack, or its
                focus curves do not show it.

        Returns:
            Settings with a depth of field, if one is set or known.
        """
        if depth_of_field is None or self.depth_of_field:
            return self
        return dataclasses.replace(self, depth_of_field=depth_of_field)

    def _check_together(self) -> None:
        region = self.vote_region
        if region is not None and (region[2] == 0 or region[3] == 0):
            # Zeros of ROS are None here, so that zeros are those of a program.
            raise SettingError(
                f'circle.vote_region {list(region)} is empty; give a height and a width of at least 1, preferably'
                f' 60, or {"[0, 0, 0, 0] (in Python None)" if any(region) else None} to let the filter choose.'
            )
        if region is not None and region[2] * region[3] > VOTERS:
            raise SettingError(
                f'circle.vote_region {list(region)} has {region[2] * region[3]} points; at most {VOTERS} can'
                ' vote (200×200), because every point votes for every other.'
            )
        if self.radius == 0.0:
            raise SettingError('circle.radius must be above 0; use None to find it from the ring (eq. 7).')
        if self.not_measured not in ('auto', 'nan') and not _is_finite_number(self.not_measured):
            raise SettingError(
                f"circle.not_measured is {self.not_measured!r}; use 'auto', 'nan', or the height that stands for"
                " not measured, such as '0' or '-9999'."
            )
        if self._read is None or self._read[0] != self.lesson:
            read = (self.lesson, read_lesson(self.lesson)) if self.lesson else None
            object.__setattr__(self, '_read', read)
        check_provider(self.provider, is_used=self.uses_network)
        if self.depth_of_field == 0.0:
            raise SettingError('circle.depth_of_field must be above 0; use None if it is unknown.')


def _is_finite_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


RepairMethod = Literal['biharmonic', 'spline']


@dataclass(frozen=True)
class RepairSettings(Settings):
    """Settings of the repair: how holes of outliers are filled (section 4.2 of the paper)."""

    group: ClassVar[str] = 'repair'

    method: RepairMethod = setting(
        'biharmonic',
        "How heights are found. 'biharmonic': the smoothest surface through the points round the hole, steps kept"
        " sharp. 'spline': the paper's cubic B-spline along rows and columns; it overshoots at steps, and warns.",
    )
    largest: int = setting(
        1000,
        'Size of the largest hole that is filled. Points that touch only at a corner belong to different holes.',
        unit='points',
        minimum=1,
        maximum=10000,
    )
    sides: int = setting(
        3,
        'Number of sides (left, right, above, below) on which a point must have a measured rim of its hole to be'
        ' filled. Two of these sides are always opposite, so nothing is extrapolated.',
        minimum=2,
        maximum=4,
    )
    heights_agree: float = setting(
        0.0,
        'Largest difference between the measured heights round a hole that is filled, in the unit of the cloud.'
        ' 0: no limit.',
        unit='cloud',
        minimum=0.0,
    )


@dataclass(frozen=True)
class OutputSettings(Settings):
    """Settings that select what is published beside the filtered cloud."""

    group: ClassVar[str] = 'output'

    mask: bool = setting(True, 'Whether outlier_mask is published with each filtered cloud.')
    score: bool = setting(
        False,
        'Whether outlier_score is published with each filtered cloud: 0 to 1, above 0.5 for outliers. Only the'
        ' adaptive mode computes it.',
    )
    repaired: bool = setting(
        False, 'Whether points_repaired is published: the filtered cloud with the holes of outliers filled.'
    )


def _texture_limit(end: str, name: str) -> float | None:
    sentence = f'{end} {name} of the kept points, in the unit of the cloud. 0: no limit.'
    return setting(None, sentence, unit='cloud', minimum=0.0, empty=0.0)


@dataclass(frozen=True)
class LimitSettings(Settings):
    """Settings that decide whether a measurement passes. Heights are those of the kept points, after levelling."""

    group: ClassVar[str] = 'limits'

    outlier_share_max: float | None = setting(
        None,
        'Largest share of outliers among the measured points with which a measurement passes. 0: no limit.',
        minimum=0.0,
        maximum=1.0,
        empty=0.0,
    )
    measured_share_min: float | None = setting(
        None,
        'Smallest share of measured points among all points with which a measurement passes. 0: no limit.',
        minimum=0.0,
        maximum=1.0,
        empty=0.0,
    )
    sa_min: float | None = _texture_limit('Smallest', 'Sa')
    sa_max: float | None = _texture_limit('Largest', 'Sa')
    sq_min: float | None = _texture_limit('Smallest', 'Sq')
    sq_max: float | None = _texture_limit('Largest', 'Sq')
    sz_min: float | None = _texture_limit('Smallest', 'Sz')
    sz_max: float | None = _texture_limit('Largest', 'Sz')

    @property
    def of_texture(self) -> tuple[tuple[str, float | None, float | None], ...]:
        """Name, smallest and largest value of each parameter of the texture; None: no limit."""
        return (
            ('Sa', self.sa_min, self.sa_max),
            ('Sq', self.sq_min, self.sq_max),
            ('Sz', self.sz_min, self.sz_max),
        )

    @property
    def are_set(self) -> bool:
        """Whether there is a limit."""
        return any(getattr(self, each.name) is not None for each in dataclasses.fields(self))

    def _check_together(self) -> None:
        for each in dataclasses.fields(self):
            if getattr(self, each.name) == 0.0:
                raise SettingError(f'limits.{each.name} must be above 0; use None for no limit.')
        for name, low, high in self.of_texture:
            if low is not None and high is not None and low > high:
                raise SettingError(
                    f'limits.{name.lower()}_min {low:g} is above limits.{name.lower()}_max {high:g}: no surface'
                    ' passes.'
                )


@dataclass(frozen=True)
class MeasurementSettings(Settings):
    """Settings of the rows of measurements that the node writes."""

    group: ClassVar[str] = 'measurements'

    folder: str = setting(
        '',
        'Folder in which the node keeps one row per cloud, in Parquet files. Empty: none are kept.',
        read_only=True,
        of_cell=True,
    )
    cell: str = setting('', 'Name of the cell in the rows. Empty: the namespace of the node.', of_cell=True)
    part: str = setting('', 'Name or number of the part in the rows. Empty: unknown.', of_cell=True)
    period: float = setting(
        60.0,
        'Time after which a batch of rows is written; earlier after 1000 rows. A node that is killed loses at most'
        ' the last batch.',
        unit='s',
        minimum=1.0,
        maximum=3600.0,
        read_only=True,
    )


@dataclass(frozen=True)
class NodeSettings(Settings):
    """Settings of the node itself."""

    autostart: bool = setting(
        True,
        'Whether the node configures and activates itself at start, without a lifecycle manager.',
        read_only=True,
    )
    reprocess_last: bool = setting(
        True,
        'Whether a change of parameters filters and publishes the last cloud again, for tuning while no new cloud'
        ' arrives.',
    )
    parameters_file: str = setting(
        '',
        'File that ~/save_parameters writes; its name ends in .yaml. Empty: a file in ~/.ros/socialcircle that is'
        ' named after the node.',
        read_only=True,
        of_cell=True,
    )
    silence: float = setting(
        5.0,
        'Time without a cloud from a connected publisher after which /diagnostics warns. 0: never.',
        unit='s',
        minimum=0.0,
        maximum=86400.0,
    )

    def _check_together(self) -> None:
        if self.parameters_file and not self.parameters_file.endswith('.yaml'):
            raise SettingError(f'parameters_file must end in .yaml, which {self.parameters_file!r} does not.')


GROUPS: tuple[type[Settings], ...] = (
    CircleSettings,
    FocusSettings,
    StackSettings,
    RepairSettings,
    OutputSettings,
    LimitSettings,
    MeasurementSettings,
    NodeSettings,
)
"""The groups of the node, in the order in which they are shown."""

PARAMETERS: dict[str, Parameter] = {row.name: row for group in GROUPS for row in group.parameters()}
"""Every parameter of the node, by its full name."""

OF_CELL = frozenset(name for name, row in PARAMETERS.items() if row.of_cell)
"""Those that say which cell this is or where its files go: another cell does not take these over with settings."""


AnyPipelineSettings = TypeVar('AnyPipelineSettings', bound='PipelineSettings')
_Groups = dict[str, Any]  # settings of several classes, by the names of their groups


@dataclass(frozen=True)
class PipelineSettings:
    """All settings that clouds and stacks are processed with, live and offline."""

    circle: CircleSettings = dataclasses.field(default_factory=CircleSettings)
    focus: FocusSettings = dataclasses.field(default_factory=FocusSettings)
    stack: StackSettings = dataclasses.field(default_factory=StackSettings)
    repair: RepairSettings = dataclasses.field(default_factory=RepairSettings)
    output: OutputSettings = dataclasses.field(default_factory=OutputSettings)
    limits: LimitSettings = dataclasses.field(default_factory=LimitSettings)

    @classmethod
    def from_ros(cls: type[AnyPipelineSettings], values: Mapping[str, object]) -> AnyPipelineSettings:  # noqa: PYI019 - not in Python 3.10
        """Make settings from values under full ROS names; missing names get their defaults.

        Raises:
            SettingError: A value is not allowed, or values contradict each other.
        """
        groups: _Groups = {each.name: each.default_factory for each in dataclasses.fields(cls)}
        return cls(**{name: group.from_ros(values) for name, group in groups.items()})

    def with_ros(self: AnyPipelineSettings, changes: Mapping[str, object]) -> AnyPipelineSettings:  # noqa: PYI019 - not in Python 3.10
        """These settings with changed values under full ROS names; groups without a change stay the same objects.

        Raises:
            SettingError: As by `from_ros`.
        """
        groups: _Groups = {each.name: getattr(self, each.name) for each in dataclasses.fields(self)}
        changed: _Groups = {
            name: group.with_ros(changes) for name, group in groups.items() if group.fields_of(changes)
        }
        return dataclasses.replace(self, **changed)

    def to_ros(self) -> dict[str, RosValue]:
        """Every parameter under its full name."""
        groups = (getattr(self, each.name) for each in dataclasses.fields(self))
        return {name: value for group in groups for name, value in group.to_ros().items()}
