"""Every error that this package raises on purpose.

Each message is one sentence (or two) for the engineer at the cell: what was met, and what to do.
"""


class SocialCircleError(Exception):
    """Base of every error of this package.

    What a message quotes from outside may hold bytes that are no text; they are shown as escapes, so that
    every message can be logged and published.
    """

    def __init__(self, message: str) -> None:
        super().__init__(printable(message))


def printable(text: str) -> str:
    """The text with what cannot be written as UTF-8 shown as escapes."""
    return text.encode('utf-8', 'backslashreplace').decode()


class SettingError(SocialCircleError, ValueError):
    """A parameter has a value that it cannot have; the message says which values would do."""


class CloudError(SocialCircleError, ValueError):
    """A point cloud cannot be used as it is: its shape, its data type, or nothing in it is measured."""


class NoSeedError(CloudError):
    """The vote region holds no measured point, so that no seed can be elected."""


class NoRadiusError(CloudError):
    """The ring round the seed holds no measured point, so that eq. 7 gives no radius."""


class MessageError(SocialCircleError, ValueError):
    """A ROS message contradicts itself or is not of the kind that is needed here."""


class RecordingError(SocialCircleError):
    """A recording cannot be read, or cannot be written; the message names the file."""


class ImportFileError(SocialCircleError):
    """A file that is to become a recording cannot be used; the message names the file."""


class StackError(SocialCircleError, ValueError):
    """A frame cannot join the focus stack, or the stack is not enough to measure from."""
