"""Presets: named settings in files that a node starts from."""

import os
import re
from collections.abc import Mapping
from pathlib import Path

from socialcircle_ros.errors import SettingError, SocialCircleError
from socialcircle_ros.settings import RosValue, yaml_text
from socialcircle_ros.settings.files import read_parameter_file


class Presets:
    """A folder of parameter files, each a preset of its name.

    Args:
        folder: made when the first preset is saved.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def names(self) -> list[str]:
        """Every preset, by name."""
        return sorted(path.stem for path in self.folder.glob('*.yaml') if path.is_file())

    def save(self, name: str, values: Mapping[str, RosValue]) -> Path:
        """Write a preset, over one of the same name.

        Raises:
            SettingError: the name is not one of a file.
            SocialCircleError: the file cannot be written.
        """
        path = self._path(name)
        partial = path.with_name(path.name + '.partial')
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            partial.write_text(yaml_text(values, whole=False), encoding='utf-8')
            partial.replace(path)
        except OSError as error:
            raise SocialCircleError(f'{path} cannot be written: {error.strerror}.') from None
        return path

    def load(self, name: str) -> dict[str, RosValue]:
        """The values of a preset.

        Raises:
            SocialCircleError: there is no such preset, or its file makes no sense.
        """
        return read_parameter_file(self._path(name))

    def _path(self, name: str) -> Path:
        if not re.fullmatch(r'\w[\w .+-]{0,99}', name):
            raise SettingError(
                f'{name!r} cannot be the name of a preset; begin with a letter or a digit, and use letters,'
                ' digits, spaces and - _ . + only.'
            )
        return self.folder / f'{name}.yaml'


def default_folder() -> Path:
    """Where presets are kept unless told otherwise: beside what ~/save_parameters writes."""
    return Path(os.environ.get('ROS_HOME') or Path.home() / '.ros') / 'socialcircle' / 'presets'
