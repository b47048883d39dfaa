# SPDX-License-Identifier: Apache-2.0
"""diagnostic_msgs/DiagnosticStatus."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from .cdr import CdrReader, CdrWriter

TYPE = 'diagnostic_msgs/msg/DiagnosticStatus'

OK, WARN, ERROR = 0, 1, 2
_MIN_PAIR_SIZE = 10  # bytes of a KeyValue with two empty strings, without the padding between them


@dataclass(frozen=True)
class Status:
    """A DiagnosticStatus.

    Attributes:
        level: `OK`, `WARN` or `ERROR`; 3, stale, from other publishers.
        name: of the component.
        message: one sentence.
        hardware_id: of the component.
        values: keys to values, as text.
    """

    level: int
    name: str
    message: str
    hardware_id: str = ''
    values: Mapping[str, str] = field(default_factory=dict)

    def encode(self) -> bytes:
        """The serialized message."""
        writer = CdrWriter()
        writer.uint8(self.level)
        for text in (self.name, self.message, self.hardware_id):
            writer.string(text)
        writer.uint32(len(self.values))
        for key, value in self.values.items():
            writer.string(key)
            writer.string(value)
        return writer.finish()

    @classmethod
    def decode(cls, message: bytes) -> 'Status':
        """Read a serialized message.

        Raises:
            MessageError: the message ends early, or is of another type.
        """
        reader = CdrReader(message)
        level, name, text, hardware_id = reader.uint8(), reader.string(), reader.string(), reader.string()
        pairs = [(reader.string(), reader.string()) for _ in range(reader.count(_MIN_PAIR_SIZE))]
        return cls(level, name, text, hardware_id, dict(pairs))
