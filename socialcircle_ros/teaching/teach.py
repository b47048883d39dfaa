# SPDX-License-Identifier: Apache-2.0
"""A lesson from good clouds: taught on some fields, checked on those kept back, refused if it does not help."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from statistics import mean

from socialcircle_ros.arguments import settings_or_default
from socialcircle_ros.circle.adaptive import CommunityJudge, LessonJudge, Likelihood
from socialcircle_ros.circle.network import packaged_network
from socialcircle_ros.cloud import Mask
from socialcircle_ros.digits import share_text
from socialcircle_ros.metrics.scores import Scores, Tally, tally
from socialcircle_ros.settings import CircleSettings
from socialcircle_ros.settings.lessons import Lesson

from .clouds import GoodCloud, GoodField, good_fields
from .examples import CHECKED, TAUGHT, GoodExample, untouched, with_outliers
from .learn import learn

_FIRST_CHECK_SEED = 1001
_WORSE_F1, _WORSE_REMOVED = 0.005, 0.0001
"""By how much a lesson may be worse than none in one figure, if it is better in the other."""
_WORSE_AT_EDGES = 0.05
"""The same for the outliers at edges, of which there are fewer: chance does more."""
_BETTER_F1, _BETTER_REMOVED = 0.01, 0.0002
_LEAST_F1 = 0.2
"""Where F1 is lower with a lesson and without, the outliers put in cannot be told from the surface."""
_TOLD = 5  # names of fields in a warning

TeachingProgress = Callable[[int, int], None]
"""Called with the number of finished steps and the number of all steps."""


@dataclass(frozen=True)
class LessonCheck:
    """How well outliers are found in the fields kept back.

    Attributes:
        inserted: scores for each kind of outliers put in, as in `CHECKED`.
        removed: share of the untouched points that are removed.
    """

    inserted: tuple[Scores, ...]
    removed: float

    @property
    def f1(self) -> float:
        """Mean F1 over the kinds."""
        return mean(each.f1 for each in self.inserted)

    @property
    def f1_at_edges(self) -> float:
        """Mean F1 over the kinds that are put at steps and beside holes."""
        return mean(each.f1 for kind, each in zip(CHECKED, self.inserted, strict=True) if kind.at_edges)

    @property
    def removed_text(self) -> str:
        """The share of the untouched points that are removed, for a person."""
        return share_text(self.removed, 3)


@dataclass(frozen=True, eq=False)
class CheckedField:
    """A field kept back, and what is removed of it.

    Attributes:
        example: the field, untouched or with outliers put in.
        before: (H, W) bool, what is removed without a lesson.
        after: (H, W) bool, what the lesson removes.
    """

    example: GoodExample
    before: Mask
    after: Mask


@dataclass(frozen=True, eq=False)
class Teaching:
    """What teaching came to.

    Attributes:
        lesson: the lesson.
        before: the check without a lesson.
        after: the check of the lesson.
        fields: the fields kept back: untouched, and with the outliers of the second kind of `CHECKED`.
        warnings: where the good clouds may have outliers of their own.
        refusal: why the lesson is not worth having; '': it is.
    """

    lesson: Lesson
    before: LessonCheck
    after: LessonCheck
    fields: Sequence[CheckedField]
    warnings: Sequence[str]
    refusal: str


def teach(
    clouds: Sequence[GoodCloud],
    progress: TeachingProgress = lambda done, all_steps: None,
    settings: CircleSettings | None = None,
) -> Teaching:
    """Teach a lesson, and check it.

    Args:
        clouds: clouds of good parts of one kind.
        progress: called after each step.
        settings: `judge` and `provider` say what finds the outliers that the lesson decides about; None: the
            defaults. Where the depth of field of a cloud is known, it is the rules.

    Raises:
        CloudError: the clouds have too few measured points.
        SocialCircleError: the network cannot be read.
    """
    settings = settings_or_default(CircleSettings, settings)
    by_rules = settings.judge == 'rules' or any(cloud.depth_of_field is not None for cloud in clouds)
    likelihood = None if by_rules else packaged_network(settings.provider).probabilities
    taught, kept_back = good_fields(clouds)
    steps = _StepCounter(progress, len(taught) * (1 + len(TAUGHT)) + 2 * len(kept_back) * (1 + len(CHECKED)))
    lesson = learn(taught, tuple(cloud.name for cloud in clouds), likelihood, steps.done)
    judge = LessonJudge(lesson)
    before, after, checked = _check(kept_back, judge, likelihood, steps)
    figures = {
        'f1_before': before.f1,
        'f1_after': after.f1,
        'f1_at_edges_before': before.f1_at_edges,
        'f1_at_edges_after': after.f1_at_edges,
        'removed_before': before.removed,
        'removed_after': after.removed,
    }
    lesson = replace(lesson, check=figures)
    return Teaching(lesson, before, after, checked, _suspicions(taught, kept_back), _refusal(before, after))


class _StepCounter:
    """Counts finished steps for a progress bar."""

    def __init__(self, progress: TeachingProgress, number: int) -> None:
        self._progress, self._number, self._done = progress, number, 0

    def done(self) -> None:
        self._done += 1
        self._progress(self._done, self._number)


def _check(
    fields: Sequence[GoodField], judge: CommunityJudge, likelihood: Likelihood | None, steps: _StepCounter
) -> tuple[LessonCheck, LessonCheck, list[CheckedField]]:
    """Compare results without and with the lesson on the fields kept back."""
    tallies = [[Tally()] * (1 + len(CHECKED)) for _ in range(2)]
    shown = []
    for number, place in enumerate(fields):
        for kind in range(1 + len(CHECKED)):
            seed = _FIRST_CHECK_SEED + number * len(CHECKED) + kind
            example = with_outliers(place, CHECKED[kind - 1], seed) if kind else untouched(place)
            masks = []
            for way, each in enumerate((None, judge)):
                masks.append(example.filtered(each, likelihood).outliers)
                tallies[way][kind] += tally(masks[-1], example.outlier, example.counted)
                steps.done()
            if kind in (0, 2):
                shown.append(CheckedField(example, masks[0], masks[1]))
    checks = [
        LessonCheck(tuple(each.scores for each in kinds[1:]), kinds[0].scores.false_positive_rate)
        for kinds in tallies
    ]
    return checks[0], checks[1], shown


def _suspicions(taught: Sequence[GoodField], kept_back: Sequence[GoodField]) -> list[str]:
    """Warn where points of the good clouds stand out like outliers."""
    fields = (*taught, *kept_back)
    found = [(place.name, int(place.stands_out.sum())) for place in fields if place.stands_out.any()]
    if not found:
        return []
    names = ', '.join(f'{name}: {count}' for name, count in found[:_TOLD]) + (', …' if len(found) > _TOLD else '')
    points = sum(count for _, count in found)
    stand = '1 point stands' if points == 1 else f'{points} points stand'
    cure = 'if they are outliers, teach on clouds without them.'
    if any(place.suspects.any() for place in fields):
        sentence = f'The good clouds seem to have outliers of their own: {stand} out ({names}).'
        return [f'{sentence} They do not count in the check; {cure}']
    return [f'In the good clouds {stand} out and count as the texture of the part ({names}); {cure}']


def _refusal(before: LessonCheck, after: LessonCheck) -> str:
    """Why a lesson does not help; '' where it does."""
    if max(before.f1, after.f1) < _LEAST_F1:
        return (
            'The check says nothing, because the outliers put in cannot be told from the surface: F1 is'
            f' {before.f1:.3f} without a lesson, and {after.f1:.3f} with one. Use the adaptive mode without one.'
        )
    gain, saved = after.f1 - before.f1, before.removed - after.removed
    lost_at_edges = before.f1_at_edges - after.f1_at_edges
    f1 = f'F1 would be {after.f1:.3f} instead of {before.f1:.3f}'
    at_edges = f'F1 at steps and beside holes would be {after.f1_at_edges:.3f} instead of {before.f1_at_edges:.3f}'
    removed = f'{after.removed_text} instead of {before.removed_text} of the good points would be removed'
    worse = [
        text
        for text, is_worse in (
            (f1, gain < -_WORSE_F1),
            (at_edges, lost_at_edges > _WORSE_AT_EDGES),
            (removed, saved < -_WORSE_REMOVED),
        )
        if is_worse
    ]
    if not worse and (gain > _BETTER_F1 or saved > _BETTER_REMOVED):
        return ''
    what = 'do harm' if worse else 'change little'
    return (
        f'A lesson would {what}: in the fields kept back {" and ".join(worse or (f1, removed))}. Use the adaptive'
        ' mode without a lesson, or teach on more clouds.'
    )
