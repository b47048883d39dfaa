"""Every parameter once: name, type, default, unit, range and sentence; no ROS.

The fields of the frozen dataclasses below are the table. What else needs it (the node's descriptors,
`config/social_circle.yaml`, the README) reads it through `PARAMETERS`, so that nothing is said twice.
A settings object is valid once it exists: making one checks each value, then the values together.
"""

import dataclasses
import json
import math
import operator
import re
import textwrap
import types
import typing
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, TypeVar

from .errors import SettingError

RosValue = bool | int | float | str | list[int]
"""What a ROS parameter can hold, of the kinds that are used here."""

_OWN = 'socialcircle'


@dataclass(frozen=True)
class Limits:
    """What a value may be, beside its type."""

    minimum: float | None = None
    maximum: float | None = None
    odd: bool = False
    choices: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Column:
    """What a dataclass field cannot say by itself."""

    sentence: str
    unit: str
    limits: Limits
    empty: RosValue | None  # what stands for None on ROS's side, where a parameter cannot be None
    read_only: bool


def setting(
    default: Any,
    sentence: str,
    *,
    unit: str = '',
    minimum: float | None = None,
    maximum: float | None = None,
    odd: bool = False,
    choices: tuple[str, ...] = (),
    empty: RosValue | None = None,
    read_only: bool = False,
) -> Any:
    """A row of the table: a dataclass field with its default and all that is to be said of it."""
    column = _Column(sentence, unit, Limits(minimum, maximum, odd, choices), empty, read_only)
    return dataclasses.field(default=default, metadata={_OWN: column})


@dataclass(frozen=True)
class Parameter:
    """One parameter as the outside sees it: ROS, YAML and the README.

    `kind` is the type of `default`, and the type that ROS declares; `default` is on ROS's side,
    where None is written as `empty` (0: chosen).
    """

    group: str
    field: str
    kind: type
    default: RosValue
    unit: str
    limits: Limits
    sentence: str
    read_only: bool
    empty: RosValue | None

    @property
    def name(self) -> str:
        """The full name, `group.field`; without a group the field alone."""
        return f'{self.group}.{self.field}' if self.group else self.field

    @property
    def allowed(self) -> str:
        """In words, which values are accepted."""
        limits = self.limits
        if limits.choices:
            return ', '.join(limits.choices)
        if self.kind is bool:
            return 'true, false'
        if self.kind is list:
            return f'4 whole numbers, at least {limits.minimum:g}'
        words = 'odd, ' if limits.odd else ''
        if limits.minimum is not None and limits.maximum is not None:
            return f'{words}{limits.minimum:g} to {limits.maximum:g}'
        if limits.minimum is not None:
            return f'{words}at least {limits.minimum:g}'
        return words.rstrip(', ') or 'any'

    @property
    def description(self) -> str:
        """Sentence and unit, as ROS's descriptor holds them; `sentence_and_unit` takes them apart."""
        return f'{self.sentence} [{self.unit}]' if self.unit else self.sentence

    def to_ros(self, value: Any) -> RosValue:
        """The Python value as ROS holds it."""
        if value is None:
            if self.empty is None:
                raise SettingError(f'{self.name} needs a value.')
            return self.empty
        ros: RosValue = list(value) if isinstance(value, tuple) else value
        return ros

    def from_ros(self, value: Any) -> Any:
        """The ROS value as Python holds it; `empty` becomes None."""
        if isinstance(value, Sequence) and not isinstance(value, str):
            value = tuple(value)
            return None if self.empty is not None and list(value) == self.empty else value
        is_empty = self.empty is not None and not isinstance(value, bool) and value == self.empty
        return None if is_empty else value


@dataclass(frozen=True)
class Settings:
    """Base of the groups of settings: checks values on creation, converts from and to ROS's side."""

    group: ClassVar[str] = ''

    def __post_init__(self) -> None:
        """Check every value.

        Raises:
            SettingError: a value is of a wrong type or out of its range; says which would do.
        """
        hints = typing.get_type_hints(type(self))
        for field in dataclasses.fields(self):
            column: _Column = field.metadata[_OWN]
            name = f'{self.group}.{field.name}' if self.group else field.name
            value = _checked(name, getattr(self, field.name), hints[field.name], column)
            object.__setattr__(self, field.name, value)
        self._check_together()

    def _check_together(self) -> None:
        """Check what single values cannot tell; groups that have such a rule override this."""

    @classmethod
    def parameters(cls) -> tuple[Parameter, ...]:
        """This group's rows of the table."""
        rows = []
        for field in dataclasses.fields(cls):
            column: _Column = field.metadata[_OWN]
            default: Any = column.empty if field.default is None else field.default
            if default is None:
                raise TypeError(f'{field.name} needs a default or an empty value.')
            rows.append(
                Parameter(
                    group=cls.group,
                    field=field.name,
                    kind=type(default),
                    default=default,
                    unit=column.unit,
                    limits=column.limits,
                    sentence=column.sentence,
                    read_only=column.read_only,
                    empty=column.empty,
                )
            )
        return tuple(rows)

    @classmethod
    def from_ros(cls: type['Self'], values: Mapping[str, Any]) -> 'Self':
        """Settings from full ROS names to values; names of other groups are passed over.

        Raises:
            SettingError: as on creation.
        """
        return cls(**{row.field: row.from_ros(values[row.name]) for row in cls.parameters() if row.name in values})

    def to_ros(self) -> dict[str, RosValue]:
        """These settings under their full ROS names."""
        return {row.name: row.to_ros(getattr(self, row.field)) for row in self.parameters()}


