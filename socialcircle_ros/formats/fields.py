# SPDX-License-Identifier: Apache-2.0
"""Fields, the values of each point beside its coordinates: their check, and their types and names in a file."""

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from socialcircle_ros.cloud import is_exact, unmasked
from socialcircle_ros.errors import CloudError

PointValues = NDArray[np.generic]
"""One value for each point, (rows, columns), of any type."""


@dataclass(frozen=True, eq=False)
class HeldValues:
    """Values in types that a PointCloud2, PLY and PCD hold.

    Attributes:
        by_name: the same values; those that no type holds are split in two.
        note: what was not kept as it stands, in one sentence; empty: nothing.
    """

    by_name: dict[str, PointValues]
    note: str = ''


@dataclass(frozen=True, eq=False)
class FileFields:
    """Fields as a file holds them.

    Attributes:
        by_name: (rows, columns) each, by names that the format allows, in types that every format holds.
        notes: one sentence for each field that has another name or form.
    """

    by_name: dict[str, PointValues]
    notes: tuple[str, ...]


def checked_fields(fields: Mapping[str, ArrayLike], shape: tuple[int, int]) -> dict[str, PointValues]:
    """The fields as arrays; what a masked array masks becomes NaN.

    Args:
        fields: numbers or bool by name.
        shape: of the cloud.

    Raises:
        CloudError: a field has another shape or no numbers, or a name that is no text.
    """
    if not isinstance(fields, Mapping):
        raise CloudError(f'The fields are arrays by their names, as a dict, not {type(fields).__name__}.')
    checked = {}
    for name, given in fields.items():
        if not isinstance(name, str):
            raise CloudError(f'The field {name!r} has a name that is no text: name it with one.')
        try:
            values = unmasked(given)
        except ValueError as error:
            reason = str(error) if isinstance(error, CloudError) else 'Its rows differ in their lengths.'
            raise CloudError(f'The field {name!r} cannot be used. {reason}') from None
        if values.shape != shape:
            raise CloudError(f'The field {name!r} has the shape {values.shape}; the points have {shape}.')
        if values.dtype.kind not in 'biuf':
            raise CloudError(f'The field {name!r} has {values.dtype}; a field holds one number for each point.')
        checked[name] = values
    return checked


def held_values(name: str, values: PointValues) -> HeldValues:
    """The values of a field in a type that a PointCloud2 holds, without loss where there is one.

    Args:
        name: of the field, for the note.
        values: numbers or bool.

    Returns:
        Values in native byte order: uint8 for bool, float32 for half floats, float64 for whole numbers of 64 bits
        that it holds. Other numbers of 64 bits are split into their upper and lower half.
    """
    kind, size = values.dtype.kind, values.dtype.itemsize
    if kind == 'b':
        return HeldValues({name: values.astype(np.uint8)})
    if kind in 'iu' and size <= 4:
        return HeldValues({name: values.astype(f'{kind}{size}')})
    if kind == 'f' and size <= 4:
        return HeldValues({name: values.astype(np.float32)})
    with np.errstate(over='ignore'):
        real = values.astype(np.float64)
    if is_exact(real, values):
        return HeldValues({name: real})
    if kind == 'f':
        return HeldValues({name: real}, f'{name} has {8 * size} bits, of which 64 are kept')
    halves: dict[str, PointValues] = {
        f'{name}_high': (values >> np.asarray(32, values.dtype)).astype(f'{kind}4'),
        f'{name}_low': (values & np.asarray(0xFFFFFFFF, values.dtype)).astype(np.uint32),
    }
    note = f'{name} has 64-bit whole numbers, which no field holds: it becomes {name}_high · 2³² + {name}_low'
    return HeldValues(halves, note)


def fields_for_file(
    fields: Mapping[str, PointValues], reserved: Collection[str], allowed: Callable[[str], bool]
) -> FileFields:
    """The fields with names and types that a format holds.

    Whole numbers of 64 bits, such as labels have them, become those of 32 bits where these hold all of them.

    Args:
        fields: as `checked_fields` gives them.
        reserved: names that the format uses itself.
        allowed: whether a name may have a character; others become _. A name needs one that is not _, because a
            field with the name _ is padding in PCD.
    """
    held: dict[str, PointValues] = {}
    notes = []
    for name, values in fields.items():
        found = held_values(name, _shortened(values))
        if found.note:
            notes.append(f'The field {found.note}.')
        for part, numbers in found.by_name.items():
            free = name if part == name else free_name(part, {*held, *fields})
            if free != part:
                notes.append(f'The field {part} becomes {free}, because there is one with its name.')
            held[free] = numbers
    names = _file_names(held, reserved, allowed)
    notes.extend(f'The field {name!r} is named {new} in the file.' for name, new in names.items() if new != name)
    return FileFields({names[name]: values for name, values in held.items()}, tuple(notes))


def free_name(name: str, taken: Collection[str]) -> str:
    """The name, with a number if it is taken."""
    free, number = name, 1
    while free in taken:
        number += 1
        free = f'{name}_{number}'
    return free


def _shortened(values: PointValues) -> PointValues:
    """Whole numbers of 64 bits in 32 bits with the same sign, if these hold them all; other values as they are."""
    kind = values.dtype.kind
    if kind not in 'iu' or values.dtype.itemsize <= 4 or not values.size:
        return values
    limits = np.iinfo(f'{kind}4')
    fits = limits.min <= int(values.min()) and int(values.max()) <= limits.max
    return values.astype(f'{kind}4') if fits else values


def _file_names(names: Iterable[str], reserved: Collection[str], allowed: Callable[[str], bool]) -> dict[str, str]:
    """The name in the file for each name; one that the format allows as it is stays, whatever others become."""
    plain = {}
    for name in names:
        changed = ''.join(sign if allowed(sign) else '_' for sign in name)
        plain[name] = changed if changed.strip('_') else 'field'
    found = {name: name for name in plain if plain[name] == name and name not in reserved}
    for name, wanted in plain.items():
        if name not in found:
            found[name] = free_name(wanted, {*reserved, *found.values()})
    return found
