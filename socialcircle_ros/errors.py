# SPDX-License-Identifier: Apache-2.0
"""The errors that this package raises.

Each message is one or two sentences for the engineer at the cell: what is wrong, and what to do.
"""

_LONGEST_SHOWN = 60  # characters


class SocialCircleError(Exception):
    """Base of every error of this package.

    A message may quote file names or message fields that are not valid UTF-8. Such bytes become escapes, so that
    every message can be logged and published.
    """

    def __init__(self, message: str) -> None:
        super().__init__(printable(message))


def printable(text: str) -> str:
    """The text with escapes in place of characters that cannot be encoded as UTF-8."""
    return text.encode('utf-8', 'backslashreplace').decode()


def shown(value: object) -> str:
    """A value for a sentence: on one line, and not longer than that."""
    try:
        text = ' '.join(repr(value).split())
    except ValueError:  # Python writes no whole number of more than 4300 digits
        return f'a {"number" if isinstance(value, int) else "value"} of thousands of digits'
    return text if len(text) <= _LONGEST_SHOWN else f'{text[:_LONGEST_SHOWN]}…'


def install_command(extra: str) -> str:
    """The command that installs what an extra of this package needs, and that for a checkout.

    The first, such as `pip install "optuna>=4"`, names the requirements, not this package: no index has it, so
    `pip install "socialcircle_ros[...]"` finds nothing. It works for a wheel and a colcon workspace alike.

    Args:
        extra: a key of `extras_require` in setup.py.
    """
    import importlib.metadata  # noqa: PLC0415 - takes time that only this needs

    try:
        requirements = importlib.metadata.requires('socialcircle_ros') or []
    except importlib.metadata.PackageNotFoundError:
        requirements = []
    parts = (requirement.partition(';') for requirement in requirements)
    marker = f'extra == "{extra}"'
    needed = [f'"{name.strip()}"' for name, _, condition in parts if marker in condition.replace("'", '"')]
    # Without metadata, as in a source tree that was only copied, the tree itself can be installed.
    if not needed:
        return f'pip install ".[{extra}]" in the source tree'
    return f'pip install {" ".join(needed)} (in a checkout: pip install -e ".[{extra}]")'


class SettingError(SocialCircleError, ValueError):
    """A parameter has a value that is not allowed; the message says which values are."""


class CloudError(SocialCircleError, ValueError):
    """A point cloud cannot be filtered: wrong shape, wrong data type, or no measured point."""


class NoSeedError(CloudError):
    """The vote region has no measured point, so no seed can be elected."""


class NoRadiusError(CloudError):
    """The ring round the seed has no measured point, so eq. 7 gives no radius."""


class MessageError(SocialCircleError, ValueError):
    """A ROS message contradicts itself, or does not hold what is needed here."""


class RecordingError(SocialCircleError):
    """A recording cannot be read or written; the message names the file."""


class ImportFileError(SocialCircleError):
    """A file cannot be imported; the message names the file."""


class UnitWarning(UserWarning):
    """A measurement file does not state its unit; the message says what is taken."""


class ParameterFileWarning(UserWarning):
    """A parameter file is for a node in another namespace; the message names the node that the values are for."""


class StackError(SocialCircleError, ValueError):
    """A frame does not fit the focus stack, or the stack has too few frames to be measured."""
