# SPDX-License-Identifier: Apache-2.0
"""The node's health: counts of what arrived and what became of it, rates and latencies. No rclpy.

The worker's and the executor's threads count; /diagnostics reads the counts once per second.
"""

import threading
import time
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field

from socialcircle_ros.focus import Registered
from socialcircle_ros.interface import BAD_PIXELS, HealthValues

WINDOW_S = 10.0
"""Time over which rates and latencies are given."""


@dataclass
class InputCounts:
    """Clouds, frames and stacks since the start or the last reset."""

    received: int = 0
    published: int = 0
    dropped: int = 0
    lost: int = 0
    refused: int = 0
    failed: int = 0
    limits_failed: int = 0
    frames_received: int = 0
    frames_dropped: int = 0
    frames_lost: int = 0
    joint_states_dropped: int = 0
    stack_refusals: int = 0
    stacks: int = 0


@dataclass
class Health:
    """Counts, rates and latencies, safe to use from several threads."""

    counts: InputCounts = field(default_factory=InputCounts)
    last_reason: str = ''
    _lock: threading.Lock = field(default_factory=threading.Lock)
    _arrivals_s: deque[float] = field(default_factory=lambda: deque(maxlen=10_000))
    _latencies_s: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=10_000))
    _last_sign_s: float = float('-inf')
    _clouds_came: bool = False
    _trouble_at_s: float = float('-inf')
    _last_was_refused: bool = False
    _last_refused_was_cloud: bool = False
    _failed_limits: str = ''
    _stack_latency_s: float | None = None
    _stack_flicker: float | None = None
    _stack_focus_step: int | None = None
    _stack_drift: float | None = None
    _stack_registered: Registered | None = None
    _bad_pixels: Mapping[str, int] = field(default_factory=dict)

    def received(self) -> None:
        """A cloud arrived."""
        with self._lock:
            self.counts.received += 1
            self._clouds_came = True
            self._last_sign_s = time.monotonic()
            self._arrivals_s.append(self._last_sign_s)

    def judged(self, failure: str, *, again: bool) -> None:
        """A cloud was held to the limits; `failure`: why it failed ('': it did not); `again`: it was counted."""
        with self._lock:
            self.counts.limits_failed += bool(failure) and not again
            self._failed_limits = failure
            if self._last_refused_was_cloud:  # other settings may have been all that it needed
                self._last_was_refused = False

    def published(self, latency: float) -> None:
        """A cloud went out, `latency` seconds after it had arrived."""
        with self._lock:
            self.counts.published += 1
            self._last_sign_s = time.monotonic()
            self._latencies_s.append((self._last_sign_s, latency))
            self._last_was_refused = False

    def dropped(self, reason: str) -> None:
        """A cloud that waited is not filtered."""
        with self._lock:
            self.counts.dropped += 1
            self.last_reason = reason
            self._trouble_at_s = time.monotonic()

    def lost(self, count: int, reason: str) -> None:
        """Clouds did not arrive whole."""
        with self._lock:
            self.counts.lost += count
            self.last_reason = reason
            self._trouble_at_s = time.monotonic()

    def refused(self, reason: str, *, again: bool) -> None:
        """A cloud could not be used; `again`: it was counted."""
        with self._lock:
            self.counts.refused += not again
            self._last_sign_s = time.monotonic()
            self._trouble(reason)
            self._last_refused_was_cloud = True

    def failed(self, reason: str) -> None:
        """A frame, or rclpy, met a fault."""
        with self._lock:
            self.counts.failed += 1
            self._trouble(reason)

    def cloud_failed(self, reason: str, *, again: bool) -> None:
        """A cloud met a fault of this package; `again`: it was counted."""
        with self._lock:
            self.counts.failed += not again
            self._last_sign_s = time.monotonic()
            self._trouble(reason)
            self._last_refused_was_cloud = True

    def rows_failed(self, reason: str) -> None:
        """Rows of measurements wait for their folder, or are lost."""
        with self._lock:
            self.last_reason = reason
            self._trouble_at_s = time.monotonic()

    def frame_received(self) -> None:
        """A frame of a stack arrived."""
        with self._lock:
            self.counts.frames_received += 1
            self._last_sign_s = time.monotonic()

    def frame_dropped(self) -> None:
        """A frame was dropped, because too many others waited."""
        with self._lock:
            self.counts.frames_dropped += 1
            self._trouble('A frame was dropped: frames come faster than their focus is measured.')

    def stack_dropped(self, frames: int, reason: str) -> None:
        """A stack, or what there was of it, is not measured: all its frames are dropped."""
        with self._lock:
            self.counts.frames_dropped += frames
            self.last_reason = reason
            self._trouble_at_s = time.monotonic()

    def frames_lost(self, count: int, reason: str) -> None:
        """Frames did not arrive."""
        with self._lock:
            self.counts.frames_lost += count
            self.last_reason = reason
            self._trouble_at_s = time.monotonic()

    def joint_state_dropped(self) -> None:
        """A joint state was dropped, because too many others waited."""
        with self._lock:
            self.counts.joint_states_dropped += 1
            self._trouble('A joint state was dropped: joint states come faster than they are taken.')

    def frame_refused(self, reason: str) -> None:
        """A frame, a joint state or a whole stack could not be used."""
        with self._lock:
            self.counts.stack_refusals += 1
            self._trouble(reason)

    def stack_finished(
        self,
        latency: float,
        flicker: float,
        focus_step: int,
        drift: float | None,
        registered: Registered | None = None,
    ) -> None:
        """A stack became a cloud.

        Args:
            latency: time since its last frame had arrived, s.
            flicker: of its light.
            focus_step: of its focus measure, pixels.
            drift: of its frames, pixels; None: unknown.
            registered: what was corrected of it; None: nothing was asked for.
        """
        with self._lock:
            self.counts.stacks += 1
            self._stack_latency_s, self._stack_flicker = latency, flicker
            self._stack_focus_step, self._stack_drift = focus_step, drift
            self._stack_registered = registered
            self._last_was_refused = False

    def pixels_judged(self, bad: Mapping[str, int]) -> None:
        """The last stack has bad pixels: their number by reason."""
        with self._lock:
            self._bad_pixels = bad

    def _trouble(self, reason: str) -> None:
        self.last_reason = reason
        self._trouble_at_s = time.monotonic()
        self._last_was_refused, self._last_refused_was_cloud = True, False

    def reset(self) -> None:
        """Start counting anew; when the last input came is no count, and stays known."""
        with self._lock:
            self.counts = InputCounts()
            self.last_reason = ''
            self._arrivals_s.clear()
            self._latencies_s.clear()
            self._stack_latency_s = self._stack_flicker = self._stack_focus_step = self._stack_drift = None
            self._stack_registered = None
            self._bad_pixels = {}
            self._failed_limits = ''
            self._trouble_at_s = float('-inf')
            self._last_was_refused = False

    def seconds_silent(self) -> float:
        """Time since the last cloud or frame arrived, or a cloud was done with; infinite where none has come."""
        return time.monotonic() - self._last_sign_s

    def clouds_came(self) -> bool:
        """Whether a cloud has ever arrived."""
        return self._clouds_came

    def in_trouble(self) -> bool:
        """Whether input was refused or failed, or a frame or joint state dropped, after the last result."""
        return self._last_was_refused

    def failed_limits(self) -> str:
        """Why the last cloud failed its limits; '': it did not."""
        return self._failed_limits

    def had_trouble(self) -> bool:
        """Whether input was lost, dropped or refused, or failed, within the last window."""
        return time.monotonic() - self._trouble_at_s < WINDOW_S

    def values(
        self, state: str, publishers: int | None, connections: str | None, differences: str | None
    ) -> dict[str, str]:
        """All of it as the values of a DiagnosticStatus.

        Args:
            state: of the lifecycle.
            publishers: how many there are on points; None while the node is not active.
            connections: complaints about publishers; None while the node is not active.
            differences: what the installed rclpy lacks; None: nothing.
        """
        with self._lock:
            registered = self._stack_registered
            now_s = time.monotonic()
            arrivals = sum(now_s - at_s < WINDOW_S for at_s in self._arrivals_s)
            latencies_ms = sorted(1e3 * latency for at_s, latency in self._latencies_s if now_s - at_s < WINDOW_S)
            values = HealthValues(
                state=state,
                clouds_received=self.counts.received,
                clouds_published=self.counts.published,
                clouds_dropped=self.counts.dropped,
                clouds_lost=self.counts.lost,
                clouds_refused=self.counts.refused,
                clouds_failed=self.counts.failed,
                limits_failed=self.counts.limits_failed,
                frames_received=self.counts.frames_received,
                frames_dropped=self.counts.frames_dropped,
                frames_lost=self.counts.frames_lost,
                joint_states_dropped=self.counts.joint_states_dropped,
                stack_refusals=self.counts.stack_refusals,
                stacks_finished=self.counts.stacks,
                last_reason=self.last_reason,
                rate_hz=arrivals / WINDOW_S,
                latency_median_ms=latencies_ms[len(latencies_ms) // 2] if latencies_ms else None,
                latency_max_ms=latencies_ms[-1] if latencies_ms else None,
                stack_latency_ms=None if self._stack_latency_s is None else 1e3 * self._stack_latency_s,
                stack_flicker=self._stack_flicker and round(self._stack_flicker, 5),
                stack_focus_step=self._stack_focus_step,
                stack_drift_px=self._stack_drift and round(self._stack_drift, 2),
                stack_registered_px=None if registered is None else round(registered.moved, 2),
                stack_registered_magnification=None if registered is None else round(registered.magnification, 5),
                publishers=publishers,
                connections=connections,
                differences=differences,
            )
            bad = {BAD_PIXELS.format(reason=reason): str(count) for reason, count in self._bad_pixels.items()}
            return values.to_text() | bad
