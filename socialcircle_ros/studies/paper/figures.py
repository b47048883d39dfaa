"""Figures 4, 8, 10 and 11 of the paper, on clouds of known truth."""

from collections.abc import Sequence
from itertools import product

import numpy as np

from socialcircle_ros.circle.seed import SIDE, choose_region, elect_seed
from socialcircle_ros.cloud import Mask
from socialcircle_ros.metrics.areal import texture
from socialcircle_ros.metrics.scores import rmse
from socialcircle_ros.repair import repair_holes
from socialcircle_ros.report.content import Cell, Column, Picture, Section, Table
from socialcircle_ros.settings import RepairMethod, RepairSettings
from socialcircle_ros.studies.comparison import drawings
from socialcircle_ros.studies.comparison.labelled_clouds import TITLES, LabelledCloud, OutlierKind, synthetic_cloud
from socialcircle_ros.studies.comparison.methods import Method
from socialcircle_ros.studies.comparison.study import Study

_LITTLE, _HEAVY = 0.02, 0.45
_REPAIRS: tuple[RepairMethod, ...] = ('spline', 'biharmonic')
_REPAIR_NAMES = {'spline': 'spline (the paper’s)', 'biharmonic': 'biharmonic'}


def figure4(study: Study) -> list[Section]:
    """Whether the best-voted point is good, with few and with many outliers in the vote region."""
    rows: list[list[Cell]] = []
    panels = []
    kinds: tuple[OutlierKind, ...] = ('isolated', 'clustered')
    conditions = product(TITLES, kinds, (_LITTLE, _HEAVY), ('chosen', 'anywhere'))
    for scene, kind, share, where in conditions:
        study.tell(f'{scene}: electing seeds among {100 * share:g} % {kind} outliers')
        good, shares = [], []
        for number in range(study.plan.votes):
            cloud, region, seed = _election(
                scene, study.plan.smaller, study.plan.seeds[0] + number, kind, share, where
            )
            good.append(bool(cloud.counted[seed] and not cloud.outlier[seed]))
            shares.append(float(cloud.outlier[region].mean()))
            if scene == 'metal_groove' and kind == 'clustered' and where == 'anywhere' and number == 0:
                title = f'{100 * shares[-1]:.0f} % outliers: the seed is {"good" if good[-1] else "an outlier"}'
                panels.append((title, cloud, region, seed))
        rows.append([TITLES[scene], kind, share, where, float(np.mean(shares)), sum(good), len(good)])
    columns = [
        Column('scene'), Column('outliers'), Column('share in the cloud', '.0%'), Column('vote region'),
        Column('share in the region', '.1%'), Column('good seeds', 'd'), Column('of', 'd'),
    ]  # fmt: skip
    text = (
        'The paper holds that the point with the most votes is always a good one. In each line clouds of other'
        f' seeds elect theirs, in a region of {SIDE}×{SIDE} points: chosen, as the filter does when nothing else'
        ' is said (the smoothest, most fully measured), or anywhere, by chance.'
    )
    caption = (
        'As the paper’s figure 4: the vote region with few and with many outliers, and the elected seed, for the'
        ' metal groove, clustered outliers, and a region anywhere in the cloud.'
    )
    return [
        Section(
            'Figure 4: is the elected seed a good point?',
            [text],
            findings=[_good_seeds(rows, where) for where in ('chosen', 'anywhere')],
            items=[
                Picture('figure4', drawings.elections(panels), caption),
                Table('figure4', 'Elections that a good point won', columns, rows),
            ],
        )
    ]


def _election(
    scene: str, size: tuple[int, int], seed: int, kind: OutlierKind, share: float, where: str
) -> tuple[LabelledCloud, tuple[slice, slice], tuple[int, int]]:
    """A cloud, its vote region, and the row and column that won."""
    cloud = synthetic_cloud(scene, size, seed, kind, share)
    if where == 'chosen':
        region = choose_region(cloud.points)
    else:
        places = np.random.default_rng(seed)
        top, left = (int(places.integers(extent - SIDE)) for extent in cloud.outlier.shape)
        region = top, left, SIDE, SIDE
    top, left, height, width = region
    return cloud, (slice(top, top + height), slice(left, left + width)), elect_seed(cloud.points, region)


def _good_seeds(rows: Sequence[Sequence[Cell]], where: str) -> str:
    """How often a good point won, in one sentence."""
    parts = []
    for share in (_LITTLE, _HEAVY):
        counts = [(row[5], row[6]) for row in rows if row[3] == where and row[2] == share]
        good, total = (sum(int(pair[i] or 0) for pair in counts) for i in (0, 1))
        parts.append(f'{good} of {total} elections with {100 * share:g} % outliers')
    place = 'in the region that the filter chooses' if where == 'chosen' else 'in a region anywhere in the cloud'
    return f'The elected seed, {place}, is a good point in {parts[0]} and in {parts[1]}.'


def figure8(study: Study) -> list[Section]:
    """What each filter leaves and removes, at its default and at its best."""
    pictures = []
    for scene, from_stack in study.plan.scenes:
        methods = study.methods(scene, from_stack=from_stack)
        study.tell(f'{scene}: drawing what each filter removed')
        cloud = study.cloud(scene, study.plan.seeds[0], from_stack=from_stack)
        for variant in study.plan.drawn:
            answers = [(each.label, each(cloud.points).outliers) for each in methods if each.variant == variant]
            pictures.append(
                Picture(
                    f'figure8_{scene}{"_stack" if from_stack else ""}_{variant}',
                    drawings.removal_maps(cloud, answers),
                    f'{cloud.title}, {variant} settings. Above: the heights that remain, white where nothing'
                    ' is left.'
                    ' Below: the framed part, where outliers are densest, and what each filter did there.',
                )
            )
    return [Section('Figure 8: what each filter removes', items=pictures)]


