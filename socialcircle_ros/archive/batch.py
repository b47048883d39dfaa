# SPDX-License-Identifier: Apache-2.0
"""`run_batch`: filter an archive on all cores, and keep every measurement."""

import importlib.metadata
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from hashlib import blake2b
from pathlib import Path

from socialcircle_ros.arguments import Compression, OneOrSeveral, check_compression, settings_or_default, several
from socialcircle_ros.engine import Engine
from socialcircle_ros.pictures.style import new_figure
from socialcircle_ros.report.page import environment
from socialcircle_ros.settings import PipelineSettings

from .inputs import ArchiveInput, find_inputs
from .ledger import Ledger, LedgerEntry
from .names import NamePattern
from .results import ResultFolder, result_name
from .tasks import BatchTask, TaskResult, do_in_worker


@dataclass
class BatchResult:
    """What was done with an archive.

    Attributes:
        inputs: number of inputs.
        left_out: number of results in the folder of the results that the search for inputs met.
        done: inputs that were filtered now.
        skipped: inputs that an earlier run had filtered.
        clouds: clouds that were filtered now.
        same: inputs with the content of another input, with its location.
        failed: inputs that failed, with the reason.
        damaged: recordings that break off, with the sentence; their clouds before the damage are measured.
        refused: number of refused clouds and frames by reason, of the inputs that were filtered now.
        refused_in: locations of the inputs that these are from, by reason.
        limits_failed: number of clouds that failed their limits, in all inputs.
        units: what was taken for a unit that an input does not state, of the inputs that were filtered now.
    """

    inputs: int = 0
    left_out: int = 0
    done: int = 0
    skipped: int = 0
    clouds: int = 0
    same: dict[str, str] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)
    damaged: dict[str, str] = field(default_factory=dict)
    refused: dict[str, int] = field(default_factory=dict)
    refused_in: dict[str, list[str]] = field(default_factory=dict)
    limits_failed: int = 0
    units: list[str] = field(default_factory=list)


