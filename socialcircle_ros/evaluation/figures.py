"""Figures 4, 8, 10 and 11 of the paper, on clouds of known truth."""

from . import drawings
from .lineup import Lineup
from .report import Picture, Section
from .subjects import TITLES
from .table1 import SCANNED


def figure8(lineup: Lineup) -> list[Section]:
    """What each filter leaves and removes, at its default and at its best."""
    pictures = []
    for scene, from_stack in [(scene, False) for scene in TITLES] + [(scene, True) for scene in SCANNED]:
        methods = lineup.methods(scene, from_stack=from_stack)
        lineup.tell(f'{scene}: drawing what each filter removed')
        subject = lineup.subject(scene, lineup.plan.seeds[0], from_stack=from_stack)
        for variant in ('default', 'best'):
            answers = [(each.label, each(subject.points).outliers) for each in methods if each.variant == variant]
            pictures.append(
                Picture(
                    f'figure8_{scene}{"_stack" if from_stack else ""}_{variant}',
                    drawings.removal_maps(subject, answers),
                    f'{subject.title}, {variant} settings. Above: the heights that remain, white where nothing'
                    ' is left.'
                    ' Below: the framed part, where outliers are densest, and what each filter did there.',
                )
            )
    return [Section('Figure 8: what each filter removes', items=pictures)]
