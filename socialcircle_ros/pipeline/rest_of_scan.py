# SPDX-License-Identifier: Apache-2.0
"""The rest of a scan of which the stack was given up, where z is counted from frame to frame.

Its frames begin no stack: they would be counted from `stack.z_start`, where the stage is not.
"""

from dataclasses import dataclass

PAUSE_PERIODS = 8
"""Time between two frames, in periods, after which they may be of two scans."""


@dataclass
class RestOfScan:
    """Which frames still belong to a scan, by their stamps.

    Attributes:
        first: stamp of the first frame of the scan, ns.
        last: stamp of its last frame so far, ns.
        period: of the frames, ns; 0: unknown, so that no frame can be told from those of the next scan.
        frames: of a scan; 0: unknown.
    """

    first: int
    last: int
    period: int
    frames: int

    def takes(self, stamp: int) -> bool:
        """Whether a frame belongs to the scan; it is its last one then."""
        if self.period <= 0 or stamp <= self.first:  # a replay that begins again
            return False
        if stamp - self.last >= PAUSE_PERIODS * self.period:
            return False
        if self.frames and stamp - self.first > (self.frames - 0.5) * self.period:
            return False
        self.last = stamp
        return True
