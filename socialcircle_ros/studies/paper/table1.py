# SPDX-License-Identifier: Apache-2.0
"""Table 1 with known truth: good points kept, outliers removed and time of each filter on each scene."""

from collections.abc import Sequence

import numpy as np

from socialcircle_ros.baselines import peers
from socialcircle_ros.metrics.scores import recall_by, roc_area
from socialcircle_ros.report.content import Cell, Column, Section, Table
from socialcircle_ros.studies.comparison.labelled_clouds import (
    NOT_MEASURED,
    PAPER_SCENES,
    TITLES,
    LabelledCloud,
)
from socialcircle_ros.studies.comparison.methods import (
    SETTINGS_TYPES,
    FilterRun,
    Method,
    describe,
    median_times_ms,
    name_of,
    peer_availability,
    peers_of,
)
from socialcircle_ros.studies.comparison.search import SEARCH_SPACES
from socialcircle_ros.studies.comparison.study import Study, mean_scores
from socialcircle_ros.studies.steps import Step
from socialcircle_ros.studies.workload import METHODS, PEERS, million_points

from .verdicts import Outcome, f1_ranking, judge, summary, verdict_table

_PAPER = Table(
    'table1_paper',
    'Table 1 of the paper (its own cloud and machine; the paper does not say which points are outliers)',
    [Column('filter'), Column('raw points', ',d'), Column('processed points', ',d'), Column('time [ms]', 'd'),
     Column('time / social circle', '.1f')],
    [
        ['Social circle', 1228793, 1111450, 148, 1.0],
        ['Radius', 1228793, 1012853, 1134, 1134 / 148],
        ['Statistical', 1228793, 1019601, 474, 474 / 148],
    ],
)  # fmt: skip


def table1(study: Study) -> list[Step]:
    """Compare the filters on each scene of the plan, synthetic and scanned: one step for each."""

    def step(scene: str, *, from_stack: bool) -> Step:
        key = f'table1_{scene}{"_stack" if from_stack else ""}'
        scored = METHODS * (1 + study.plan.repeats / len(study.plan.seeds))
        work = study.search_work(scene, from_stack=from_stack)
        work += study.clouds_work(from_stack=from_stack, per_cloud=scored)
        if scene in PAPER_SCENES and not from_stack and peers.pcl_is_installed():
            work += million_points(study.plan.full_size) * PEERS
        return Step(key, work, lambda _: [_comparison(study, scene, from_stack=from_stack)])

    return [
        Step('table1_introduction', 0.0, lambda _: [_introduction(study)]),
        *(step(scene, from_stack=from_stack) for scene, from_stack in study.plan.scenes),
        Step('table1_settings', 0.0, lambda _: [_settings(study)]),
    ]


def _introduction(study: Study) -> Section:
    plan = study.plan
    counting = (
        'The paper compares the number of points that remain. This number cannot distinguish a good filter from'
        ' one that removes nothing. Here the truth is known, so good points kept and outliers removed are counted'
        ' separately.'
    )
    truth = (
        f'Synthetic scenes have {plan.full_size[1]}×{plan.full_size[0]} points, of which {NOT_MEASURED} are not'
        ' measured. An outlier is a point displaced by at least 4 pitches (the distance between neighbours). A'
        ' point displaced by less is ambiguous and not counted. Scanned scenes come from a rendered focus stack'
        f' ({plan.medium_size[1]}×{plan.medium_size[0]}). There a point is an outlier if its depth error exceeds'
        ' half the depth of field, and good if the error is within a quarter of it. The walls of the steep groove'
        ' (80°) are steeper than the circle can climb (63°): this scene shows a limit of the exact mode.'
    )
    tuning = (
        f'Scores are means over the seeds {", ".join(map(str, plan.seeds))}. "best" settings have the highest F1'
        f' on the seeds {", ".join(map(str, plan.search_seeds))}; they are searched for each scene. The social'
        ' circle is searched in the same way, but the verdicts use its default settings.'
    )
    return Section(
        'Table 1: good points kept, outliers removed, and time of each filter',
        [counting, truth, tuning, f'On the two scenes of the paper: {peer_availability()}'],
        items=[_PAPER],
    )


def _comparison(study: Study, scene: str, *, from_stack: bool) -> Section:
    """All filters on one scene: scores, verdicts on the claim, and recall by group of outliers."""
    methods = study.methods(scene, from_stack=from_stack)
    clouds = study.clouds(scene, from_stack=from_stack)
    title = clouds[0].title
    # PCL and Open3D take seconds for each cloud, so they run on the paper's two scenes only. They have no window:
    # the best settings of filters with a window do not apply to them.
    defaults = [each for each in methods if each.variant == 'default']
    peers = peers_of(defaults) if scene in PAPER_SCENES and not from_stack else []
    outcomes, recalls = _own_outcomes(study, methods, clouds)
    outcomes += [_peer_outcome(study, peer, clouds[0]) for peer in peers]
    verdicts = [judge(outcomes[0], other) for other in outcomes if other.method.name != methods[0].name]
    name = f'table1_{scene}{"_stack" if from_stack else ""}'
    share = float(np.mean([cloud.contamination for cloud in clouds]))
    return Section(
        f'{title}: {100 * share:.1f} % outliers',
        findings=[f'{title}. {_findings(outcomes)}'],
        items=[
            _score_table(name, title, outcomes),
            verdict_table(
                f'{name}_verdicts', f'{title}: does "keeps more, removes more, is faster" hold?', verdicts
            ),
            _recall_table(clouds, recalls),
        ],
    )


