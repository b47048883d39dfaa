# SPDX-License-Identifier: Apache-2.0
"""The finished trials of a sweep in a journal of Optuna, which several machines may use at once."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from socialcircle_ros.errors import SocialCircleError, install_command
from socialcircle_ros.storage import open_in_place

from .search_space import ParameterValues
from .trials import Trial, key_of

if TYPE_CHECKING:
    from optuna.storages import BaseStorage
    from optuna.storages.journal import JournalFileSymlinkLock

_RESULT = 'result'  # the attribute of Optuna's trials that holds one of ours


def import_optuna() -> ModuleType:
    """Optuna, silent.

    Raises:
        SocialCircleError: it is not installed.
    """
    try:
        import optuna  # noqa: PLC0415 - an extra
    except ImportError:
        raise SocialCircleError(f'A sweep needs Optuna: {install_command("tuning")}.') from None
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    module: ModuleType = optuna
    return module


class TrialJournal:
    """Finished trials on disk, so that an interrupted sweep can continue, and several processes can share one.

    Args:
        path: the file. Optuna locks it by a link beside it, which also works on a file server.
        fingerprint: fingerprint of the clouds and of the parameters that are not varied.
        restart: whether to delete the trials that the file holds.

    Attributes:
        path: the file.
        fingerprint: as given.
        storage: of Optuna; it also holds the studies of searches.

    Raises:
        SocialCircleError: the file belongs to another sweep, or cannot be read or written, or Optuna is missing.
    """

    def __init__(self, path: Path, fingerprint: str, *, restart: bool = False) -> None:
        self._optuna = import_optuna()
        self.path, self.fingerprint = path, fingerprint
        self._by_key: dict[str, Trial] = {}
        self._seen = 0
        with self._errors():
            if restart:
                path.unlink(missing_ok=True)
            journal = self._optuna.storages.journal
            backend, lock = journal.JournalFileBackend(str(path)), journal.JournalFileSymlinkLock(str(path))
            _drop_cut_line(path, lock)
            self.storage: BaseStorage = self._optuna.storages.JournalStorage(backend)
            names = self._optuna.study.get_all_study_names(self.storage)
        if names and fingerprint not in names:
            raise SocialCircleError(
                f'{path} holds trials on other clouds, or with other fixed parameters or another lesson; choose'
                ' another output folder, or start over with --restart.'
            )
        with self._errors():
            # Also where it exists, Optuna would write that it is to be created.
            if names:
                self._study = self._optuna.load_study(storage=self.storage, study_name=fingerprint)
            else:
                self._study = self._optuna.create_study(
                    storage=self.storage, study_name=fingerprint, direction='maximize', load_if_exists=True
                )
            self._read()

    @property
    def trials(self) -> list[Trial]:
        """The finished trials of all processes, each setting once, in the order in which they were finished."""
        with self._errors():
            self._read()
        return list(self._by_key.values())

    def add(self, trial: Trial) -> None:
        """Add one trial, and write it to the disk at once.

        Raises:
            SocialCircleError: it cannot be written.
        """
        finished = self._optuna.trial.create_trial(value=trial.score, user_attrs={_RESULT: asdict(trial)})
        with self._errors():
            self._study.add_trial(finished)

    def untried(self, wanted: Sequence[ParameterValues]) -> Iterator[ParameterValues]:
        """The settings that have no trial yet, by this or another process, when each is asked for."""
        for values in wanted:
            self._read()
            if key_of(values) not in self._by_key:
                yield values

    def _read(self) -> None:
        found = self._study.get_trials(deepcopy=False)
        for each in found[self._seen :]:
            trial = Trial(**each.user_attrs[_RESULT])
            self._by_key.setdefault(key_of(trial.values), trial)
        self._seen = len(found)

    @contextmanager
    def _errors(self) -> Iterator[None]:
        """Turn what Optuna raises into sentences."""
        try:
            yield
        except OSError as error:
            raise SocialCircleError(
                f'{self.path} cannot be used: {error.strerror}; choose another output folder.'
            ) from None
        except (ValueError, KeyError, TypeError, AttributeError):
            raise SocialCircleError(
                f'{self.path} is not a file of trials; choose another output folder, or start over with --restart.'
            ) from None


def _drop_cut_line(path: Path, lock: 'JournalFileSymlinkLock') -> None:
    """Remove a line that a loss of power cut short; Optuna would append to it, and then read neither."""
    lock.acquire()
    try:
        content = path.read_bytes()
        if content and not content.startswith(b'{"op_code":'):
            raise ValueError  # Optuna passes over a single line that it cannot read
        if content and not content.endswith(b'\n'):
            with open_in_place(path, append=True) as file:
                file.truncate(content.rfind(b'\n') + 1)
    finally:
        lock.release()
