# SPDX-License-Identifier: Apache-2.0
"""The task of a worker: one input in; a cleaned recording, rows and an entry of the ledger out."""

import time
from dataclasses import replace
from pathlib import Path

from socialcircle_ros.errors import SocialCircleError, printable
from socialcircle_ros.measurements import MeasurementRow, Origin, SettingsText, refused_row, row_of, write_rows
from socialcircle_ros.messages.header import FIRST_DATE, readable_header
from socialcircle_ros.metrics.areal import texture
from socialcircle_ros.pipeline.clouds import CloudOutputs
from socialcircle_ros.pipeline.stacks import Refusal
from socialcircle_ros.recording import open_recording
from socialcircle_ros.recording.any_file import units_told_to
from socialcircle_ros.recording.offline import (
    KeptPoints,
    SourceCloud,
    Summary,
    filter_recording,
    measure_recording,
)
from socialcircle_ros.recording.origins import origins_of
from socialcircle_ros.recording.units import unit_of
from socialcircle_ros.report.report import make_report

from .inputs import content_hash, local_copy, still_holds, with_hash
from .ledger import Ledger, LedgerEntry, failure_name
from .results import ResultFolder, recording_of, report_of
from .tasks import BatchTask, TaskResult


def do_task(task: BatchTask) -> TaskResult:
    """Filter one input; the result holds what failed, so that the other inputs go on.

    The entry of the ledger is written last: a worker that is killed leaves an input that is done again, and its
    results, which have the same names, are replaced.
    """
    try:
        with local_copy(task.found.location) as path:
            content = content_hash(path)
            ledger = Ledger(task.output)
            # An input that is still written, or copied again under its name, has had another content. What was
            # made of that stays while the input cannot be read: it may be there again. It goes before the new
            # results get its names: another worker may find that content where it has been moved to.
            contents = [each for each in task.earlier if each.failure is None]
            ledger.forget_others(contents, task.found.location, content)
            earlier = ledger.of_content(content)
            moved_from = None if earlier is None or _is_there(earlier, task) else earlier
            result = None if moved_from else _done_before(task, content, earlier)
            result = result or _done_now(_named_as(task, moved_from), path, content, moved=moved_from is not None)
            if result.entry.failure is None:
                failures = [each for each in task.earlier if each.failure is not None]
                ledger.forget_others(failures, task.found.location, content)
            return result
    except SocialCircleError as error:
        return failed_result(task, str(error))
    except Exception as error:  # noqa: BLE001 - whatever it is, the other inputs are done
        return failed_result(task, printable(f'{type(error).__name__}: {error}'))


def _is_there(entry: LedgerEntry, task: BatchTask) -> bool:
    """Whether a content is still where it was measured, and has not been moved to where the task found it."""
    return entry.location == task.found.location or still_holds(
        entry.location, entry.size, entry.changed, entry.content
    )


def _named_as(task: BatchTask, moved_from: LedgerEntry | None) -> BatchTask:
    """The task with the name of results that the earlier location of a moved recording owned.

    A name that belongs to another location ends in a hash; here that location is gone.
    """
    found = task.found
    if moved_from is not None and found.name == with_hash(moved_from.name, found.location):
        return replace(task, found=replace(found, name=moved_from.name))
    return task


def _done_before(task: BatchTask, content: str, earlier: LedgerEntry | None) -> TaskResult | None:
    """The result of an earlier run, or of another input with the same content; None: there is none."""
    if earlier is not None and earlier.digest == task.digest and earlier.failure is None:
        return TaskResult(task.found.location, content, earlier, earlier.location)
    return None


def _done_now(task: BatchTask, path: Path, content: str, *, moved: bool) -> TaskResult:
    try:
        return _with_units(task, path, content, moved=moved)
    except SocialCircleError as error:
        # The copy of a URL has a name that nobody knows.
        return failed_result(task, str(error).replace(str(path), task.found.location))
    except Exception as error:  # noqa: BLE001 - whatever it is, the other inputs are done
        return failed_result(task, printable(f'{type(error).__name__}: {error}'))


def failed_result(task: BatchTask, reason: str) -> TaskResult:
    """Record that an input failed, as a row and in the ledger, if these can be written; the others go on."""
    try:
        return TaskResult(task.found.location, '', _recorded_failure(task, reason))
    except Exception as error:  # noqa: BLE001 - whatever it is, the failure is told
        text = str(error) if isinstance(error, SocialCircleError) else f'{type(error).__name__}: {error}'
        # On a full disk, or where the folder of rows is a file, both have one reason.
        told = reason if text in reason else printable(f'{reason} It has no row: {text}')
        found = task.found
        return TaskResult(
            found.location, '', LedgerEntry(found.location, found.size, found.changed, task.digest, failure=told)
        )


def _recorded_failure(task: BatchTask, reason: str) -> LedgerEntry:
    found = task.found
    cell, part = task.names.read(found.location)
    origin = _origin(task, None, cell or '', part, '', 0, found.time_ns or time.time_ns())
    rows = [refused_row(origin, reason, 'failed')]
    results = ResultFolder(task.output)
    with results.writing() as folder:
        files = tuple(write_rows(folder, failure_name(found.location), rows))
    entry = LedgerEntry(found.location, found.size, found.changed, task.digest, files=files, failure=reason)
    Ledger(results).record_failure(entry)
    return entry


