"""Whether the adaptive mode reaches its goals: one setting, on simulated and on measured surfaces."""

import time
from collections.abc import Callable, Iterator, Sequence
from statistics import median

import numpy as np
import numpy.typing as npt

from socialcircle_ros.baselines import peers
from socialcircle_ros.baselines.settings import MedianSettings, RadiusSettings, StatisticalSettings
from socialcircle_ros.circle import CircleResult, remove_outliers
from socialcircle_ros.circle.seed import choose_region
from socialcircle_ros.cloud import Mask
from socialcircle_ros.metrics.scores import Scores, score
from socialcircle_ros.report.content import Cell, Column, Picture, Section, Table
from socialcircle_ros.settings import CircleSettings
from socialcircle_ros.simulation import make_scene
from socialcircle_ros.studies.comparison import drawings
from socialcircle_ros.studies.comparison.labelled_clouds import LabelledCloud, scanned_cloud, synthetic_cloud
from socialcircle_ros.studies.comparison.measured import MeasuredCloud
from socialcircle_ros.studies.comparison.methods import FilterSettings, in_words, method
from socialcircle_ros.studies.comparison.search import best_settings
from socialcircle_ros.studies.comparison.study import Study, judged

from .goals import Goal, goals_table
from .inserted_outliers import MeasuredSurface, insert_outliers, measured_surface
from .leave_one_out import leave_one_out

SEEDS = tuple(range(301, 321))
"""Of the simulated stacks: nothing was chosen on them."""
CONTROLS = ('alicona_fv_al3d1', 'alicona_fv_rubber')
"""Surfaces of the data folder on which nothing is wrong."""
SHARES = (0.01, 0.05, 0.15, 0.3)
"""Of outliers that are put into measured surfaces."""

_ADAPTIVE = CircleSettings(mode='adaptive')
_OTHERS: tuple[type[FilterSettings], ...] = (RadiusSettings, StatisticalSettings, MedianSettings)
_BREAKING = ('quantised', 'islands', 'discs', 'closed_groove', 'steep_groove', 'steps')
_LOADS = 5
_SIZES = ((240, 320), (480, 640), (960, 1280), (1920, 2560))
_FULL = (960, 1280)

Part = tuple[list[Section], list[Goal]]
Points = npt.NDArray[np.float32]


def adaptive(study: Study, real: Sequence[MeasuredCloud]) -> list[Section]:
    """Everything that the goals ask, the goals first.

    Args:
        study: its plan says how large, how often and on which seeds.
        real: measured surfaces; without them what they would show is left out.
    """
    surfaces = [measured_surface(cloud) for cloud in real]
    parts = [_stacks(study)]
    if surfaces:
        parts += [_contaminated(study, surfaces), _untouched(study, surfaces)]
    if len(surfaces) > 1:
        section, goal = leave_one_out(surfaces, study.plan.seeds[:_LOADS], study.tell)
        parts.append(([section], [goal]))
    parts += [_breaking(study), _decisions(study), _scales(study), _times(study)]
    goals = [goal for _, some in parts for goal in some]
    first = Section(
        'Goals', findings=[goal.sentence for goal in goals], items=[goals_table('adaptive_goals', goals)],
        warnings=() if surfaces else ['No measured surfaces were given (--data): their goals are left out.'],
    )  # fmt: skip
    return [first, *(section for sections, _ in parts for section in sections)]


def _find(points: Points) -> Mask:
    return remove_outliers(points, _ADAPTIVE).outliers


def _find_of(cloud: LabelledCloud) -> Mask:
    settings = _ADAPTIVE.of_a_stack(cloud.depth_of_field)
    return remove_outliers(cloud.points, settings).outliers


