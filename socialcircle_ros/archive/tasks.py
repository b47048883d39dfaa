# SPDX-License-Identifier: Apache-2.0
"""What a worker gets and gives back. The client needs no more, so it loads no kernels while the workers do."""

from dataclasses import dataclass

from socialcircle_ros.arguments import Compression
from socialcircle_ros.settings import PipelineSettings

from .inputs import ArchiveInput
from .ledger import LedgerEntry
from .names import NamePattern


@dataclass(frozen=True)
class BatchTask:
    """What is to be done with one input.

    Attributes:
        found: the input.
        output: folder of the results, which all workers see: absolute path, or URL.
        settings: how to filter.
        names: pattern of the names of the inputs.
        topics: topics of clouds to filter; none: those of `clouds_of`.
        recordings: whether to write a cleaned recording.
        reports: whether to write a report.
        compression: of the cleaned recording.
        version: of this package.
        digest: hash of all of these but the input and the output.
        earlier: entries of the ledger with the location of the input, whatever its content was then.
    """

    found: ArchiveInput
    output: str
    settings: PipelineSettings
    names: NamePattern
    topics: tuple[str, ...]
    recordings: bool
    reports: bool
    compression: Compression
    version: str
    digest: str
    earlier: tuple[LedgerEntry, ...] = ()


@dataclass(frozen=True)
class TaskResult:
    """What came of one input.

    Attributes:
        location: of the input.
        content: hash of its content; '': it could not be read.
        entry: of the ledger.
        same_as: location of the input with the same content that was done before, which may be this one; '':
            there is none.
        units: what was taken for a unit that it does not state, as a sentence.
    """

    location: str
    content: str
    entry: LedgerEntry
    same_as: str = ''
    units: tuple[str, ...] = ()


def do_in_worker(task: BatchTask) -> TaskResult:
    """Filter one input, see `work.do_task`."""
    from .work import do_task  # noqa: PLC0415 - loads the kernels

    return do_task(task)
