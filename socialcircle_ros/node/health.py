"""How the node is doing: what arrived, what became of it, how long it took. No rclpy.

Counted on the worker's thread and the executor's, read once a second for /diagnostics.
"""

import threading
import time
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field

WINDOW = 10.0
"""Seconds over which rates and latencies are given."""


@dataclass
class Counts:
    """Clouds, frames and stacks since the start or the last reset."""

    received: int = 0
    published: int = 0
    dropped: int = 0
    refused: int = 0
    failed: int = 0
    frames_received: int = 0
    frames_dropped: int = 0
    stack_refusals: int = 0
    stacks: int = 0


@dataclass
class Health:
    """Counts, rates and latencies, safe to use from several threads."""

    counts: Counts = field(default_factory=Counts)
    last_reason: str = ''
    _lock: threading.Lock = field(default_factory=threading.Lock)
    _arrivals: deque[float] = field(default_factory=lambda: deque(maxlen=10_000))
    _latencies: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=10_000))
    _trouble_at: float = float('-inf')
    _last_was_refused: bool = False
    _stack_latency: float | None = None
    _bad_pixels: Mapping[str, int] = field(default_factory=dict)

    def received(self) -> None:
        """A cloud arrived."""
        with self._lock:
            self.counts.received += 1
            self._arrivals.append(time.monotonic())

    def published(self, latency: float) -> None:
        """A cloud went out, `latency` seconds after it had arrived."""
        with self._lock:
            self.counts.published += 1
            self._latencies.append((time.monotonic(), latency))
            self._last_was_refused = False

    def dropped(self) -> None:
        """A cloud was overtaken by a newer one while it waited."""
        with self._lock:
            self.counts.dropped += 1
            self.last_reason = 'A cloud was dropped: a newer one arrived while the one before was being filtered.'
            self._trouble_at = time.monotonic()

    def refused(self, reason: str) -> None:
        """A cloud could not be used."""
        with self._lock:
            self.counts.refused += 1
            self._trouble(reason)

    def failed(self, reason: str) -> None:
        """Our own code went wrong on a cloud."""
        with self._lock:
            self.counts.failed += 1
            self._trouble(reason)

    def frame_received(self) -> None:
        """A frame of a stack arrived."""
        with self._lock:
            self.counts.frames_received += 1

    def frame_dropped(self) -> None:
        """A frame found too many others waiting."""
        with self._lock:
            self.counts.frames_dropped += 1
            self._trouble('A frame was dropped: frames come faster than their focus is measured.')

    def frame_refused(self, reason: str) -> None:
        """A frame, a joint state or a whole stack could not be used."""
        with self._lock:
            self.counts.stack_refusals += 1
            self._trouble(reason)

    def stack_finished(self, latency: float) -> None:
        """A stack became a cloud, `latency` seconds after its last frame had arrived."""
        with self._lock:
            self.counts.stacks += 1
            self._stack_latency = latency
            self._last_was_refused = False

    def pixels_judged(self, bad: Mapping[str, int]) -> None:
        """Of the last stack: how many pixels are bad, by reason."""
        with self._lock:
            self._bad_pixels = bad

    def _trouble(self, reason: str) -> None:
        self.last_reason = reason
        self._trouble_at = time.monotonic()
        self._last_was_refused = True

    def reset(self) -> None:
        """Start counting anew."""
        with self._lock:
            self.counts = Counts()
            self.last_reason = ''
            self._arrivals.clear()
            self._latencies.clear()
            self._stack_latency = None
            self._bad_pixels = {}
            self._trouble_at = float('-inf')
            self._last_was_refused = False

    def seconds_silent(self) -> float:
        """Time since the last cloud arrived; infinite where none has."""
        with self._lock:
            return time.monotonic() - self._arrivals[-1] if self._arrivals else float('inf')

    def in_trouble(self) -> bool:
        """Whether the last cloud was refused or failed."""
        return self._last_was_refused

    def had_trouble(self) -> bool:
        """Whether a cloud was lost within the last window."""
        return time.monotonic() - self._trouble_at < WINDOW

    def values(self) -> dict[str, str]:
        """All of it as the values of a DiagnosticStatus."""
        with self._lock:
            now = time.monotonic()
            arrivals = sum(now - at < WINDOW for at in self._arrivals)
            latencies = sorted(1e3 * latency for at, latency in self._latencies if now - at < WINDOW)
            values = {
                'clouds_received': str(self.counts.received),
                'clouds_published': str(self.counts.published),
                'clouds_dropped': str(self.counts.dropped),
                'clouds_refused': str(self.counts.refused),
                'clouds_failed': str(self.counts.failed),
                'frames_received': str(self.counts.frames_received),
                'frames_dropped': str(self.counts.frames_dropped),
                'stack_refusals': str(self.counts.stack_refusals),
                'stacks_finished': str(self.counts.stacks),
                'last_reason': self.last_reason,
                'rate_hz': f'{arrivals / WINDOW:.1f}',
            }
            if latencies:
                values['latency_median_ms'] = f'{latencies[len(latencies) // 2]:.1f}'
                values['latency_max_ms'] = f'{latencies[-1]:.1f}'
            if self._stack_latency is not None:
                values['stack_latency_ms'] = f'{1e3 * self._stack_latency:.1f}'
            values |= {f'stack_pixels_{reason}': str(count) for reason, count in self._bad_pixels.items()}
            return values
