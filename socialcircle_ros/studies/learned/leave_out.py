# SPDX-License-Identifier: Apache-2.0
"""`python -m socialcircle_ros.studies.learned.leave_out`: each instrument left out of a short training.

All trainings begin with the same weights, which have seen simulated surfaces alone. Then one continues on the
surfaces of all instruments, and for each group of instruments one on those of all others. Their difference on a
surface is what knowing its instrument is worth.
"""

import csv
import io
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import NamedTuple

import click
import numpy as np

from socialcircle_ros.circle.adaptive import find_probable_outliers
from socialcircle_ros.circle.network import NetworkJudge
from socialcircle_ros.circle.network.features import CHANNELS_VERSION
from socialcircle_ros.errors import SocialCircleError, install_command
from socialcircle_ros.kernels.machine import usable_cores
from socialcircle_ros.storage import write_file
from socialcircle_ros.studies.adaptive.inserted_outliers import StudiedSurface, insert_outliers

from . import options
from .evaluation import CHECKS
from .surfaces import instrument_of, read_surfaces

_BATCH, _RATE = 16, 2e-3
_LARGE = 5
"""An instrument of so many surfaces has two files of the corpus; any other has one."""


class Fold(NamedTuple):
    """Instruments that one training leaves out; none for the training on all.

    Attributes:
        name: of its folder.
        instruments: that are left out.
    """

    name: str
    instruments: Sequence[str]


class Scored(NamedTuple):
    """How one training judges one surface.

    Attributes:
        f1: for each check.
        removed: share of the plausible points of the untouched surface.
    """

    f1: list[float]
    removed: float


def folds_of(instruments: Sequence[str], number: int) -> list[Fold]:
    """Distribute the instruments, each to one fold; there are at most as many folds as instruments."""
    number = min(number, len(instruments))
    return [Fold(f'without-{place}', instruments[place::number]) for place in range(number)]


@click.command(
    'leave_out',
    epilog='Example: python -m socialcircle_ros.studies.learned.leave_out --work /tmp/folds -o folds.csv',
)
@options.data
@options.work
@click.option('-o', '--output', 'out', type=click.Path(path_type=Path), required=True, help='CSV file to write.')
@click.option(
    '--folds', type=click.IntRange(1), default=4, show_default=True, help='Trainings that leave instruments out.'
)
@click.option('--simulated', default=12, show_default=True, help='Files of simulated surfaces: 100 patches each.')
@click.option('--first', default=5000, show_default=True, help='Steps on simulated surfaces, for all trainings.')
@click.option('--steps', default=2000, show_default=True, help='Steps of each training on real surfaces.')
@click.option('--seed', default=1, show_default=True, help='Decides the corpus, the weights and the crops.')
@click.option('--outliers', default=401, show_default=True, help='Seed of the outliers that are put in.')
def command(
    data: Path, work: Path, out: Path, folds: int, simulated: int, first: int, steps: int, seed: int, outliers: int
) -> None:
    """Measure what the network finds on instruments that it was not trained on, for every instrument.

    The trainings are short, so that the figures are lower than those of a long training. A CPU takes hours.
    """
    try:
        from . import training  # noqa: F401 PLC0415 - needs PyTorch
        from .corpus import RECIPE  # noqa: PLC0415
    except ImportError as error:
        raise click.ClickException(f'The training needs {error.name}: {install_command("train")}.') from None

    def progress(line: str) -> None:
        click.echo(line, err=True)

    surfaces = read_surfaces(data)
    if not surfaces:
        raise click.BadParameter(f'{data} holds no surface to train on.', param_hint='--data')
    instruments = sorted({instrument_of(surface.cloud.name) for surface in surfaces})
    names = [surface.cloud.name for surface in surfaces]
    chosen = {'folds': folds, 'simulated': simulated, 'first': first, 'steps': steps, 'seed': seed}
    made_of = {'channels': CHANNELS_VERSION, 'recipe': RECIPE, 'surfaces': names}
    _require_same(work / 'options.json', {**chosen, **made_of})
    corpora = _make_corpora(work / 'corpus', surfaces, instruments, simulated, seed, progress)
    start = work / 'simulated'
    _train(start, [corpora['']], None, first, seed, progress)
    scored: list[dict[str, Scored]] = []
    for plan in ([Fold('all', [])], folds_of(instruments, folds)):
        scores: dict[str, Scored] = {}
        for fold in plan:
            known = [corpora[each] for each in ('', *instruments) if each not in fold.instruments]
            network = _train(work / fold.name, known, start / 'trained.onnx', steps, seed, progress)
            judge = NetworkJudge(network, usable_cores())
            for surface in surfaces:
                name = surface.cloud.name
                if not fold.instruments or instrument_of(name) in fold.instruments:
                    progress(f'{fold.name}: {name}')
                    scores[name] = _score(surface, judge, outliers)
        scored.append(scores)
    write_file(out, _table(*scored))
    for line in _summary(*scored):
        click.echo(line)
    click.echo(f'{out} written.')


