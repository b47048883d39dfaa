# SPDX-License-Identifier: Apache-2.0
"""`run_sweep`: filter the same clouds with many settings, and write down what can be concluded."""

import json
import random
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from socialcircle_ros.arguments import OneOrSeveral, check_count, several
from socialcircle_ros.engine import Engine
from socialcircle_ros.errors import SettingError, shown
from socialcircle_ros.kernels.ordered import in_order
from socialcircle_ros.pictures.style import new_figure
from socialcircle_ros.settings import (
    CircleSettings,
    FocusSettings,
    RosValue,
    Settings,
    StackSettings,
    yaml_text,
)
from socialcircle_ros.storage import check_folder_name, folder_of_results, write_file

from .clouds import CloudSource, SweptRecording, cached
from .decision import decide
from .journal import TrialJournal, import_optuna
from .page import sweep_page, trials_table
from .result import SweepResult
from .search import Search
from .search_space import (
    Choice,
    ParameterValues,
    SearchDimension,
    check_search_space,
    contains,
    grid,
    setting_as_given,
    with_mode,
)
from .trials import Trial, best_of, fingerprint_of, key_of, run_trial
from .work import SweptClouds, TrialTask, do_trial

PAGE, TABLE, BEST, TRIALS, CANDIDATES = 'sweep.html', 'sweep.csv', 'best.yaml', 'trials.log', 'candidates'

_LESSON = 'circle.lesson'
_GROUPS: tuple[type[Settings], ...] = (FocusSettings, StackSettings, CircleSettings)

TrialRunner = Callable[[Iterable[ParameterValues]], Iterator[Trial]]
"""Runs a trial of each setting, several at once; settings are taken one by one, as trials end."""


def run_sweep(
    recording: str | Path,
    search_space: Sequence[SearchDimension],
    output: str | Path,
    *,
    parameters: Mapping[str, RosValue] | None = None,
    search: int | None = None,
    max_clouds: int = 10,
    topics: OneOrSeveral[str] = (),
    restart: bool = False,
    scheduler: str | None = None,
    started: Callable[[str], None] = lambda dashboard: None,
    progress: Callable[[int, int], None] | None = None,
    made_by: str = 'run_sweep()',
) -> SweepResult:
    """Filter the same clouds of a recording with many settings, and say whether one is better.

    Settings are scored by F1 against the truth where the recording holds one; without one there is no verdict. The
    parameters as given are always tried as well. Several trials run at once, in threads of this process or on a
    Dask cluster. The scores of a setting are the same wherever it is tried. Which settings a search tries depends
    on how many run at once: each is proposed from the trials that are finished by then.

    Writes `sweep.html`, a page with the decision, the candidates side by side, a chart and a table; `sweep.csv`,
    all trials; `candidates/1.yaml` and more, the parameters of each candidate; `best.yaml`, if a setting is better
    than the one as given beyond the spread between the clouds (`sweep.decision.STATISTIC`); and `trials.log`, a
    journal of Optuna. From it the same call continues after an interruption, and several machines that make the
    same call with the same folder, which they share, work on one sweep.

    Args:
        recording: an MCAP file or a rosbag2 directory.
        search_space: the parameters to vary, of the groups `circle` and `focus`. If one has an effect in the mode
            'paper' only, all settings but the one as given are tried in this mode.
        output: the folder of the results; it is created.
        parameters: parameters with other values than their defaults, by their full names. A value of a varied
            parameter is the one that counts as given.
        search: number of settings that Optuna chooses; None: all combinations of the search space.
        max_clouds: most clouds to filter, spread evenly over the recording.
        topics: names of the topics of clouds; empty: all topics named `points`, and all focus stacks.
        restart: whether to delete the trials of an earlier sweep in the folder.
        scheduler: address or scheduler file of a Dask cluster whose workers have this package, and see the
            recording under the same name. None: the cores of this machine.
        started: called with the address of Dask's dashboard, if there is a scheduler.
        progress: called with the number of finished trials and the number of all trials.
        made_by: the command or call that the page names.

    Returns:
        All trials, what can be concluded, and what was refused.

    Raises:
        SettingError: an argument is of the wrong type, a parameter cannot have a value, or the search space cannot
            be swept.
        RecordingError: the recording cannot be read, or no cloud of it can be filtered.
        SocialCircleError: a library is missing, the folder cannot be used, or the workers cannot do a trial.

    Example:
        >>> from socialcircle_ros import run_sweep
        >>> from socialcircle_ros.sweep.search_space import Choice, Range
        >>> result = run_sweep('bags/parts.mcap', [Choice('circle.radius_scale', [0.5, 1.0, 1.5])], 'out/sweep')
        >>> result = run_sweep('bags/parts.mcap', [Range('circle.radius_scale', 0.5, 3)], 'out/search', search=20)
    """
    recording, output, names = Path(recording), Path(output), several(topics)
    _check_arguments(search_space, output, search, max_clouds)
    parameters = {} if parameters is None else parameters
    base = _all_parameters(parameters)
    search_space = with_mode(search_space, base)
    as_given = setting_as_given(search_space, base)
    others = [] if search else [values for values in grid(search_space) if values != as_given]
    _check_extras()
    with folder_of_results(output):
        clouds = cached((recorded := SweptRecording(recording, base, names, max_clouds)).load)
        wanted = [as_given, *others]
        swept = _swept(recording, base, search_space, names, max_clouds, clouds)
        with _trial_runner(swept, base, clouds, scheduler, started) as run:
            journal = TrialJournal(output / TRIALS, swept.fingerprint, restart=restart)
            resumed = len(journal.trials)
            _run_trials(journal, run, wanted, search_space, search, progress)
        trials = _in_order_of(wanted, journal.trials)
        result = _concluded(recording.name, search_space, base, trials, as_given, clouds, recorded, resumed)
        _write_results(output, result, parameters, made_by)
    return result