def _findings(outcomes: Sequence[Outcome]) -> str:
    """Sentences: against the paper's two filters, against the peers, and the ranking by F1."""
    groups = (
        (
            'the radius and the statistical filter at default and best settings',
            [each for each in outcomes if each.method.name in ('Radius', 'Statistical')],
        ),
        (
            'the filters of PCL and Open3D at default settings',
            [each for each in outcomes if each.method.is_peer],
        ),
    )
    summaries = [
        summary(words, [judge(outcomes[0], other) for other in others]) for words, others in groups if others
    ]
    return ' '.join([*summaries, f1_ranking(outcomes)])


def _own_outcomes(
    study: Study, methods: Sequence[Method], clouds: Sequence[LabelledCloud]
) -> tuple[list[Outcome], list[list[Cell]]]:
    """The outcome of each method, and a row of its recall in each group of outliers; means over the clouds."""
    title = clouds[0].title
    study.progress(f'{title}: timing the filters')
    times_ms = median_times_ms(methods, clouds[0].points, study.plan.repeats)
    raw = float(np.mean([cloud.measured for cloud in clouds]))
    outcomes, recalls = [], []
    for each in methods:
        study.progress(f'{title}: {each.label}')
        runs = [each(cloud.points) for cloud in clouds]
        outcomes.append(
            Outcome(
                method=each,
                raw=raw,
                kept=float(np.mean([run.kept for run in runs])),
                scores=mean_scores([cloud.score(run.outliers) for run, cloud in zip(runs, clouds, strict=True)]),
                roc_area=_mean_roc_area(runs, clouds),
                time_ms=times_ms[each],
            )
        )
        recalls.append([each.label, *_mean_recalls(runs, clouds)])
    return outcomes, recalls


def _peer_outcome(study: Study, peer: Method, cloud: LabelledCloud) -> Outcome:
    """The outcome of a peer on one cloud, in one run, since it takes seconds."""
    study.progress(f'{cloud.title}: {peer.label}')
    run = peer(cloud.points)
    return Outcome(peer, cloud.measured, run.kept, cloud.score(run.outliers), None, run.time_ms)


def _mean_roc_area(runs: Sequence[FilterRun], clouds: Sequence[LabelledCloud]) -> float | None:
    areas = [
        roc_area(run.score, cloud.outlier, cloud.counted)
        for run, cloud in zip(runs, clouds, strict=True)
        if run.score is not None
    ]
    return float(np.mean(areas)) if areas else None


def _mean_recalls(runs: Sequence[FilterRun], clouds: Sequence[LabelledCloud]) -> list[float | None]:
    """Recall in each group of the first cloud; None for a group that no cloud has."""
    by_cloud = [
        recall_by(run.outliers, cloud.outlier, cloud.counted, cloud.groups)
        for run, cloud in zip(runs, clouds, strict=True)
    ]
    means: list[float | None] = []
    for name in clouds[0].groups:
        present = [recalls[name] for recalls in by_cloud if name in recalls]
        means.append(float(np.mean(present)) if present else None)
    return means


def _recall_table(clouds: Sequence[LabelledCloud], recalls: list[list[Cell]]) -> Table:
    title, groups = clouds[0].title, clouds[0].groups
    counts = [
        float(
            np.mean(
                [
                    np.count_nonzero(cloud.outlier & cloud.counted & cloud.groups[name])
                    for cloud in clouds
                    if name in cloud.groups
                ]
            )
        )
        for name in groups
    ]
    grouping = 'cause' if 'glint' in groups else 'size of cluster [points]'
    return Table(
        f'recall_{title.lower().replace(" ", "_").replace(",", "")}',
        f'{title}: share of the outliers that were removed, by {grouping}',
        [Column('filter'), *(Column(name, '.1%') for name in groups)],
        [['number of outliers', *(f'{count:,.0f}' for count in counts)], *recalls],
    )


def _score_table(name: str, title: str, outcomes: Sequence[Outcome]) -> Table:
    columns = [
        Column('filter'),
        Column('raw points', ',.0f'),
        Column('processed points', ',.0f'),
        Column('good points kept', '.2%'),
        Column('outliers removed', '.2%'),
        Column('precision', '.3f'),
        Column('F1', '.3f'),
        Column('ROC area', '.3f'),
        Column('time [ms]', '.1f'),
        Column('time / ours', '.2f'),
    ]
    rows: list[list[Cell]] = [
        [
            each.method.label,
            each.raw,
            each.kept,
            1 - each.scores.false_positive_rate,
            each.scores.recall,
            each.scores.precision,
            each.scores.f1,
            each.roc_area,
            each.time_ms,
            each.time_ms / outcomes[0].time_ms,
        ]
        for each in outcomes
    ]
    note = (
        'PCL and Open3D: our default settings without the window; one run on the first seed. The time is the one'
        ' that the library reports, without reading and writing files.'
    )
    has_peers = any(each.method.is_peer for each in outcomes)
    return Table(name, title, columns, rows, note if has_peers else '')


def _settings(study: Study) -> Section:
    """The search space of each filter, its defaults, and the best settings found for each scene."""
    columns = [Column('scene'), *(Column(name_of(each)) for each in SETTINGS_TYPES)]
    rows: list[list[Cell]] = [
        ['searched', *(SEARCH_SPACES[each] for each in SETTINGS_TYPES)],
        ['default', *(describe(each()) for each in SETTINGS_TYPES)],
    ]
    for scene, from_stack in study.plan.scenes:
        best = study.best(scene, from_stack=from_stack)
        rows.append([TITLES[scene] + (', stack' if from_stack else ''), *(describe(each) for each in best)])
    note = 'Lengths in µm; the pitch is 1 µm. Settings that are not named are determined by the filter itself.'
    return Section(
        'Searched and best settings', items=[Table('settings', 'Settings of each filter', columns, rows, note)]
    )