def _stacks(study: Study) -> Part:
    """Clouds from rendered focus stacks, against the other filters with settings tuned on these very clouds."""
    rows: list[list[Cell]] = []
    pictures = []
    goals = []
    for specimen, title, asked in (('flat', 'flat rough surface', 0.98), ('steep_groove', 'steep groove', 0.95)):
        study.tell(f'{specimen}: scanning {len(study.plan.seeds)} focus stacks')
        clouds = [scanned_cloud(specimen, study.plan.smaller, seed) for seed in study.plan.seeds]
        ours = [judged(_find_of(cloud), cloud) for cloud in clouds]
        rows.append([title, 'adaptive', 'none to set', *_summary(ours)])
        others = []
        for kind in _OTHERS:
            study.tell(f'{specimen}: tuning {kind.__name__.removesuffix("Settings").lower()} on the answer')
            tuned = method(best_settings(kind, clouds), 'best')
            others.append((tuned, [judged(tuned(cloud.points).outliers, cloud) for cloud in clouds]))
            rows.append([title, tuned.name, in_words(tuned.settings), *_summary(others[-1][1])])
        best, strongest = max(others, key=lambda each: _median_f1(each[1]))
        where = f'Stacks, {title}, {len(clouds)} seeds'
        goals.append(Goal(f'{where}: median F1', _median_f1(ours), asked))
        if specimen == 'flat':
            lost = sum(own.f1 < other.f1 for own, other in zip(ours, strongest, strict=True))
            goals.append(Goal(f'{where}: lost to the best tuned filter', lost, 0, least=False, form='.0f'))
        else:
            false = median(each.false_positive_rate for each in ours)
            lead = _median_f1(ours) - _median_f1(strongest)
            goals.append(Goal(f'{where}: median false-positive rate', false, 0.005, least=False, form='.2%'))
            goals.append(Goal(f'{where}: lead in F1 over the best tuned filter', lead, 0.05, form='+.3f'))
        answers = [('adaptive', _find_of(clouds[0])), (best.name, best(clouds[0].points).outliers)]
        pictures.append(
            Picture(
                f'adaptive_stack_{specimen}',
                drawings.removal_maps(clouds[0], answers),
                f'{clouds[0].title}, seed {study.plan.seeds[0]}: what remains, and what was right and wrong.',
            )
        )
    columns = [
        Column('surface'), Column('filter'), Column('settings'), Column('F1, median', '.3f'),
        Column('least', '.3f'), Column('precision', '.3f'), Column('recall', '.3f'),
        Column('false positives', '.2%'),
    ]  # fmt: skip
    text = (
        'Outliers come out of the physics: where the images tell too little, depth is wrong. The other filters'
        ' have the settings that do best on these very clouds. The adaptive mode has the heights'
        ' and the depth of field that the focus curves of the stack tell, nothing else.'
    )
    table = Table('adaptive_stacks', 'Focus stacks; medians over the seeds', columns, rows)
    return [Section('Simulated focus stacks', [text], items=[table, *pictures])], goals


def _summary(scores: Sequence[Scores]) -> list[Cell]:
    medians = [median(getattr(each, name) for each in scores) for name in ('precision', 'recall')]
    false = median(each.false_positive_rate for each in scores)
    return [_median_f1(scores), min(each.f1 for each in scores), *medians, false]


def _median_f1(scores: Sequence[Scores]) -> float:
    return median(each.f1 for each in scores)


