# SPDX-License-Identifier: Apache-2.0
"""Whether a terminal belongs to this process."""

import os


def is_in_foreground(terminal: int) -> bool:
    """Whether this process runs in the foreground of a terminal. If not, keys and screen are for other programs.

    Args:
        terminal: its file descriptor. One that does not control this process leaves it alone, which counts as the
            foreground.
    """
    try:
        return os.tcgetpgrp(terminal) == os.getpgrp()
    except OSError:
        return True
