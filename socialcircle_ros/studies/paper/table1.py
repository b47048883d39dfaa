"""Table 1: points kept, outliers removed and time, with the truth known; and the same from 2 to 45 % outliers."""

import functools
from collections.abc import Sequence

import numpy as np

from socialcircle_ros.metrics.scores import recall_by, roc_area
from socialcircle_ros.report.content import Cell, Column, Section, Table
from socialcircle_ros.studies.comparison.labelled_clouds import NOT_MEASURED, PAPERS_SCENES, TITLES, LabelledCloud
from socialcircle_ros.studies.comparison.methods import (
    KINDS,
    Method,
    in_words,
    median_times,
    name_of,
    peers_in_words,
    peers_of,
)
from socialcircle_ros.studies.comparison.search import SPACES
from socialcircle_ros.studies.comparison.study import Study, judged, mean_scores

from . import verdicts
from .verdicts import Outcome

_PAPER = Table(
    'table1_paper',
    'Table 1 as the paper gives it (its own cloud and machine; nothing says which points were outliers)',
    [Column('filter'), Column('raw points', ',d'), Column('processed points', ',d'), Column('time [ms]', 'd'),
     Column('time / social circle', '.1f')],
    [
        ['Social circle', 1228793, 1111450, 148, 1.0],
        ['Radius', 1228793, 1012853, 1134, 1134 / 148],
        ['Statistical', 1228793, 1019601, 474, 474 / 148],
    ],
)  # fmt: skip


def table1(study: Study) -> list[Section]:
    """Each filter on each scene, painted and out of a focus stack."""
    plan = study.plan
    counting = (
        'The paper compares the number of points that remain, which cannot tell a good filter from one that'
        ' removes nothing. Here the truth is known, so that good points kept and outliers removed are counted'
        ' each for itself.'
    )
    truth = (
        f'Painted scenes have {plan.size[1]}×{plan.size[0]} points less {NOT_MEASURED} that are not measured.'
        ' An outlier is a point displaced by at least 4 pitches (the distance of neighbours); a point moved by'
        f' less is ambiguous, and not counted. From a rendered focus stack ({plan.small[1]}×{plan.small[0]}) a'
        ' point is an outlier if its depth is off by more than half the depth of field, good if it is within'
        ' a quarter of it. The walls of the steep groove (80°) are steeper than the circle can climb (63°):'
        ' this scene shows what the exact mode cannot do.'
    )
    tuning = (
        f'Scores are means over the seeds {", ".join(map(str, plan.seeds))}. "best" are the settings with the'
        f' highest F1 on the seeds {", ".join(map(str, plan.search_seeds))}, searched for each scene. The social'
        ' circle is searched in the same way, but the verdicts are on its default.'
    )
    first = Section(
        'Table 1: what each filter keeps, what it removes, and how long it takes',
        [counting, truth, tuning, f'On the two scenes of the paper: {peers_in_words()}'],
        items=[_PAPER],
    )
    compared = [_compared(study, scene, from_stack=from_stack) for scene, from_stack in plan.scenes]
    return [first, *compared, _settings(study)]


def _compared(study: Study, scene: str, *, from_stack: bool) -> Section:
    """Every filter on one scene: outcomes, verdicts, and which outliers were found."""
    methods = study.methods(scene, from_stack=from_stack)
    clouds = []
    for seed in study.plan.seeds:
        study.tell(f'{scene}: making the cloud of seed {seed}')
        clouds.append(study.cloud(scene, seed, from_stack=from_stack))
    # PCL and Open3D take seconds for each cloud: the paper's two scenes are enough. They know no window, so that
    # what is best for the window's filters is nothing that they should be judged by.
    defaults = [each for each in methods if each.variant == 'default']
    others = peers_of(defaults) if scene in PAPERS_SCENES and not from_stack else []
    outcomes, found_by = _outcomes(study, methods, others, clouds)
    judged_outcomes = [
        verdicts.judge(outcomes[0], other) for other in outcomes if other.method.name != methods[0].name
    ]
    name = f'table1_{scene}{"_stack" if from_stack else ""}'
    title = clouds[0].title
    share = float(np.mean([cloud.contamination for cloud in clouds]))
    return Section(
        f'{title}: {100 * share:.1f} % outliers',
        findings=[f'{title}. {_found(outcomes)}'],
        items=[
            _as_table(name, title, outcomes),
            verdicts.table(
                f'{name}_verdicts', f'{title}: does "keeps more, removes more, is faster" hold?', judged_outcomes
            ),
            found_by,
        ],
    )


