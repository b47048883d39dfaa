# SPDX-License-Identifier: Apache-2.0
"""The order of frames, and their z, from the names of their files.

A name such as `part_z-12.5um.png` holds z; `frame007.png` holds the number of the frame. What is not certain is
refused with the option that settles it, and a note says what is taken.
"""

import math
import re
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Literal, NamedTuple

from socialcircle_ros.errors import ImportFileError
from socialcircle_ros.lengths import metres_per

from .reader import natural_order

ZFrom = Literal['auto', 'name', 'order', 'file']
"""Where z comes from: the numbers in names, the order alone, or what a TIFF says; auto: whichever is certain."""

Order = Literal['auto', 'natural', 'name', 'time']
"""How frames are sorted: 9 before 10, as text, or by the times of the files; auto: natural, given numbers."""

# Few units: a number before "pm" or "in" is more likely a time of day or a part of a sentence.
_NUMBER = re.compile(r'(\d+(?:[.,]\d+)?)(?:[ _]?(nm|um|µm|μm|micron|mm|cm|m)(?![A-Za-z]))?', re.IGNORECASE)
_SIGNS = '+-−'
# Before a number that is z and not the number of a frame.
_Z = re.compile(r'(?:^|[^a-z])(?:z|zpos|zposition|z[ _-]pos(?:ition)?|height)[ _=:.-]*$', re.IGNORECASE)
_EVEN = 0.01  # of a step
_MOST_STRAYS = 0.25  # of the frames; more files with other names are another stack


@dataclass(frozen=True)
class NamedFrames:
    """Frames in the order of their z.

    Attributes:
        files: in order.
        z: of each file, in steps or in the numbers of the names; in metres if `in_metres`.
        in_metres: whether the names hold units.
        notes: what was taken or passed over, one sentence each.
    """

    files: list[Path]
    z: list[float]
    in_metres: bool = False
    notes: list[str] = field(default_factory=list)


class _Token(NamedTuple):
    """A number in a name."""

    before: str  # the text before it, without a sign
    sign: str  # a sign or a hyphen
    digits: str
    unit: str

    @property
    def number(self) -> float:
        return float(self.digits.replace(',', '.'))

    @property
    def scale(self) -> float:
        """The unit in metres; 1 if there is none."""
        return metres_per(self.unit) if self.unit else 1.0

    @property
    def is_minus(self) -> bool:
        return self.sign in ('-', '−')

    @property
    def decimals(self) -> int:
        return len(re.split('[.,]', self.digits, maxsplit=1)[1]) if re.search('[.,]', self.digits) else 0


def order_frames(folder: Path, files: Sequence[Path], z_from: ZFrom, order: Order) -> NamedFrames:
    """Sort frames and find their z.

    Args:
        folder: for messages.
        files: at least one.
        z_from: `name`, `order` or `auto`.
        order: `natural`, `name` and `time` are used if z does not come from the names.

    Raises:
        ImportFileError: order or z is not certain.
    """
    if z_from == 'name' and order in ('name', 'time'):
        raise ImportFileError('--z-from name gives the order as well: leave --order out.')
    if z_from == 'order' or order in ('name', 'time'):
        return _in_order(folder, files, order)
    fitting, notes = _fitting(folder, files, order)
    if fitting is None:
        return _in_order(folder, files, order)
    tokens = _tokens_of_frames(folder, fitting)
    signed = _is_signed(folder, tokens, z_from)
    in_names = signed or z_from == 'name' or _holds_z(folder, tokens)
    values = {file: -token.number if signed and token.is_minus else token.number for file, token in tokens.items()}
    places = {file: z * tokens[file].scale for file, z in values.items()}
    ordered = sorted(places, key=lambda file: places[file])
    for one, other in pairwise(ordered):
        if math.isclose(places[one], places[other], rel_tol=1e-9):
            raise ImportFileError(f'{folder} has {one.name} and {other.name} for the same z: move one away.')
    if in_names:
        return _with_z(folder, ordered, places, {token.unit for token in tokens.values()}, notes)
    return _with_numbers(folder, ordered, values, notes)