def _contaminated(study: Study, surfaces: Sequence[MeasuredSurface]) -> Part:
    """Measured surfaces with outliers put in, against the median residual tuned on the answer."""
    rows: list[list[Cell]] = []
    loads = 1 if len(study.plan.seeds) == 1 else _LOADS
    for bare in surfaces:
        for share in SHARES:
            study.tell(f'{bare.cloud.name}: {100 * share:g} % outliers put in')
            scores, peer = [], []
            for seed in study.plan.seeds[:loads]:
                contaminated = insert_outliers(bare, share, seed)
                scores.append(score(_find(contaminated.points), contaminated.outlier, contaminated.counted))
                peer.append(contaminated.best_median())
            own = _median_f1(scores)
            recall = median(each.recall for each in scores)
            false = median(each.false_positive_rate for each in scores)
            rows.append([bare.cloud.name, share, own, recall, false, median(peer), own - median(peer)])
    at_five = [float(row[2] or 0) for row in rows if row[1] == 0.05]
    worst = min(rows, key=lambda row: float(row[6] or 0))
    goals = [
        Goal(f'{len(surfaces)} measured surfaces, 5 % put in: median F1', median(at_five), 0.92),
        Goal(
            'Measured surfaces, 1 to 30 %: least lead in F1 over the tuned median residual'
            f' ({worst[0]}, {worst[1]:.0%})',
            float(worst[6] or 0), 0.1, form='+.3f',
        ),
    ]  # fmt: skip
    columns = [
        Column('surface'), Column('put in', '.0%'), Column('F1', '.3f'), Column('recall', '.3f'),
        Column('false positives', '.2%'), Column('tuned median: F1', '.3f'), Column('lead', '+.3f'),
    ]  # fmt: skip
    text = (
        'Half of the outliers stand alone, half in clusters of 2 to 8 points radius with sharp or blurred flanks;'
        ' 8 to 40 σ off, σ being the surface’s own residual to a 5×5 median. Points further than 10 robust σ from'
        ' the 11×11 median of the surface as it came do not count. The other filter is |z − median 11×11| with'
        f' the best threshold for each single cloud. Medians over {loads} seeds.'
    )
    table = Table('adaptive_real', 'Outliers put into measured surfaces', columns, rows)
    return [Section('Measured surfaces with outliers put in', [text], items=[table])], goals


def _untouched(study: Study, surfaces: Sequence[MeasuredSurface]) -> Part:
    """Measured surfaces as they came: what is removed that is plausible, and which spikes are caught."""
    rows: list[list[Cell]] = []
    pictures = []
    for bare in surfaces:
        study.tell(f'{bare.cloud.name}: as it came')
        found = _find(bare.cloud.points)
        removed = float(found[bare.plausible].mean())
        caught = float(found[bare.spikes].mean()) if bare.spikes.any() else None
        rows.append([bare.cloud.name, removed, int(np.count_nonzero(bare.spikes)), caught])
        if bare.spikes.any():
            pictures.append(
                Picture(
                    f'adaptive_spikes_{bare.cloud.name}',
                    drawings.spikes(bare.cloud.points[..., 2], bare.cloud.unit, bare.spikes, found),
                    f'{bare.cloud.name} as it came: all of it, and the part where most points stand more than'
                    ' 10 robust σ off the 11×11 median.',
                )
            )
    others = [float(row[1] or 0) for row in rows]
    controls = [float(row[1] or 0) for row in rows if row[0] in CONTROLS]
    goals = [
        Goal(
            'Untouched surfaces: plausible points removed, the worst', max(others), 0.003, least=False, form='.2%'
        ),
    ]
    if controls:
        goals.append(
            Goal(
                'Clean controls: plausible points removed, the worse',
                max(controls),
                0.001,
                least=False,
                form='.2%',
            )
        )
    columns = [
        Column('surface'), Column('plausible points removed', '.3%'), Column('beyond 10 σ', ',d'),
        Column('of those removed', '.1%'),
    ]  # fmt: skip
    text = (
        'Nobody knows what is wrong here. Plausible are points within 10 robust σ of the 11×11 median; beyond are'
        ' spikes, but also the edges of pits and steep walls that belong to the part: look at the pictures.'
    )
    table = Table('adaptive_untouched', 'Measured surfaces as they came', columns, rows)
    return [Section('Measured surfaces as they came', [text], items=[table, *pictures])], goals