def run_batch(
    inputs: OneOrSeveral[str | Path],
    output: str | Path,
    settings: PipelineSettings | None = None,
    *,
    names: str = '',
    topics: OneOrSeveral[str] = (),
    recordings: bool = True,
    reports: bool = False,
    compression: Compression = 'none',
    scheduler: str | None = None,
    workers: int | None = None,
    found: Callable[[int], None] = lambda count: None,
    started: Callable[[str], None] = lambda dashboard: None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> BatchResult:
    """Filter all recordings of an archive; write cleaned recordings, and one row per cloud.

    A rerun does only what is new: an input is skipped if its content, the settings, the options and the version
    are those of an earlier run. An input that fails does not stop the others, and is tried again by the next run.
    After an interruption the same call goes on. A program that calls this without `scheduler` needs
    `if __name__ == '__main__':`, because Dask starts processes that import it.

    Args:
        inputs: recordings, folders, globs, measurement files, and URLs, see `find_inputs`.
        output: folder of the results, or its URL: `recordings`, `measurements`, `reports`, and `inputs` with what
            is done. It may lie in a folder of inputs; what these four hold is no input.
        settings: how to filter; the defaults if None.
        names: pattern of the names, which gives cell and part, see `NamePattern`. Otherwise the entries `cell`
            and `part` of a recording's metadata count, and the namespace of the topic as cell.
        topics: topics of clouds to filter; none: those named `points`, and all stacks.
        recordings: whether to write a cleaned recording of each input.
        reports: whether to write a report of each input.
        compression: of the cleaned recordings.
        scheduler: address or scheduler file of a Dask cluster whose workers see the inputs and the output under
            the same names, and have this package. None: processes of this machine.
        workers: number of these processes; None: one for each core that this process may use.
        found: called with the number of inputs found so far.
        started: called with the address of Dask's dashboard.
        progress: called with the number of finished inputs and the number of all inputs.

    Raises:
        SocialCircleError: the settings or the compression are none, an input does not exist, the folder cannot be
            used, a library is missing, or no scheduler answers.
    """
    results, settings = ResultFolder(output), settings_or_default(PipelineSettings, settings)
    pattern = NamePattern(names)
    check_compression(compression)
    if reports:
        new_figure(1, 1)  # fails now where matplotlib or Jinja2 is missing, and not after hours
        environment()
    template = _template(results.location, settings, pattern, several(topics), recordings, reports, compression)
    left_out: list[str] = []
    with results.created():
        ledger = Ledger(results)
        earlier: dict[str, list[LedgerEntry]] = {}
        owners: dict[str, set[str]] = {}
        for entry in ledger.entries():
            earlier.setdefault(entry.location, []).append(entry)
            owners.setdefault(result_name(entry.name), set()).add(entry.location)
        all_inputs = find_inputs(inputs, found, results, left_out.append, owners)
        result = BatchResult(inputs=len(all_inputs), left_out=len(left_out))
        tasks = []
        for each in all_inputs:
            here = earlier.get(each.location, [])
            if not _is_done(each, here, template, ledger, result):
                tasks.append(replace(template, found=each, earlier=tuple(here)))
        if tasks:
            with Engine[BatchTask, TaskResult](scheduler, workers, ['socialcircle_ros.archive.preload']) as engine:
                started(engine.dashboard)
                progress(result.skipped, result.inputs)
                for finished in _finished(engine, tasks):
                    _note(result, finished)
                    progress(result.skipped + result.done + len(result.same) + len(result.failed), result.inputs)
        results.tidy()
    return result


def _template(
    output: str,
    settings: PipelineSettings,
    names: NamePattern,
    topics: tuple[str, ...],
    recordings: bool,
    reports: bool,
    compression: Compression,
) -> BatchTask:
    """What all tasks have in common, with a hash of what makes a difference to the results."""
    version = importlib.metadata.version('socialcircle_ros')
    options = {
        'settings': sorted(settings.to_ros().items()), 'names': names.text, 'topics': sorted(topics),
        'recordings': recordings, 'reports': reports, 'compression': compression, 'version': version,
    }  # fmt: skip
    if settings.circle.taught is not None:
        options['lesson'] = settings.circle.taught.digest
    digest = blake2b(json.dumps(options).encode(), digest_size=8).hexdigest()
    none = ArchiveInput('', '', 0, '', 0)
    return BatchTask(none, output, settings, names, topics, recordings, reports, compression, version, digest)


def _is_done(
    found: ArchiveInput, here: Sequence[LedgerEntry], template: BatchTask, ledger: Ledger, result: BatchResult
) -> bool:
    """Whether an earlier run has done an input; then it is noted, and what it was before is forgotten."""
    done = next((entry for entry in here if entry.is_of(found, template.digest)), None)
    if done is None:
        return False
    ledger.forget_others(here, found.location, done.content)
    result.skipped += 1
    _note_findings(result, done)
    return True


def _finished(engine: Engine[BatchTask, TaskResult], tasks: Sequence[BatchTask]) -> Iterator[TaskResult]:
    for task, result in engine.run(do_in_worker, tasks):
        if isinstance(result, Exception):
            from .work import failed_result  # noqa: PLC0415 - loads the kernels

            yield failed_result(task, f'{task.found.location} was given up: {result}')
        else:
            yield result


def _note(result: BatchResult, finished: TaskResult) -> None:
    entry = finished.entry
    if entry.failure is not None:
        result.failed[finished.location] = entry.failure
    elif finished.same_as == finished.location:
        result.skipped += 1
        _note_findings(result, entry)
    elif finished.same_as:
        result.same[finished.location] = finished.same_as
    else:
        result.done += 1
        result.clouds += entry.clouds
        result.units += finished.units
        for reason, count in entry.refused.items():
            result.refused[reason] = result.refused.get(reason, 0) + count
            result.refused_in.setdefault(reason, []).append(finished.location)
        _note_findings(result, entry)


def _note_findings(result: BatchResult, entry: LedgerEntry) -> None:
    result.limits_failed += entry.limits_failed
    if entry.damage:
        result.damaged[entry.location] = entry.damage