def _in_order(folder: Path, files: Sequence[Path], order: Order) -> NamedFrames:
    """Frames that are one step apart."""
    if order == 'time':
        times = {file: file.stat().st_mtime_ns for file in files}
        ordered = sorted(files, key=lambda file: times[file])
        if len(set(times.values())) < len(times):
            raise ImportFileError(f'{folder} has files of the same time, so that their order is not known.')
    elif order == 'name':
        ordered = sorted(files, key=lambda file: file.name)
    else:
        ordered = sorted(files, key=natural_order)
    words = {'time': 'the times of the files', 'name': 'the names as text'}.get(order, 'the names')
    note = f'the frames are taken in the order of {words}, one z-step apart'
    return NamedFrames(ordered, [float(place) for place in range(len(ordered))], notes=[note])


def _fitting(
    folder: Path, files: Sequence[Path], order: Order
) -> tuple[dict[Path, list[_Token]] | None, list[str]]:
    """The files with names of the most common form, with the numbers in these; None: they hold none.

    Raises:
        ImportFileError: there are several forms.
    """
    forms: dict[tuple[str, ...], dict[Path, list[_Token]]] = defaultdict(dict)
    for file in files:
        tokens, rest = _tokens(file.stem)
        forms[(*(token.before.lower() for token in tokens), rest.lower())][file] = tokens
    main = max(forms.values(), key=len)
    strays = sorted((file for form in forms.values() if form is not main for file in form), key=natural_order)
    numbered = bool(next(iter(main.values()))) and len(main) >= 3
    if not numbered and order == 'natural':
        return None, []
    if not numbered or len(strays) > _MOST_STRAYS * len(main):
        raise ImportFileError(
            f'{folder} has files without a common pattern of numbers, such as {_listed([*main][:1] + strays[:2])}:'
            ' move away what is no frame, or give --order.'
        )
    return main, [f'{file.name} is passed over, because its name does not fit the others' for file in strays]


def _tokens(stem: str) -> tuple[list[_Token], str]:
    """The numbers in a name, and the text behind the last one."""
    tokens = []
    position = 0
    for match in _NUMBER.finditer(stem):
        before, unit = stem[position : match.start()], (match[2] or '').lower()
        position = match.end()
        if unit == 'm' and not _Z.search(before):  # more likely a word than metres
            unit, position = '', match.end(1)
        sign = before[-1:] if before[-1:] and before[-1] in _SIGNS else ''
        tokens.append(_Token(before.removesuffix(sign) if sign else before, sign, match[1], unit))
    return tokens, stem[position:]


def _tokens_of_frames(folder: Path, frames: dict[Path, list[_Token]]) -> dict[Path, _Token]:
    """The number in each name that differs from frame to frame.

    Raises:
        ImportFileError: several do, and none is for certain that of the frame.
    """
    columns = list(zip(*frames.values(), strict=True))
    varying = [column for column in columns if len({token[1:] for token in column}) > 1]
    marked = [column for column in varying if _Z.search(column[0].before)]
    with_unit = [column for column in varying if any(token.unit for token in column)]
    found = marked or with_unit or varying
    if len(found) > 1 and found is varying:
        # A number that counts frames, beside others that change as well, such as times.
        found = [column for column in varying if _step(sorted(token.number for token in column))]
    if len(found) != 1:
        raise ImportFileError(
            f'{folder} has names with {len(varying) or "no"} numbers that differ, such as'
            f' {_listed([*frames][:2])}, so that z is not known: give --z-from order if the frames are evenly'
            ' spaced.'
        )
    return dict(zip(frames, found[0], strict=True))


def _is_signed(folder: Path, tokens: dict[Path, _Token], z_from: ZFrom) -> bool:
    """Whether a minus before the numbers is a sign, and not a hyphen.

    Raises:
        ImportFileError: that is not certain.
    """
    minus = [token for token in tokens.values() if token.is_minus]
    if len(minus) < len(tokens) or z_from == 'name':
        return bool(minus)
    if not minus[0].before or minus[0].before[-1] in '_= .':
        return True  # a hyphen follows a word
    if _Z.search(minus[0].before):
        raise ImportFileError(
            f'{folder} has a minus before every z, such as {_listed([*tokens][:2])}, which may be a sign or a'
            ' hyphen: give --z-from name if it is a sign, or --z-from order.'
        )
    return False