def _breaking(study: Study) -> Part:
    """Simulated surfaces on which nothing is wrong, and which look as if."""
    rows: list[list[Cell]] = []
    seeds = study.plan.seeds[:_LOADS]
    for scene in _BREAKING:
        study.tell(f'{scene}: nothing is wrong')
        clouds = [make_scene(scene, *study.plan.smaller, seed=seed, share=0.0).points for seed in seeds]
        shares = [float(_find(points).mean()) for points in clouds]
        rows.append([scene, median(shares), max(shares)])
    worst = max(rows, key=lambda row: float(row[2] or 0))
    goal = Goal(
        f'Surfaces that break prototypes: removed, the worst ({worst[0]})',
        float(worst[2] or 0),
        0.005,
        least=False,
        form='.2%',
    )
    columns = [Column('surface'), Column('removed, median', '.3%'), Column('most', '.3%')]
    table = Table('adaptive_breaking', f'Nothing is wrong here; {len(seeds)} seeds', columns, rows)
    return [Section('Surfaces that break prototypes', items=[table])], [goal]


def _decisions(study: Study) -> Part:
    """Clouds that are hard to decide: right, refused with a reason, or silently wrong."""
    rows: list[list[Cell]] = []
    for name, cloud in _hard_cases(study.plan.smaller, study.plan.seeds[0]):
        study.tell(name)
        result = remove_outliers(cloud.points, _ADAPTIVE)
        scores = judged(result.outliers, cloud)
        recall = scores.recall if cloud.outlier.any() else None
        rows.append([name, recall, scores.false_positive_rate, _decision(result, scores)])
    silent = sum(row[3] == _SILENT for row in rows)
    goal = Goal('Clouds that are hard to decide: silently wrong', silent, 0, least=False, form='.0f')
    columns = [Column('cloud'), Column('recall', '.3f'), Column('false positives', '.2%'), Column('answer')]
    text = (
        f'Right: at most {_FEW:.1%} of the good points removed, and of the outliers, if there are any, at least'
        f' {_MOST:.0%}. What is not right must come with a warning.'
    )
    table = Table('adaptive_decisions', 'Clouds that are hard to decide', columns, rows)
    return [Section('Right, or refused', [text], items=[table])], [goal]


_FEW, _MOST = 0.005, 0.9
_RIGHT, _REFUSED, _SILENT = 'right', 'warned', 'silently wrong'


def _decision(result: CircleResult, scores: Scores) -> str:
    # Without an outlier recall is NaN, and not below anything.
    if scores.false_positive_rate <= _FEW and not scores.recall < _MOST:
        return _RIGHT
    return _REFUSED if result.warnings else _SILENT


