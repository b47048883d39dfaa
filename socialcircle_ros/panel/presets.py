# SPDX-License-Identifier: Apache-2.0
"""Presets: named settings, each in a parameter file from which a node can also start; and lessons beside them."""

import itertools
import os
import re
from collections.abc import Mapping
from pathlib import Path

from socialcircle_ros.errors import SettingError, SocialCircleError
from socialcircle_ros.interface import NODE_NAME
from socialcircle_ros.settings import OF_CELL, RosValue, yaml_text
from socialcircle_ros.settings.files import read_parameter_file
from socialcircle_ros.storage import write_file

_NAME = re.compile(r'\w[\w .+-]{0,99}')


class Presets:
    """A folder of presets; the name of a file is the name of its preset.

    A preset says how parts are measured. Which cell a node is and where its files go is neither saved nor loaded:
    the same preset serves several cells.

    Args:
        folder: created when the first preset is saved.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def names(self) -> list[str]:
        """The names of all presets, sorted; files with names that no preset can have are left out."""
        found = (path.stem for path in self.folder.glob('*.yaml') if path.is_file())
        return sorted(name for name in found if _NAME.fullmatch(name))

    def save(self, name: str, values: Mapping[str, RosValue]) -> Path:
        """Write a preset; one of the same name is replaced.

        Returns:
            Its file.

        Raises:
            SettingError: the name is not suitable for a file.
            SocialCircleError: the file cannot be written.
        """
        path = self._path(name)
        text = yaml_text(_measuring(values), whole=False)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise SocialCircleError(f'{path} cannot be written: {error.strerror}.') from None
        write_file(path, text)
        return path

    def load(self, name: str) -> dict[str, RosValue]:
        """Read the values of a preset.

        Raises:
            SocialCircleError: there is no such preset, or its file is no parameter file.
        """
        path = self._path(name)
        if path.exists() and not path.is_file():
            raise SocialCircleError(f'{path} cannot be read: it is not a regular file.')
        return _measuring(read_parameter_file(path, NODE_NAME))

    def free_lesson(self, name: str) -> Path:
        """A file for a lesson: of this name, with a number if there is one already.

        A node reads a lesson when `circle.lesson` is set, and the page does not set what is set already. So none
        is replaced: the node would go on with the old one.

        Raises:
            SettingError: the name is not suitable for a file.
        """
        path = self._path(name).with_suffix('.teach')
        for number in itertools.count(2):
            if not path.exists():
                break
            path = path.with_name(f'{self._path(name).stem}-{number}.teach')
        return path

    def _path(self, name: str) -> Path:
        if not _NAME.fullmatch(name):
            raise SettingError(
                f'{name!r} cannot be the name of a preset; begin with a letter or a digit, and use letters,'
                ' digits, spaces and - _ . + only.'
            )
        return self.folder / f'{name}.yaml'


def _measuring(values: Mapping[str, RosValue]) -> dict[str, RosValue]:
    """Without what is of one cell, and without the parameters of ROS, which a file that a node has saved holds."""
    of_ros = ('qos_overrides.', 'use_sim_time')
    return {name: value for name, value in values.items() if name not in OF_CELL and not name.startswith(of_ros)}


def default_folder() -> Path:
    """The default folder of the presets: beside the files that ~/save_parameters writes."""
    return Path(os.environ.get('ROS_HOME') or Path.home() / '.ros') / 'socialcircle' / 'presets'
