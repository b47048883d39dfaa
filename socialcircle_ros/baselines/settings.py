# SPDX-License-Identifier: Apache-2.0
"""Settings of the baselines. The node has no parameters for them."""

from dataclasses import dataclass

from socialcircle_ros.errors import SettingError
from socialcircle_ros.settings.schema import Settings, setting


@dataclass(frozen=True)
class RadiusSettings(Settings):
    """Settings of the radius filter (section 4.1 of the paper)."""

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
        'Distance within which a point counts as a neighbour, in the unit of the cloud. 0: 2.5 times the pitch.',
        unit='cloud',
        minimum=0.0,
        empty=0.0,
    )
    min_neighbours: int = setting(
        10,
        'Smallest number of neighbours of an inlier, without the point itself.',
        unit='points',
        minimum=1,
        maximum=224,
    )

    def _check_together(self) -> None:
        if self.radius == 0.0:
            raise SettingError('radius must be above 0; use None for 2.5 times the pitch.')
        _check_neighbours('min_neighbours', self.min_neighbours, self.window)


@dataclass(frozen=True)
class StatisticalSettings(Settings):
    """Settings of the statistical filter (section 4.1 of the paper); the defaults are those of Open3D."""

    window: int = setting(
        5,
        'Side of the search window for neighbours.',
        unit='points',
        minimum=3,
        maximum=15,
        odd=True,
    )
    neighbours: int = setting(
        20,
        'Number of nearest measured points of the window; their mean distance is compared.',
        unit='points',
        minimum=1,
        maximum=224,
    )
    std_factor: float = setting(
        2.0,
        'Threshold: the mean of all mean distances plus this many of their standard deviations.',
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
    """Settings of the median residual filter, which is not in the paper."""

    window: int = setting(
        11, 'Side of the window of the median height.', unit='points', minimum=3, maximum=31, odd=True
    )
    threshold: float | None = setting(
        None,
        'Distance from the median beyond which a height is an outlier, in the unit of the cloud. 0: found from'
        ' sigmas.',
        unit='cloud',
        minimum=0.0,
        empty=0.0,
    )
    sigmas: float = setting(
        5.0,
        'Threshold in robust standard deviations (1.4826 times the median residual), if no threshold is set.',
        minimum=0.01,
        maximum=1000.0,
    )

    def _check_together(self) -> None:
        if self.threshold == 0.0:
            raise SettingError('threshold must be above 0; use None to find it from the residuals.')
