"""Every error that this package raises on purpose.

Each message is one sentence (or two) for the engineer at the cell: what was met, and what to do.
"""


class SocialCircleError(Exception):
    """Base of every error of this package."""


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