def _found(outcomes: Sequence[Outcome]) -> str:
    """Sentences: against the paper's two filters, against other people's, and who is best of all."""
    judge = functools.partial(verdicts.judge, outcomes[0])
    papers = [each for each in outcomes if each.method.name in ('Radius', 'Statistical')]
    peers = [each for each in outcomes if each.method.is_peer]
    sentences = [
        verdicts.in_a_sentence(words, [judge(each) for each in others])
        for words, others in (
            ('the paper’s radius and statistical filter, default and best', papers),
            ('the same of PCL and Open3D, default', peers),
        )
        if others
    ]
    return ' '.join([*sentences, verdicts.standing(outcomes)])


def _outcomes(
    study: Study, methods: Sequence[Method], peers: Sequence[Method], clouds: Sequence[LabelledCloud]
) -> tuple[list[Outcome], Table]:
    title = clouds[0].title
    study.tell(f'{title}: taking times')
    times = median_times(methods, clouds[0].points, study.plan.repeats)
    outcomes, recalls = [], []
    for each in methods:
        study.tell(f'{title}: {each.label}')
        answers = [each(cloud.points) for cloud in clouds]
        both = list(zip(answers, clouds, strict=True))
        areas = [roc_area(a.score, s.outlier, s.counted) for a, s in both if a.score is not None]
        outcomes.append(
            Outcome(
                method=each,
                raw=float(np.mean([cloud.measured for cloud in clouds])),
                kept=float(np.mean([answer.kept for answer in answers])),
                scores=mean_scores([judged(answer.outliers, cloud) for answer, cloud in both]),
                roc=float(np.mean(areas)) if areas else None,
                milliseconds=times[each],
            )
        )
        groups = [recall_by(a.outliers, s.outlier, s.counted, s.groups) for a, s in both]
        recalls.append([each.label, *(_mean([group.get(name) for group in groups]) for name in clouds[0].groups)])
    for peer in peers:
        study.tell(f'{title}: {peer.label}')
        # One cloud, one run: these take seconds.
        answer = peer(clouds[0].points)
        scores = judged(answer.outliers, clouds[0])
        outcomes.append(Outcome(peer, clouds[0].measured, answer.kept, scores, None, answer.milliseconds))
    counts = [
        float(
            np.mean([np.count_nonzero(s.outlier & s.counted & s.groups[name]) for s in clouds if name in s.groups])
        )
        for name in clouds[0].groups
    ]
    kinds = Table(
        f'recall_{title.lower().replace(" ", "_").replace(",", "")}',
        f'{title}: share of the outliers that were removed, by '
        + ('cause' if 'glint' in clouds[0].groups else 'size of cluster [points]'),
        [Column('filter'), *(Column(name, '.1%') for name in clouds[0].groups)],
        [['number of outliers', *(f'{count:,.0f}' for count in counts)], *recalls],
    )
    return outcomes, kinds


def _mean(values: Sequence[float | None]) -> float | None:
    there = [value for value in values if value is not None]
    return float(np.mean(there)) if there else None


def _as_table(name: str, title: str, outcomes: Sequence[Outcome]) -> Table:
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
            each.roc,
            each.milliseconds,
            each.milliseconds / outcomes[0].milliseconds,
        ]
        for each in outcomes
    ]
    note = (
        'PCL and Open3D: the settings of our defaults, without a window; the first seed, one run, the time that'
        ' the tool itself gives, without files.'
    )
    has_peers = any(each.method.is_peer for each in outcomes)
    return Table(name, title, columns, rows, note if has_peers else '')


def _settings(study: Study) -> Section:
    """What was searched, and what was found."""
    keys = study.plan.scenes
    titles = [TITLES[scene] + (', stack' if from_stack else '') for scene, from_stack in keys]
    found: list[list[Cell]] = [
        [title, *(in_words(best) for best in study.best(scene, from_stack=from_stack))]
        for title, (scene, from_stack) in zip(titles, keys, strict=True)
    ]
    defaults: list[Cell] = ['default', *(in_words(kind()) for kind in KINDS)]
    searched: list[Cell] = ['searched', *(SPACES[kind] for kind in KINDS)]
    columns = [Column('scene'), *(Column(name_of(kind)) for kind in KINDS)]
    return Section(
        'Settings that were searched and found',
        items=[
            Table(
                'settings',
                'Lengths in µm; the pitch is 1 µm. What is not named is found by the filter itself.',
                columns,
                [searched, defaults, *found],
            )
        ],
    )