Self = TypeVar('Self', bound=Settings)


def _checked(name: str, value: Any, hint: Any, column: _Column) -> Any:
    """`value` in its exact Python type, or a SettingError that says what would do."""
    options = typing.get_args(hint) if isinstance(hint, types.UnionType) else (hint,)
    if value is None and type(None) in options:
        return None
    kind = next(option for option in options if option is not type(None))
    limits = column.limits
    if typing.get_origin(kind) is Literal:
        if value not in typing.get_args(kind):
            raise SettingError(f'{name} cannot be {value!r}; use one of: {", ".join(typing.get_args(kind))}.')
        return value
    if kind is bool:
        if not isinstance(value, bool):
            raise SettingError(f'{name} must be true or false, not {value!r}.')
        return value
    if kind is str:
        if not isinstance(value, str):
            raise SettingError(f'{name} must be a text, not {value!r}.')
        return value
    if typing.get_origin(kind) is tuple:
        length = len(typing.get_args(kind))
        if isinstance(value, str) or not isinstance(value, Sequence) or len(value) != length:
            raise SettingError(f'{name} must be {length} whole numbers, not {value!r}.')
        return tuple(_whole(name, item, limits) for item in value)
    return _whole(name, value, limits) if kind is int else _real(name, value, limits)


def _whole(name: str, value: Any, limits: Limits) -> int:
    try:
        if isinstance(value, bool):
            raise TypeError  # noqa: TRY301
        number = operator.index(value)
    except TypeError:
        raise SettingError(f'{name} must be a whole number, not {value!r}.') from None
    if limits.odd and number % 2 == 0:
        near = max(number - 1, int(limits.minimum or 1))
        raise SettingError(f'{name} must be odd, not {number}; {near} or {number + 1} would do.')
    return int(_within(name, number, limits))


def _real(name: str, value: Any, limits: Limits) -> float:
    try:
        if isinstance(value, (bool, str)):
            raise TypeError  # noqa: TRY301
        number = float(value)
    except (TypeError, ValueError):
        raise SettingError(f'{name} must be a number, not {value!r}.') from None
    if not math.isfinite(number):
        raise SettingError(f'{name} must be a finite number, not {number}.')
    return _within(name, number, limits)


def _within(name: str, number: float, limits: Limits) -> float:
    too_low = limits.minimum is not None and number < limits.minimum
    too_high = limits.maximum is not None and number > limits.maximum
    if too_low or too_high:
        allowed = (
            f'at least {limits.minimum:g}'
            if limits.maximum is None
            else f'between {limits.minimum or 0:g} and {limits.maximum:g}'
        )
        raise SettingError(f'{name} is {number:g}, which is out of range: it must be {allowed}.')
    return number


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


@dataclass(frozen=True)
class RadiusSettings(Settings):
    """The radius filter that the paper compares with (section 4.1)."""

    window: int = setting(
        5,
        'Side of the search window in which neighbours are counted.',
        unit='points',
        minimum=3,
        maximum=15,
        odd=True,
    )
    radius: float | None = setting(
        None,
        'Radius within which a point counts as a neighbour, in the unit of the cloud; 0: 2.5 times the pitch.',
        unit='cloud',
        minimum=0.0,
        empty=0.0,
    )
    min_neighbours: int = setting(
        10,
        'Measured points that the window must hold within the radius, the point itself not counted.',
        unit='points',
        minimum=1,
        maximum=224,
    )

    def _check_together(self) -> None:
        if self.radius == 0.0:
            raise SettingError('radius must be above 0; None takes 2.5 times the pitch.')
        _check_neighbours('min_neighbours', self.min_neighbours, self.window)


