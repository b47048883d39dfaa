# SPDX-License-Identifier: Apache-2.0
"""Lesson files: what `socialcircle teach` learnt about one kind of part, for `circle.lesson`.

A lesson is a small JSON file. How communities are judged by it is in `circle.adaptive.lesson`.
"""

import json
import math
import os
import stat
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from hashlib import blake2b
from typing import Literal, cast, get_args

from socialcircle_ros.errors import SettingError

Judge = Literal['network', 'rules']

TRAITS = (
    'size',
    'above',
    'height',
    'greatest height',
    'roughness',
    'certainty',
    'greatest certainty',
    'share of its square',
    'roughness around',
    'slope around',
    'step at its border',
    'share of its border not measured',
)
"""The traits of a community that a lesson weighs, in the order of its numbers."""

WEIGHTS = (len(TRAITS) + 1) * (len(TRAITS) + 2) // 2
"""One for each trait, one for each product of two, and a constant."""

LESSON_MARK = 'socialcircle_lesson'
"""The first key of a lesson file; its value is the version."""
_VERSION = 2
_LARGEST_FILE = 1_000_000  # bytes; a lesson has about 4,000

_Stamp = tuple[int, int, int]
_known: dict[str, tuple[_Stamp, 'Lesson']] = {}


@dataclass(frozen=True)
class Lesson:
    """What was learnt about one kind of part.

    Attributes:
        taught_on: names of the good clouds.
        spread: least and greatest spread of the good clouds: the surface scale, in their unit.
        judge: what finds the communities that are judged: the rules, or the network.
        least: communities are steeper than this, or their points are more probable.
        mean: of each trait, in the order of `TRAITS`.
        scale: standard deviation of each trait.
        weights: of the constant, the traits, and their products in the order of the upper triangle.
        threshold: a community is an outlier if its probability is at least this.
        check: what the check on the fields kept back measured, by name.
    """

    taught_on: tuple[str, ...]
    spread: tuple[float, float]
    judge: Judge
    least: float
    mean: tuple[float, ...]
    scale: tuple[float, ...]
    weights: tuple[float, ...]
    threshold: float
    check: Mapping[str, float]

    @property
    def digest(self) -> str:
        """16 hexadecimal digits of all of it: another lesson may be taught under the name of its file."""
        return blake2b(self.to_text().encode(), digest_size=8).hexdigest()

    def to_text(self) -> str:
        """The content of a lesson file."""
        return json.dumps({LESSON_MARK: _VERSION, **asdict(self)}, indent=1) + '\n'

    @classmethod
    def from_text(cls, text: str) -> 'Lesson':
        """Read the content of a lesson file.

        Raises:
            ValueError: it is not the content of a lesson; the message says what is wrong.
        """
        found = json.loads(text)
        if not isinstance(found, dict) or found.pop(LESSON_MARK, None) != _VERSION:
            raise ValueError('it is not a lesson of this version')
        spread = _numbers(found, 'spread', 2)
        mean, scale = _numbers(found, 'mean', len(TRAITS)), _numbers(found, 'scale', len(TRAITS))
        weights = _numbers(found, 'weights', WEIGHTS)
        least, threshold = _numbers({'it': [found.get('least'), found.get('threshold')]}, 'it', 2)
        judge = next((one for one in get_args(Judge) if one == found.get('judge')), None)
        names, check = found.get('taught_on'), found.get('check')
        if min(scale) <= 0 or not 0 <= spread[0] <= spread[1]:
            raise ValueError('its scales are not above 0')
        if judge is None:
            raise ValueError('it does not say whether it judges what the rules or the network find')
        if not 0 < threshold < 1:
            raise ValueError('its threshold is not between 0 and 1')
        if not (isinstance(names, list) and isinstance(check, dict)):
            raise ValueError('it does not say what it was taught on')  # noqa: TRY004 - one error for all
        values = _numbers({'check': list(check.values())}, 'check', len(check))
        checked = dict(zip(map(str, check), values, strict=True))
        taught_on = tuple(map(str, names))
        return cls(taught_on, (spread[0], spread[1]), judge, least, mean, scale, weights, threshold, checked)


def read_lesson(path: str) -> Lesson:
    """Read a lesson file, unless it was read before and has not changed since.

    Raises:
        SettingError: the file cannot be read, or it is not a lesson.
    """
    try:
        # A pipe without a writer would hold up the node for good, and a device such as /dev/zero has no end.
        with open(path, 'rb', opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK)) as file:
            found = os.fstat(file.fileno())
            stamp = (found.st_mtime_ns, found.st_size, found.st_ino)
            if path in _known and _known[path][0] == stamp:
                return _known[path][1]
            if not stat.S_ISREG(found.st_mode):
                raise ValueError('it is not a file')  # noqa: TRY301 - one message for all
            content = file.read(_LARGEST_FILE + 1)
        if len(content) > _LARGEST_FILE:
            raise ValueError('it is too large')  # noqa: TRY301 - one message for all
        lesson = Lesson.from_text(content.decode('utf-8'))
    except (OSError, ValueError, RecursionError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise SettingError(
            f'circle.lesson: {path} cannot be used ({reason}); give a file that `socialcircle teach` wrote on this'
            ' machine, or an empty text for no lesson.'
        ) from None
    _known[path] = stamp, lesson
    return lesson


def finder(lesson: Lesson | None, judge: Judge, *, has_depth_of_field: bool) -> Judge:
    """What finds the outliers in the adaptive mode: a lesson uses what it was taught with.

    Args:
        lesson: None: none is used.
        judge: what is asked for.
        has_depth_of_field: whether it is known. Outliers that optics make look like a smooth surface: the network
            does not see them, the rules do.
    """
    if lesson is not None:
        return lesson.judge
    return 'rules' if has_depth_of_field else judge


def _numbers(found: Mapping[str, object], name: str, count: int) -> tuple[float, ...]:
    values = found.get(name)
    if not isinstance(values, Sequence) or len(values) != count:
        raise ValueError(f'its {name} are not {count} numbers')
    numbers = tuple(
        float(cast('float', value))
        for value in values
        if isinstance(value, (int, float)) and not isinstance(value, bool)
    )
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        raise ValueError(f'its {name} are not {count} finite numbers')
    return numbers