def _holds_z(folder: Path, tokens: dict[Path, _Token]) -> bool:
    """Whether numbers are z, and do not only count the frames.

    Raises:
        ImportFileError: that is not certain.
    """
    found = list(tokens.values())
    if _Z.search(found[0].before) or any(token.unit for token in found):
        return True
    decimals = {token.decimals for token in found}
    if len(decimals) > 1:
        raise ImportFileError(
            f'{folder} has names such as {_listed([*tokens][:2])}; their numbers may be decimals or not: give'
            ' --z-from name or --z-from order.'
        )
    return decimals != {0}


def _with_z(
    folder: Path, files: list[Path], places: dict[Path, float], units: set[str], notes: list[str]
) -> NamedFrames:
    """Frames with z in their names.

    Raises:
        ImportFileError: only some have a unit.
    """
    if '' in units and len(units) > 1:
        raise ImportFileError(f'{folder} has names with and without a unit: give --z-from order, or rename them.')
    in_metres = units != {''}
    z = [places[file] for file in files]
    unit = ' and '.join(sorted(units)) if in_metres else 'z-steps'
    notes = [*notes, f'z is the number in the names, in {unit}']
    step = _step(z)
    if step is None:
        notes.append('the frames are not evenly spaced')
    else:
        if not in_metres and not math.isclose(step, 1):
            notes.append(f'neighbouring frames are {step:g} z-steps apart')
        notes += _gaps(files, z, step)
    return NamedFrames(files, z, in_metres, notes)


def _with_numbers(folder: Path, files: list[Path], values: dict[Path, float], notes: list[str]) -> NamedFrames:
    """Frames with numbers that count them; z leaves out the steps of numbers that are missing.

    Raises:
        ImportFileError: the numbers do not count.
    """
    numbers = [values[file] for file in files]
    step = _step(numbers)
    if step is None:
        raise ImportFileError(
            f'{folder} has names with unevenly spaced numbers, such as {_listed(files[:3])}, so that z is not'
            ' known: give --z-from order if the frames are evenly spaced, or --z-from name if the numbers are z.'
        )
    if not math.isclose(step, 1):
        notes = [*notes, f'the frames are numbered in steps of {step:g}, each of which is taken for one z-step']
    z = [round((number - numbers[0]) / step) * 1.0 for number in numbers]
    return NamedFrames(files, z, notes=[*notes, *_gaps(files, numbers, step)])


def _gaps(files: Sequence[Path], numbers: Sequence[float], step: float) -> Iterator[str]:
    """Tell the steps at which there is no frame."""
    for place, (before, after) in enumerate(pairwise(numbers)):
        missing = round((after - before) / step) - 1
        if missing:
            yield (
                f'{missing} frame{"s" * (missing > 1)} missing between {files[place].name} and'
                f' {files[place + 1].name}; z leaves the step{"s" * (missing > 1)} out'
            )


def _step(numbers: Sequence[float]) -> float | None:
    """The difference of neighbouring numbers, if most are this far apart, and the others a multiple.

    Args:
        numbers: ascending, at least 2.
    """
    differences = [after - before for before, after in pairwise(numbers)]
    scale = max(map(abs, numbers)) or 1.0
    counts = Counter(round(difference / scale, 9) for difference in differences)
    most = min(counts, key=lambda rounded: (-counts[rounded], rounded))
    step = next(difference for difference in differences if round(difference / scale, 9) == most)
    if step == 0 or 2 * counts[most] < len(differences) or numbers[-1] - numbers[0] > 2 * step * len(numbers):
        return None
    even = all(abs(difference / step - round(difference / step)) < _EVEN for difference in differences)
    return step if even else None


def _listed(files: Sequence[Path]) -> str:
    return ', '.join(file.name for file in files)