def _check_arguments(
    search_space: Sequence[SearchDimension], output: Path, search: int | None, max_clouds: int
) -> None:
    check_search_space(search_space)
    check_count('max_clouds', max_clouds)
    if search is not None:
        check_count('search', search)
    check_folder_name(output)


def _swept(
    recording: Path,
    base: ParameterValues,
    search_space: Sequence[SearchDimension],
    topics: tuple[str, ...],
    max_clouds: int,
    clouds: CloudSource,
) -> SweptClouds:
    """What a worker needs to find the same clouds."""
    varied = tuple(dimension.name for dimension in search_space)
    fixed = {name: value for name, value in base.items() if name not in varied}
    lessons = _lessons(base, search_space)
    fingerprint = fingerprint_of(clouds(FocusSettings.from_ros(base)), fixed, lessons)
    return SweptClouds(
        str(recording.absolute()), json.dumps(base), varied, topics, max_clouds, fingerprint, lessons
    )


def _lessons(base: ParameterValues, search_space: Sequence[SearchDimension]) -> tuple[str, ...]:
    """The lesson files of all settings."""
    tried = {base[_LESSON]}
    for dimension in search_space:
        if dimension.name == _LESSON and isinstance(dimension, Choice):
            tried.update(dimension.values)
    return tuple(sorted(str(path) for path in tried if path))


def _concluded(
    name: str,
    search_space: Sequence[SearchDimension],
    base: ParameterValues,
    trials: Sequence[Trial],
    as_given: ParameterValues,
    clouds: CloudSource,
    recorded: SweptRecording,
    resumed: int,
) -> SweepResult:
    """The result of the trials."""
    best = best_of(trials)
    given = next(trial for trial in trials if trial.values == as_given)
    clouds_of_best = clouds(FocusSettings.from_ros(base | best.values))
    return SweepResult(
        recording=name,
        search_space=search_space,
        base=base,
        trials=trials,
        best=best,
        given=given,
        decision=decide(trials, given, has_truth=clouds_of_best[0].has_truth),
        clouds=clouds_of_best,
        resumed=resumed,
        refused=dict(recorded.refused),
        damage=recorded.damage,
    )


