# SPDX-License-Identifier: Apache-2.0
"""What the names of recordings mean: a file or a directory, and where the parameters of their stacks lie."""

import re
from pathlib import Path

from socialcircle_ros.errors import RecordingError
from socialcircle_ros.storage import has_suffix_of_file

SUFFIX = '.mcap'

_ENDING = re.compile(r'\.mcap(\.zstd?)?$', re.IGNORECASE)  # a compressed recording keeps its parameters


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
    return recording.parent / f'{_ENDING.sub("", recording.absolute().name)}.yaml'


def found_parameters(recording: Path) -> Path | None:
    """The parameter file beside a recording; None if there is none."""
    beside = parameters_beside(recording)
    return beside if recording.exists() and beside.is_file() else None
