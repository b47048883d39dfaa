# SPDX-License-Identifier: Apache-2.0
"""Reads ROS parameter files for one node, by the rules of ROS (`rcl_rules`)."""

import warnings
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import cast

from socialcircle_ros.errors import ParameterFileWarning, SettingError, SocialCircleError

from .groups import GROUPS, OF_CELL, PARAMETERS
from .rcl_rules import ParameterSection, RclError, parameters_of, read_sections
from .schema import RosValue

_LARGEST = 16 * 2**20  # bytes


def read_parameter_file(
    path: Path, node: str, namespaces: Callable[[], Iterable[str]] = tuple
) -> dict[str, RosValue]:
    """Read the parameters that a node would get from a file.

    Sections of other nodes are passed over, and of the matching ones the last has the last word, as in ROS. A name
    without a namespace stands for the node in `namespaces`. Where there are none, or the file has nothing for this
    node, it stands for the one in whichever namespace the file has it; a `ParameterFileWarning` tells the latter.

    Args:
        path: A ROS parameter file.
        node: `social_circle`, or a full name such as `/cell1/social_circle`.
        namespaces: Called for a name without a namespace: the namespaces in which the node would be.

    Returns:
        Values under dotted names, some of which may be no parameters of ours.

    Raises:
        SocialCircleError: The file cannot be read.
        SettingError: A node would not start with the file or with a value in it, it has no parameters for the
            node, or it has different ones for the node in several namespaces.
    """
    try:
        with path.open('rb') as file:
            content = file.read(_LARGEST + 1)
    except OSError as error:
        raise SocialCircleError(f'{path} cannot be read: {error.strerror}.') from None
    if len(content) > _LARGEST:
        raise SettingError(f'{path} is too large for a parameter file: give another file.')
    try:
        sections = read_sections(content)
    except RclError as error:
        raise SettingError(
            f'{path} is not a parameter file of ROS, because {error}; see config/social_circle.yaml for the form.'
        ) from None
    full_name = node if node.startswith('/') else _full_name(path, sections, node, namespaces)
    values = parameters_of(sections, full_name)
    if not values:
        raise _nothing_for(path, sections, full_name)
    for name, value in values.items():
        if value is None and name in PARAMETERS:
            raise SettingError(f'{path} has no value for {name}: give one, or remove the line.')
    try:
        for group in GROUPS:
            group.check_each(values)
    except SettingError as error:
        raise SettingError(f'{path}: {error}') from None
    return cast('dict[str, RosValue]', values)


def _full_name(
    path: Path, sections: Sequence[ParameterSection], node: str, namespaces: Callable[[], Iterable[str]]
) -> str:
    """The full name of the node that the file means.

    Raises:
        SettingError: it means several that get different parameters.
    """
    ours = [pattern for pattern, _ in sections if pattern.rpartition('/')[2] in (node, '*', '**')]
    named = [pattern for pattern in ours if '*' not in pattern]
    in_namespace = [pattern for pattern in ours if pattern.rpartition('/')[0].strip('/*')]
    wanted = [f'{namespace.rstrip("/")}/{node}' for namespace in namespaces()]
    # A section for all nodes beside one for a certain node does not make the file one for two nodes.
    there = [_example(pattern, node) for pattern in named or in_namespace or ours]
    fits = not there or any(parameters_of(sections, name) for name in wanted)
    meant = list(dict.fromkeys(wanted if wanted and fits else there)) or [f'/{node}']
    if any(_measuring(sections, name) != _measuring(sections, meant[0]) for name in meant):
        raise SettingError(
            f'{path} has different parameters for {" and ".join(meant)}: choose with --node, such as'
            f' --node {meant[0]}.'
        )
    if wanted and not fits:
        warnings.warn(
            f'{path} holds no parameters for {wanted[0]}, the node in the recorded namespace: those for {meant[0]}'
            ' are taken.',
            ParameterFileWarning,
            stacklevel=2,
        )
    return meant[0]


def _measuring(sections: Sequence[ParameterSection], node: str) -> dict[str, object]:
    """What a node gets, without what it has for itself: `~/save_parameters` writes that for one node alone."""
    values = parameters_of(sections, node).items()
    return {name: value for name, value in values if name in PARAMETERS and name not in OF_CELL}


def _example(pattern: str, node: str) -> str:
    """The name of a node that matches a pattern; one named `node` if there is one."""
    above, _, last = pattern.rpartition('/')
    namespace = ''.join(f'/{"any" if part == "*" else part}' for part in above.split('/')[1:] if part != '**')
    return f'{namespace}/{node if "*" in last else last}'


def _nothing_for(path: Path, sections: Sequence[ParameterSection], node: str) -> SettingError:
    if not any(values for _, values in sections):
        return SettingError(f'{path} holds no ros__parameters; see config/social_circle.yaml for the form.')
    names = ', '.join(dict.fromkeys(pattern for pattern, _ in sections))
    return SettingError(
        f'{path} holds no parameters for {node}, only for {names}: name one of these with --node, or give another'
        ' file.'
    )