def _hard_cases(size: tuple[int, int], seed: int) -> Iterator[tuple[str, LabelledCloud]]:
    """A cluster where the vote is held, steps that are none of the outliers', and heavy contamination."""
    flat = synthetic_cloud('flat', size, seed, share=0.0)
    sigma = float(np.nanstd(flat.points[..., 2] - flat.z_true))
    top, left, height, width = choose_region(flat.points)
    rows, columns = np.ogrid[: size[0], : size[1]]
    middle_row, middle_column = top + height // 2, left + width // 2
    cluster = (rows - middle_row) ** 2 + (columns - middle_column) ** 2 <= 8**2
    patch = (abs(rows - middle_row) < height // 3) & (abs(columns - middle_column) < width // 3)
    half = np.broadcast_to(columns >= size[1] // 2, size)
    nobody = np.zeros(size, np.bool_)
    yield (
        'cluster of 8 points radius in the middle of the vote region',
        _raised(flat, cluster, 30 * sigma, cluster),
    )
    yield 'patch with a step in the vote region', _raised(flat, patch, 30 * sigma, nobody)
    yield 'two plateaus', _raised(flat, half, 50 * sigma, nobody)
    for kind in ('isolated', 'clustered'):
        yield f'45 % {kind} outliers', synthetic_cloud('metal_groove', size, seed, kind, 0.45)


def _raised(flat: LabelledCloud, where: Mask, step: float, outlier: Mask) -> LabelledCloud:
    points = flat.points.copy()
    points[where, 2] += step
    measured = np.isfinite(points[..., 2])
    return LabelledCloud(flat.title, points, outlier & measured, measured, flat.z_true, flat.pitch, {})


def _scales(study: Study) -> Part:
    """How many points of the mask another unit changes."""
    study.tell('other units')
    points = synthetic_cloud('flat', study.plan.smaller, study.plan.seeds[0]).points
    plain = _find(points)
    rows: list[list[Cell]] = []
    for name, factors in (
        ('z · 10⁻³', (1, 1, 1e-3)), ('z · 10³', (1, 1, 1e3)), ('z · 2⁻¹⁰', (1, 1, 2**-10)),
        ('z · 2¹⁰', (1, 1, 2**10)), ('x, y · 7.3', (7.3, 7.3, 1)), ('x · 0.01', (0.01, 1, 1)),
    ):  # fmt: skip
        changed = np.count_nonzero(_find(points * np.array(factors, np.float32)) != plain)
        rows.append([name, int(changed), changed / plain.size])
    most = max(float(row[1] or 0) for row in rows)
    goal = Goal(
        'Another unit of z, x or y: points of the mask that change, the most', most, 0, least=False, form='.0f'
    )
    text = 'Factors that are powers of two change no digit, the others round each height.'
    columns = [Column('unit'), Column('points that change', 'd'), Column('share', '.4%')]
    table = Table('adaptive_scales', 'The same cloud in other units', columns, rows)
    return [Section('Scale', [text], items=[table])], [goal]


def _times(study: Study) -> Part:
    """How time grows with the points, and PCL's statistical filter beside it where it is installed."""
    rows: list[list[Cell]] = []
    sizes = _SIZES if len(study.plan.seeds) > 1 else _SIZES[:2]
    times = {}
    for size in sizes:
        study.tell(f'timing {size[1]}×{size[0]}')
        points = make_scene('metal_groove', *size, seed=study.plan.seeds[0]).points
        times[size] = _shortest(lambda points=points: _find(points), study.plan.repeats)  # type: ignore[misc]
        count = size[0] * size[1]
        rows.append([f'{size[1]}×{size[0]}', count, 1e3 * times[size], 1e9 * times[size] / count])
    middle = sizes[1]
    more = sizes[-1][0] * sizes[-1][1] / (middle[0] * middle[1])
    goals = []
    if more > 1:
        grown = float(np.log(times[sizes[-1]] / times[middle]) / np.log(more))
        goals.append(Goal('Time grows as points to the power of', grown, 1.15, least=False, form='.2f'))
    if _FULL in times and peers.pcl_is_installed():
        study.tell('PCL’s statistical filter')
        cloud = make_scene('metal_groove', *_FULL, seed=study.plan.seeds[0]).points
        theirs = peers.pcl_statistical_filter(cloud).milliseconds
        rows.append([f'{_FULL[1]}×{_FULL[0]}, PCL statistical', _FULL[0] * _FULL[1], theirs, None])
        ratio = theirs / (1e3 * times[_FULL])
        goals.append(Goal('Times as fast as PCL’s statistical filter, 1280×960', ratio, 10, form='.1f'))
    columns = [Column('cloud'), Column('points', ',d'), Column('ms', '.0f'), Column('ns a point', '.0f')]
    text = 'The shortest of several times, as other work on the machine only ever adds.'
    table = Table('adaptive_times', 'Time of the adaptive mode', columns, rows)
    return [Section('Time', [text], items=[table])], goals


def _shortest(call: Callable[[], object], repeats: int) -> float:
    """Seconds, after one call that is not counted."""
    call()
    taken = []
    for _ in range(repeats):
        began = time.perf_counter()
        call()
        taken.append(time.perf_counter() - began)
    return min(taken)
