# SPDX-License-Identifier: Apache-2.0
"""What the names of recordings mean: a file or a directory, and where the parameters of their stacks lie."""

from pathlib import Path

from socialcircle_ros.errors import RecordingError
from socialcircle_ros.storage import has_suffix_of_file

SUFFIX = '.mcap'


def is_mcap_name(path: Path) -> bool:
    """Whether a new recording with this name is an MCAP file; else it is a rosbag2 directory.

    Raises:
        RecordingError: the name looks like that of another file, and is not that of a directory that is there.
    """
    if path.suffix.lower() == SUFFIX:
        return True
    if has_suffix_of_file(path) and not path.is_dir():
        raise RecordingError(
            f'{path} cannot be a recording, because it ends in {path.suffix}: give a name that ends in {SUFFIX}'
            ' for a file, or one without a suffix for a directory.'
        )
    return False


def parameters_beside(recording: Path) -> Path:
    """The parameter file that `import` and `simulate` write beside the recording of a focus stack."""
    whole = recording.absolute()
    name = whole.stem if whole.suffix.lower() == SUFFIX else whole.name
    return recording.parent / f'{name}.yaml'