@dataclass(frozen=True)
class StatisticalSettings(Settings):
    """The statistical filter that the paper compares with (section 4.1); defaults as in Open3D's pages."""

    window: int = setting(
        5,
        'Side of the search window in which neighbours are sought.',
        unit='points',
        minimum=3,
        maximum=15,
        odd=True,
    )
    neighbours: int = setting(
        20,
        'Nearest measured points of the window whose mean distance is taken.',
        unit='points',
        minimum=1,
        maximum=224,
    )
    std_factor: float = setting(
        2.0,
        'A point is an outlier above the mean plus this many standard deviations of all mean distances.',
        minimum=-10.0,
        maximum=100.0,
    )

    def _check_together(self) -> None:
        _check_neighbours('neighbours', self.neighbours, self.window)


def _check_neighbours(name: str, neighbours: int, window: int) -> None:
    most = window * window - 1
    if neighbours > most:
        raise SettingError(
            f'{name} is {neighbours}, but a window of {window}×{window} points holds {most} neighbours;'
            f' use at most {most}, or a larger window.'
        )


@dataclass(frozen=True)
class MedianSettings(Settings):
    """The residual to a median window: the baseline that the paper does not have."""

    window: int = setting(
        11, 'Side of the window whose median height is taken.', unit='points', minimum=3, maximum=31, odd=True
    )
    threshold: float | None = setting(
        None,
        'Height above or below the median from which on a point is an outlier, in the unit of the cloud; 0:'
        ' as sigmas says.',
        unit='cloud',
        minimum=0.0,
        empty=0.0,
    )
    sigmas: float = setting(
        5.0,
        'Threshold in robust standard deviations (1.4826 times the median residual), where none is given.',
        minimum=0.01,
        maximum=1000.0,
    )

    def _check_together(self) -> None:
        if self.threshold == 0.0:
            raise SettingError('threshold must be above 0; None has it found from the residuals.')


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


def sentence_and_unit(description: str) -> tuple[str, str]:
    """The sentence and the unit of `Parameter.description`; a description without a unit gives ''."""
    match = re.fullmatch(r'(.*) \[([^\[\]]+)\]', description, re.DOTALL)
    return (match[1], match[2]) if match else (description, '')


AnyJob = TypeVar('AnyJob', bound='Job')


@dataclass(frozen=True)
class Job:
    """With what clouds and stacks are filtered, live and offline."""

    circle: CircleSettings = dataclasses.field(default_factory=CircleSettings)
    focus: FocusSettings = dataclasses.field(default_factory=FocusSettings)
    stack: StackSettings = dataclasses.field(default_factory=StackSettings)
    repair: RepairSettings = dataclasses.field(default_factory=RepairSettings)
    output: OutputSettings = dataclasses.field(default_factory=OutputSettings)

    @classmethod
    def from_ros(cls: type[AnyJob], values: Mapping[str, Any]) -> AnyJob:  # noqa: PYI019 - not in Python 3.10
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


def choices_in(allowed: str) -> tuple[str, ...]:
    """The choices of a text that `Parameter.allowed` lists; none where any text is allowed."""
    return () if allowed in ('any', '') else tuple(allowed.split(', '))


def yaml_text(values: Mapping[str, RosValue], *, whole: bool = True) -> str:
    """A parameter file that a node starts from, each parameter of the table under its sentence.

    It applies to a node of any name in any namespace.

    Args:
        values: full names to values; names beyond the table are passed over.
        whole: whether the parameters that are not among them follow at their defaults.
    """
    lines = ['/**:', '  ros__parameters:']
    for name, row in PARAMETERS.items():
        if not whole and name not in values:
            continue
        unit = f' [{row.unit}]' if row.unit else ''
        comment = f'{row.sentence} Allowed: {row.allowed}.{unit}'
        lines += textwrap.wrap(comment, 100, initial_indent='    # ', subsequent_indent='    # ')
        lines += [f'    {name}: {_yaml_value(values.get(name, row.default))}', '']
    return '\n'.join(lines).rstrip() + '\n'


def markdown_table() -> str:
    """The table of parameters for the README."""
    lines = ['| parameter | default | allowed | unit | |', '|---|---|---|---|---|']
    for name, row in PARAMETERS.items():
        cells = (f'`{name}`', f'`{_yaml_value(row.default)}`', row.allowed, row.unit, row.sentence)
        lines.append('| ' + ' | '.join(cell.replace('|', '/') for cell in cells) + ' |')
    return '\n'.join(lines) + '\n'


def _yaml_value(value: RosValue) -> str:
    """One value as YAML; a float keeps its point, without which YAML 1.1 takes 1e-12 for a text."""
    return re.sub(r'^(-?\d+)e', r'\1.0e', json.dumps(value))