def _write_results(output: Path, result: SweepResult, parameters: Mapping[str, RosValue], made_by: str) -> None:
    """Write the table, the page, and the parameter files of the candidates and of the winner."""
    write_file(output / TABLE, trials_table(result).csv())
    write_file(output / PAGE, sweep_page(result, made_by))
    (output / CANDIDATES).mkdir(exist_ok=True)
    for old in (output / BEST, *(output / CANDIDATES).glob('[0-9].yaml')):
        old.unlink(missing_ok=True)
    for number, trial in enumerate(result.decision.candidates, 1):
        content = yaml_text({**parameters, **trial.values}, whole=False)
        write_file(output / CANDIDATES / f'{number}.yaml', content)
        if trial is result.decision.winner:
            write_file(output / BEST, content)


def _all_parameters(given: Mapping[str, RosValue]) -> ParameterValues:
    if not isinstance(given, Mapping):
        raise SettingError(f"parameters must be a mapping, such as {{'circle.window': 5}}, not {shown(given)}.")
    groups = [group.from_ros(given) for group in _GROUPS]
    return {name: value for group in groups for name, value in group.to_ros().items()}


def _check_extras() -> None:
    """Fail where matplotlib or Optuna is missing, before the work and not after it."""
    new_figure(1, 1)
    import_optuna()


@contextmanager
def _trial_runner(
    swept: SweptClouds,
    base: ParameterValues,
    clouds: CloudSource,
    scheduler: str | None,
    started: Callable[[str], None],
) -> Iterator[TrialRunner]:
    """Runs trials in threads, or on the cluster of a scheduler."""
    if scheduler is None:
        # Threads share the clouds in memory; kernels and most of NumPy release the GIL.
        yield lambda settings: in_order(lambda values: run_trial(base, values, clouds), settings)
        return
    with Engine[TrialTask, Trial](scheduler) as engine:
        started(engine.dashboard)

        def run(settings: Iterable[ParameterValues]) -> Iterator[Trial]:
            tasks = (TrialTask(swept, values) for values in settings)
            for _, result in engine.run(do_trial, tasks, eager=False):
                if isinstance(result, Exception):
                    raise result
                yield result

        yield run


def _run_trials(
    journal: TrialJournal,
    run: TrialRunner,
    wanted: Sequence[ParameterValues],
    search_space: Sequence[SearchDimension],
    search: int | None,
    progress: Callable[[int, int], None] | None,
) -> None:
    """Run the trials that the journal does not hold yet: first `wanted`, then those of a search."""
    keys = {key_of(values) for values in wanted}

    def report() -> None:
        if progress is not None:
            found = journal.trials
            done = len(found) if search else sum(key_of(trial.values) in keys for trial in found)
            progress(done, search or len(wanted))

    def finish(trial: Trial) -> None:
        journal.add(trial)
        report()

    report()
    # Machines that work on one grid each take their own way through it, so that they seldom try a setting twice.
    shuffled = random.sample(wanted[1:], len(wanted) - 1)
    for trial in run(journal.untried([wanted[0], *shuffled])):
        finish(trial)
    if search:
        # The setting as given counts, whether or not it is a point of the search space.
        count = search - (not contains(search_space, wanted[0]))
        study = Search(search_space, count, journal.trials, journal.storage, journal.fingerprint)
        for trial in run(study):
            study.tell(trial)
            finish(trial)


def _in_order_of(wanted: Sequence[ParameterValues], trials: Sequence[Trial]) -> list[Trial]:
    """The trials in the order of a grid, then all others."""
    places = {key_of(values): place for place, values in enumerate(wanted)}
    return sorted(trials, key=lambda trial: places.get(key_of(trial.values), len(places)))