def figure10(study: Study) -> list[Section]:
    """The metal groove, and the steep one that the exact mode cannot climb, filtered and repaired."""
    return [
        _repaired(study, 'metal_groove', 'Figure 10: the metal groove, filtered and repaired'),
        _repaired(study, 'steep_groove', 'Beyond figure 10: the steep groove, filtered and repaired'),
    ]


def figure11(study: Study) -> list[Section]:
    """The composite material, filtered and repaired."""
    return [_repaired(study, 'composite', 'Figure 11: the composite material, filtered and repaired')]


def _repaired(study: Study, scene: str, head: str) -> Section:
    methods = study.methods(scene)
    clouds = []
    for seed in study.plan.seeds:
        study.tell(f'{scene}: making the cloud of seed {seed}')
        clouds.append(study.cloud(scene, seed))
    rows: list[list[Cell]] = [['nothing', 'none', *_mean_quality([(s.points, s) for s in clouds])]]
    drawn = []
    for each in methods:
        study.tell(f'{scene}: repairing after {each.label}')
        answers = [each(cloud.points).outliers for cloud in clouds]
        for repair in _REPAIRS:
            settings = RepairSettings(method=repair)
            repaired = [_filled(s, mask, settings) for s, mask in zip(clouds, answers, strict=True)]
            rows.append(
                [each.label, _REPAIR_NAMES[repair], *_mean_quality(list(zip(repaired, clouds, strict=True)))]
            )
            if _is_drawn(each, repair):
                drawn.append((f'{each.label}\n{_REPAIR_NAMES[repair]}', repaired[0][..., 2]))
    study.tell(f'{scene}: drawing the repaired surfaces')
    name = f'repaired_{scene}'
    columns = [
        Column('filter'), Column('repair'), Column('RMSE [µm]', '.3f'), Column('points with a height', '.2%'),
        *(Column(f'{texture_name} change', '+.2%') for texture_name in ('Sa', 'Sq', 'Sz')),
    ]  # fmt: skip
    note = (
        'RMSE: heights after filtering and repair against the true surface, wherever there is a height (holes of'
        ' more than 1000 points, and those without a rim on three sides, stay empty, so that RMSE and the share'
        ' of points with a height go together). Sa, Sq, Sz: ISO 25178-2 after levelling, relative to the true'
        ' surface. Measurement noise is part of all of them.'
    )
    caption = (
        f'{TITLES[scene]}: the part where outliers are densest, after filtering at the best settings and repair.'
        ' White: no height. Below: distance to the true surface, on a logarithmic scale.'
    )
    return Section(
        head,
        findings=[_ranking(TITLES[scene], rows)],
        items=[
            Picture(name, drawings.repaired_surfaces(clouds[0], drawn), caption),
            Table(name, f'{TITLES[scene]}, filtered and repaired', columns, rows, note),
        ],
    )


def _is_drawn(each: Method, repair: RepairMethod) -> bool:
    """All filters with the paper's repair, and ours with the better one as well."""
    return each.variant == 'best' and (repair == 'spline' or each.name == 'Social circle')


def _filled(cloud: LabelledCloud, outliers: Mask, settings: RepairSettings) -> drawings.Heights:
    """The cloud without what the filter removed, its holes filled where the settings allow."""
    cleaned = cloud.points.copy()
    cleaned[outliers, 2] = np.nan
    filled: drawings.Heights = repair_holes(cleaned, ~np.isfinite(cleaned[..., 2]), settings).xyz
    return filled


def _mean_quality(clouds: Sequence[tuple[drawings.Heights, LabelledCloud]]) -> list[Cell]:
    """RMSE, share of points with a height, and relative change of Sa, Sq and Sz: means over the clouds."""
    found = []
    for points, cloud in clouds:
        z = points[..., 2]
        now, true = texture(z), texture(cloud.z_true)
        changes = [now.sa / true.sa - 1, now.sq / true.sq - 1, now.sz / true.sz - 1]
        found.append([rmse(z, cloud.z_true), float(np.isfinite(z).mean()), *changes])
    return [float(value) for value in np.mean(found, axis=0)]


_WHOLE = 0.95
"""Share of the points that must have a height for an RMSE to speak of the whole surface."""


def _ranking(title: str, rows: Sequence[Sequence[Cell]]) -> str:
    """Where the social circle stands by RMSE with the paper's repair, and what the biharmonic repair changes."""
    spline = [row for row in rows if row[1] == _REPAIR_NAMES['spline']]
    ours = next(row for row in spline if row[0] == 'Social circle, default')
    other = next(row for row in rows if row[0] == ours[0] and row[1] == _REPAIR_NAMES['biharmonic'])
    whole = sorted((row for row in spline if _number(row[3]) >= _WHOLE), key=lambda row: _number(row[2]))
    lowest = f'; the lowest RMSE is {whole[0][2]:.3f} µm ({whole[0][0]})' if whole else ''
    head = f'{title}, filtered and repaired with the paper’s spline: the social circle (default)'
    if ours not in whole:
        return (
            f'{head} leaves no whole surface, {_number(ours[3]):.1%} of the points have a height; {len(whole)} of'
            f' {len(spline)} filters leave at least {_WHOLE:.0%}{lowest}.'
        )
    return (
        f'{head} has an RMSE of {ours[2]:.3f} µm, number {whole.index(ours) + 1} of the {len(whole)} that leave'
        f' at least {_WHOLE:.0%} of the points with a height{lowest}. The biharmonic repair makes it'
        f' {other[2]:.3f} µm.'
    )


def _number(cell: Cell) -> float:
    return float(cell or 0)
