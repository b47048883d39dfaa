"""The settings of the baselines; they are no parameters of the node."""

from dataclasses import dataclass

from socialcircle_ros.errors import SettingError
from socialcircle_ros.settings.schema import Settings, setting


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