def _require_same(path: Path, options: Mapping[str, object]) -> None:
    """Write the options beside what is made with them, and refuse to go on with others.

    Raises:
        SocialCircleError: the work was begun with other options or on other surfaces.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    if not any(path.parent.iterdir()):
        write_file(path, json.dumps(options))
    elif not path.exists() or json.loads(path.read_text(encoding='utf-8')) != options:
        raise SocialCircleError(f'{path.parent} was begun with other options or surfaces: give another --work.')


def _make_corpora(
    folder: Path,
    surfaces: Sequence[StudiedSurface],
    instruments: Sequence[str],
    simulated: int,
    seed: int,
    progress: Callable[[str], None],
) -> dict[str, Path]:
    """Make the corpus of each instrument, and that of simulated surfaces, with the name ''."""
    from .corpus import make_corpus  # noqa: PLC0415 - needs SciPy
    from .measured import training_surfaces  # noqa: PLC0415

    folders = {'': folder / 'simulated'}
    make_corpus(folders[''], [], range(1000 * seed, 1000 * seed + simulated), progress)
    for place, instrument in enumerate(instruments):
        own = [surface for surface in surfaces if instrument_of(surface.cloud.name) == instrument]
        first = 1000 * seed + 500 + 2 * place
        folders[instrument] = folder / f'instrument-{place}'
        chosen = training_surfaces(own, ())
        make_corpus(folders[instrument], chosen, range(first, first + 1 + (len(own) >= _LARGE)), progress)
    return folders


def _train(
    folder: Path,
    corpora: Sequence[Path],
    start: Path | None,
    steps: int,
    seed: int,
    progress: Callable[[str], None],
) -> Path:
    """Train on the truth alone: the teacher has seen some of the instruments.

    Returns:
        The ONNX file with 8-bit weights.
    """
    from .export import network_from, write_onnx  # noqa: PLC0415 - needs PyTorch
    from .integers import write_integers  # noqa: PLC0415
    from .training import Corpus, Trainer, Training  # noqa: PLC0415

    out = folder / 'network.onnx'
    if out.exists():
        return out
    folder.mkdir(parents=True, exist_ok=True)
    training = Training(steps, _BATCH, _RATE, seed=seed, trust=0.0)
    trainer = Trainer(Corpus(*corpora, taught=False), training, network_from(start) if start else None)
    state = folder / 'state.pt'
    if state.exists():
        trainer.resume(state)
    trainer.run(state, lambda step, loss: progress(f'{folder.name}: step {step} of {steps}, loss {loss:.4f}'))
    trained = folder / 'trained.onnx'
    write_onnx(trainer.averaged(), {}, trained)
    write_integers(trained, trainer.corpus, out)
    return out


def _score(surface: StudiedSurface, judge: NetworkJudge, seed: int) -> Scored:
    def found(points: np.ndarray) -> np.ndarray:
        return find_probable_outliers(points[..., 2].astype(np.float32), judge.probabilities).outliers

    f1 = []
    for check in CHECKS:
        made = insert_outliers(surface, check.share, seed, check.shapes)
        f1.append(made.score(found(made.points)).f1)
    return Scored(f1, float(found(surface.cloud.points)[surface.plausible].mean()))


def _table(known: dict[str, Scored], unknown: dict[str, Scored]) -> str:
    """Each surface, by a training that knew its instrument, and by one that did not."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator='\n')
    quantities = [*(f'F1, {check.name}' for check in CHECKS), 'untouched: removed, %']
    header = [f'{quantity}: {which}' for quantity in quantities for which in ('known', 'left out')]
    writer.writerow(['surface', 'instrument', *header])
    for name, seen in sorted(known.items()):
        pairs = zip([*seen.f1, 100 * seen.removed], [*unknown[name].f1, 100 * unknown[name].removed], strict=True)
        writer.writerow([name, instrument_of(name), *(f'{value:.3f}' for pair in pairs for value in pair)])
    return out.getvalue()


def _summary(known: dict[str, Scored], unknown: dict[str, Scored]) -> list[str]:
    lines = [f'{len(known)} surfaces: instrument known / left out']
    for place, check in enumerate(CHECKS):
        values = [[each.f1[place] for each in scores.values()] for scores in (known, unknown)]
        lines.append(
            f'{check.name}: median F1 {median(values[0]):.3f} / {median(values[1]):.3f},'
            f' worst {min(values[0]):.3f} / {min(values[1]):.3f}'
        )
    removed = [[each.removed for each in scores.values()] for scores in (known, unknown)]
    lines.append(
        f'untouched: removed {median(removed[0]):.3%} / {median(removed[1]):.3%} (median),'
        f' {max(removed[0]):.2%} / {max(removed[1]):.2%} (worst)'
    )
    return lines


if __name__ == '__main__':
    try:
        command()
    except SocialCircleError as error:
        raise SystemExit(str(error)) from None
