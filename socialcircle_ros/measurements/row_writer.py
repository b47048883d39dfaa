# SPDX-License-Identifier: Apache-2.0
"""Rows of live clouds: written on a thread of their own, in batches, so that no cloud waits for the disk."""

import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from socialcircle_ros.cloud import Cloud, Mask
from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.messages.header import Header
from socialcircle_ros.metrics.areal import texture
from socialcircle_ros.pipeline.clouds import Measurement

from .files import arrow_schema, folder_fault, write_rows
from .row import MeasurementRow, Origin, refused_row, row_of

MOST_ROWS = 1000
"""Rows after which a batch is written before its time is over."""

MOST_WAITING = 20_000
"""Most rows in memory, about 20 MB, where the disk is full; then the oldest are lost."""

_MOST_CLOUDS = 4  # whose texture is not yet computed; a cloud is some MB


@dataclass(frozen=True, eq=False)
class LiveCloud:
    """A cloud of the node, filtered or refused.

    Attributes:
        origin: where it comes from.
        outcome: the measurement, or the sentence of a refusal.
        latency_ms: from arrival to publication.
        xyz: the cloud, (H, W, 3); None: its texture is not wanted.
        kept: (H, W), its kept points.
        header: of a refused cloud; None: it is damaged.
    """

    origin: Origin
    outcome: Measurement | str
    latency_ms: float | None = None
    xyz: Cloud | None = None
    kept: Mask | None = None
    header: Header | None = None


class RowWriter:
    """Writes rows in batches on a thread of its own. A process that is killed loses at most the last batch.

    If a batch cannot be written, as on a full disk, its rows wait for the next attempt, `MOST_WAITING` at most.

    Args:
        folder: the rows are in `measurements` in it.
        name: of the files, with the time of the start and a number; another one for each node.
        period_s: time from the first row of a batch to its writing.
        failed: called on the writer's thread with a sentence if rows wait, will wait or are lost.

    Raises:
        SocialCircleError: pyarrow is not installed.
    """

    def __init__(self, folder: Path, name: str, period_s: float, failed: Callable[[str], None]) -> None:
        arrow_schema()  # loads pyarrow now, and not while clouds come
        self._folder, self._period_s, self._failed = folder, period_s, failed
        self._name = f'{name}-{time.time_ns()}'
        self._number = 0
        self._coming: deque[LiveCloud] = deque()
        self._changed = threading.Condition()
        self._stopping = False
        self._rows: list[MeasurementRow] = []
        self._write_at_s = float('inf')
        self._lost = 0
        self._waits = False  # after an attempt that failed
        self._reason = ''
        self._thread = threading.Thread(target=self._run, name='row_writer')
        self._thread.start()

    def put(self, cloud: LiveCloud) -> None:
        """Hand over a cloud; never waits for the disk. With several clouds waiting, a row has no texture."""
        with self._changed:
            if len(self._coming) >= _MOST_CLOUDS:
                cloud = replace(cloud, xyz=None, kept=None)
            if len(self._coming) >= MOST_WAITING:
                self._coming.popleft()
                self._lost += 1
            self._coming.append(cloud)
            self._changed.notify_all()

    def close(self) -> str:
        """Write what waits, and end the thread; may be called twice.

        Returns:
            A sentence on the rows that could not be written and are lost; empty if there are none.
        """
        with self._changed:
            self._stopping = True
            self._changed.notify_all()
        self._thread.join()
        if not self._rows:
            return ''
        count = self._lost + len(self._rows)
        return f'{_rows(count)} of measurements {"is" if count == 1 else "are"} lost, because: {self._reason}'

    def _run(self) -> None:
        self._look_at_folder()
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._coming or self._stopping, self._left_s())
                coming, self._coming = self._coming, deque()
                stopping = self._stopping
            while coming:
                self._take(coming.popleft())
            is_full = len(self._rows) >= MOST_ROWS and not self._waits
            if self._rows and (stopping or is_full or self._left_s() == 0):
                self._write()
            if stopping:
                return

    def _look_at_folder(self) -> None:
        try:
            fault = folder_fault(self._folder)
        except Exception as error:  # noqa: BLE001 - the last resort: without this thread nothing is written
            fault = repr(error)
        if fault:
            self._failed(f'Rows of measurements will wait, because: {fault}')

    def _take(self, cloud: LiveCloud) -> None:
        try:
            self._add(_row(cloud))
        except Exception as error:  # noqa: BLE001 - the last resort, as above
            self._lost += 1
            self._failed(f'A row of measurements is lost, because: {error!r}')

    def _left_s(self) -> float | None:
        """Time until the batch is to be written; None: there is none."""
        return max(0.0, self._write_at_s - time.monotonic()) if self._rows else None

    def _add(self, row: MeasurementRow) -> None:
        if not self._rows:
            self._write_at_s = time.monotonic() + self._period_s
        if len(self._rows) >= MOST_WAITING:
            del self._rows[0]
            self._lost += 1
        self._rows.append(row)

    def _write(self) -> None:
        self._write_at_s = time.monotonic() + self._period_s
        try:
            # The name stays until the batch is written, so that an attempt replaces what the last one has left.
            write_rows(self._folder, f'{self._name}-{self._number:06d}', self._rows)
        except (SocialCircleError, OSError) as error:
            lost = f' {_rows(self._lost)} {"is" if self._lost == 1 else "are"} lost.' if self._lost else ''
            self._waits, self._reason = True, str(error)
            if not self._stopping:
                wait = 'waits' if len(self._rows) == 1 else 'wait'
                self._failed(f'{_rows(len(self._rows))} of measurements {wait}, because: {error}{lost}')
            return
        except Exception:  # noqa: BLE001 - the last resort, as above
            self._write_singly()
        self._number += 1
        self._rows, self._waits = [], False

    def _write_singly(self) -> None:
        """Write each row of the batch by itself, so that one that cannot be written holds up no other."""
        for place, row in enumerate(self._rows):
            try:
                write_rows(self._folder, f'{self._name}-{self._number:06d}-{place}', [row])
            except Exception as error:  # noqa: BLE001, PERF203 - as above
                self._lost += 1
                self._failed(f'A row of measurements is lost, because: {error!r}')


def _rows(count: int) -> str:
    return '1 row' if count == 1 else f'{count} rows'


def _row(cloud: LiveCloud) -> MeasurementRow:
    if isinstance(cloud.outcome, str):
        return refused_row(cloud.origin, cloud.outcome, header=cloud.header)
    found = None
    if cloud.xyz is not None and cloud.kept is not None:
        found = texture(cloud.xyz, cloud.kept)
    return row_of(cloud.origin, cloud.outcome, found, cloud.latency_ms)