def _with_units(task: BatchTask, path: Path, content: str, *, moved: bool) -> TaskResult:
    """Filter an input. What is taken for its unit is part of the result: nobody reads the warnings of a worker."""
    units: set[str] = set()
    with units_told_to(units.add):
        result = _measured(task, path, content, moved=moved)
    told = (sentence.replace(str(path), task.found.location) for sentence in units)
    return replace(result, units=tuple(sorted(told)))


def _measured(task: BatchTask, path: Path, content: str, *, moved: bool) -> TaskResult:
    collector = _RowCollector(task, path, content)
    results = ResultFolder(task.output)
    ledger, found = Ledger(results), task.found
    # Interrupted from here on, the results are of two settings.
    ledger.begin(content, found, moved=moved)
    with results.writing() as folder:
        summary = _filtered(task, path, folder, collector)
        if not summary.clouds and not collector.rows:
            reasons = ' '.join([*summary.refused, *([summary.damage] if summary.damage else [])])
            raise SocialCircleError(f'{found.location} has no cloud. {reasons}'.strip())
        outputs = [recording_of(found.name)] if task.recordings and summary.clouds else []
        if task.reports and summary.clouds:
            outputs.append(report_of(found.name))
            make_report(path, folder / outputs[-1], task.settings, topics=task.topics)
        # Another worker may have done a copy meanwhile; it has removed what an earlier run had made of this one.
        copy = _done_before(task, content, ledger.of_content(content))
        files = () if copy else tuple(write_rows(folder, content, collector.rows))
    entry = LedgerEntry(
        location=found.location,
        size=found.size,
        changed=found.changed,
        digest=task.digest,
        clouds=summary.clouds,
        refused=summary.refused,
        damage=summary.damage and summary.damage.replace(str(path), found.location),
        name=found.name,
        limits_failed=sum(row.limits_passed is False for row in collector.rows),
        files=files,
        outputs=tuple(outputs),
    )
    copy = copy or _done_before(task, content, ledger.of_content(content))
    if copy:
        ledger.drop(entry, copy.entry)
        return copy
    ledger.record(content, entry)
    return TaskResult(found.location, content, entry)


def _filtered(task: BatchTask, path: Path, folder: Path, collector: '_RowCollector') -> Summary:
    if not task.recordings:
        return measure_recording(path, task.settings, collector, topics=task.topics)
    target = folder / recording_of(task.found.name)
    target.parent.mkdir(parents=True, exist_ok=True)
    return filter_recording(
        path,
        target,
        task.settings,
        topics=task.topics,
        compression=task.compression,
        overwrite=True,
        filtered=collector,
    )


class _RowCollector:
    """Makes a row of each cloud of one recording; a recording of 10,000 clouds makes 10 MB of rows."""

    def __init__(self, task: BatchTask, path: Path, content: str) -> None:
        self._task = task
        self._content = content
        self.rows: list[MeasurementRow] = []
        cell, part = task.names.read(task.found.location)
        with open_recording(path) as reader:
            recorded = {key: text for record in reader.metadata() for key, text in record.entries.items()}
            self._units = {topic: unit_of(reader, topic) for topic in reader.topics}
            self._files = origins_of(reader)
        self._cell, self._part = cell or recorded.get('cell'), part or recorded.get('part')

    def __call__(self, cloud: SourceCloud, outputs: CloudOutputs | Refusal, kept: KeptPoints | None) -> None:
        """Take one cloud."""
        cell = self._cell or cloud.namespace.strip('/')
        origin = replace(
            _origin(self._task, self._content, cell, self._part, cloud.topic, cloud.number, self._time_ns(cloud)),
            unit='m' if cloud.image is not None else self._units[cloud.topic],
        )
        if isinstance(outputs, Refusal):
            self.rows.append(refused_row(origin, outputs.reason, header=readable_header(cloud.points)))
        else:
            found = None if kept is None else texture(*kept)
            self.rows.append(row_of(origin, outputs.measurement, found))

    def _time_ns(self, cloud: SourceCloud) -> int:
        """When a cloud was recorded; where that is no date, when its file says or was changed, ns since 1970."""
        if cloud.message.log_time >= FIRST_DATE:
            return cloud.message.log_time
        file = self._files.get((cloud.topic.rpartition('/')[0], cloud.message.log_time))
        stated = None if file is None else file.time_ns
        return stated or self._task.found.time_ns or time.time_ns()


def _origin(
    task: BatchTask, content: str | None, cell: str, part: str | None, topic: str, number: int, time_ns: int
) -> Origin:
    return Origin(
        source='batch',
        recording=task.found.location,
        content=content,
        cell=cell,
        part=part,
        topic=topic,
        number=number,
        time_ns=time_ns,
        settings=SettingsText.of(task.settings),
        version=task.version,
    )
