# SPDX-License-Identifier: Apache-2.0
"""sensor_msgs/JointState: positions of the stage."""

from collections.abc import Sequence
from dataclasses import dataclass

from .cdr import CdrReader, CdrWriter
from .header import Header

TYPE = 'sensor_msgs/msg/JointState'

_MIN_STRING_SIZE = 4  # bytes of the length


@dataclass(frozen=True)
class JointState:
    """Positions of joints at one time, without velocities and efforts.

    Attributes:
        header: the time.
        names: of the joints.
        positions: of the joints; those of prismatic joints are in metres (REP 103).
    """

    header: Header
    names: Sequence[str]
    positions: Sequence[float]

    @classmethod
    def decode(cls, message: bytes) -> 'JointState':
        """Read a serialized message.

        Raises:
            MessageError: the message ends early, or is of another type.
        """
        reader = CdrReader(message)
        header = Header.read(reader)
        names = [reader.string() for _ in range(reader.count(_MIN_STRING_SIZE))]
        positions = [reader.float64() for _ in range(reader.count(8))]
        return cls(header, names, positions)

    def encode(self) -> bytes:
        """The serialized message."""
        writer = CdrWriter()
        self.header.write(writer)
        writer.uint32(len(self.names))
        for name in self.names:
            writer.string(name)
        writer.uint32(len(self.positions))
        for position in self.positions:
            writer.float64(position)
        writer.uint32(0)  # velocities
        writer.uint32(0)  # efforts
        return writer.finish()
