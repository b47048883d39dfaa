# SPDX-License-Identifier: Apache-2.0
"""The texts and tables of the page as HTML. Text from outside this module is escaped and shortened."""

import math
import time
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from html import escape as html_escape
from pathlib import Path

from socialcircle_ros.digits import share_text
from socialcircle_ros.errors import printable
from socialcircle_ros.focus import FocusCurve
from socialcircle_ros.interface import STAGE_TIME, MeasurementValues
from socialcircle_ros.lengths import length_text
from socialcircle_ros.messages.diagnostics import Status
from socialcircle_ros.settings import RosValue

from . import colours
from .comparison import Comparison
from .display import Drawing
from .link import LogEntry, Presence, ShownCloud, Snapshot
from .recorded import RecordedStack
from .regions import RegionNumbers
from .state import State
from .view import View

STYLE = f'<style>{Path(__file__).with_name("page.css").read_text(encoding="utf-8")}</style>'

_MOST_CHARACTERS = 2000
_MOST_STAGES = 50

_LEVELS = ('good', 'warn', 'bad')
_PRESENCE = {
    Presence.ABSENT: 'not found',
    Presence.SILENT: 'does not respond',
    Presence.INACTIVE: 'inactive',
    Presence.ACTIVE: 'active',
}


def plain(text: str) -> str:
    """A text from outside that every browser can be sent: without surrogates, and not too long."""
    short = text if len(text) <= _MOST_CHARACTERS else f'{text[:_MOST_CHARACTERS]} …'
    return printable(short)


def escape(text: str) -> str:
    """A text from outside as HTML."""
    return html_escape(plain(text))


def _box(content: str, kind: str = '') -> str:
    return f'<div class="sc {kind}">{content}</div>'


def node_card(name: str, snapshot: Snapshot) -> str:
    """The name and the state of the node."""
    present = snapshot.presence in (Presence.ACTIVE, Presence.INACTIVE)
    level = _LEVELS[min(snapshot.level, 2)] if present else 'idle'
    return _box(
        f'<div class="sc-card sc-{level}"><span class="sc-title">{escape(name)}</span>'
        f' <span class="sc-dim">· {_PRESENCE[snapshot.presence]}</span>'
        f'<div>{escape(snapshot.sentence)}</div></div>'
    )


def refusal(reason: str) -> str:
    """Why a value was refused."""
    return _box(f'<div class="sc-card sc-bad" role="alert">{escape(reason)}</div>')


def note(text: str, *, bad: bool = False) -> str:
    """One sentence."""
    return _box(f'<div class="sc-card sc-{"bad" if bad else "idle"}">{escape(text)}</div>')


def restart(lost: Mapping[str, tuple[RosValue, RosValue]]) -> str:
    """The settings that a node has lost by a restart.

    Args:
        lost: the value before and the value after the restart, by name.
    """
    rows = ''.join(
        f'<tr><td>{escape(name)}</td><td class="sc-num">{escape(str(before))}</td>'
        f'<td class="sc-num">{escape(str(after))}</td></tr>'
        for name, (before, after) in lost.items()
    )
    return _box(
        '<div class="sc-card sc-warn">The node was started again with other settings than it had.'
        f'<table><tr><td></td><td class="sc-num">before</td><td class="sc-num">now</td></tr>{rows}</table></div>'
    )


def title(state: State) -> str:
    """Which cloud is shown, and why it is not the result of the settings in force."""
    if not state.title:
        return ''
    compared = state.comparison
    text = f'{state.title}: A {compared.a.name}, B {compared.b.name}' if compared is not None else state.title
    caveat = f'<div class="sc-card sc-warn">{escape(state.caveat)}</div>' if state.caveat else ''
    return _box(f'<div class="sc-title">{escape(text)}</div>{caveat}')


def trends(drifts: Iterable[str], address: str) -> str:
    """What drifts, and the link to the page of trends."""
    sentences = ''.join(f'<div>{escape(sentence)}</div>' for sentence in drifts)
    link = f'<a href="{escape(address)}" target="_blank" rel="noopener">Open the page of trends</a>'
    return _box(f'<div class="sc-card sc-{"warn" if sentences else "idle"}">{sentences}{link}</div>')


def good_clouds(names: Sequence[str]) -> str:
    """The clouds that are called good."""
    rows = ''.join(f'<div>{escape(name)}</div>' for name in names)
    return _box(f'<div class="sc-card sc-idle"><b>Called good: {len(names)}</b>{rows}</div>')


def stack(stack: RecordedStack) -> str:
    """The frames of a recorded stack, and how many pixels have objections to their depth."""
    rows = {'frames': f'{stack.frames:,}'} | {
        f'pixels: {reason.replace("_", " ")}': f'{count:,}' for reason, count in stack.reasons.items()
    }
    return _box(_table(rows))


def measurement(shown: ShownCloud | None) -> str:
    """The counts of the last measurement, and the warning of the node where there is one."""
    if shown is None or shown.measurement is None:
        return _box('<span class="sc-dim">No measurement yet.</span>')
    numbers, status = shown.numbers, shown.measurement
    if numbers is None:
        return note('The measurement cannot be read. Check that node and page have the same version.', bad=True)
    share = share_text(numbers.outliers / numbers.measured) if numbers.measured else '–'
    counts = {'kept': f'{numbers.kept:,}', 'outliers': f'{numbers.outliers:,}', 'of measured': share}
    big = ''.join(f'<div>{title}<b>{count}</b></div>' for title, count in counts.items())
    said = note(status.message, bad=True) if status.level else ''
    return _box(f'<div class="sc-big">{big}</div>') + _verdict(numbers) + said


def _verdict(numbers: MeasurementValues) -> str:
    """Whether the measurement passes its limits, and why not; '' where no limit is set."""
    if numbers.verdict is None:
        return ''
    kind = 'good' if numbers.verdict == 'passed' else 'bad'
    reason = f': {numbers.verdict_reason}' if numbers.verdict_reason else ''
    return _box(f'<div class="sc-card sc-{kind}"><b>{escape(numbers.verdict)}</b>{escape(reason)}</div>')


def details(shown: ShownCloud | None, unit: str | None = None) -> str:
    """The stage times of the last measurement as bars, and its other values.

    Args:
        shown: the cloud and its measurement.
        unit: of the cloud; None: not known.
    """
    if shown is None or shown.measurement is None or shown.numbers is None:
        return ''
    numbers, status = shown.numbers, shown.measurement
    stages_ms = _stage_times_ms(status)
    total_ms = stages_ms.pop('total', sum(stages_ms.values()))
    longest_ms = max([*stages_ms.values(), 1e-9])
    bars = ''.join(
        f'<tr><td>{escape(stage)}</td><td style="width:50%">'
        f'<div class="sc-bar" style="width:{100 * time_ms / longest_ms:.1f}%"></div></td>'
        f'<td class="sc-num">{time_ms:.1f} ms</td></tr>'
        for stage, time_ms in stages_ms.items()
    )
    end = f'<tr><td><b>total</b></td><td></td><td class="sc-num"><b>{total_ms:.1f} ms</b></td></tr>'
    rows = {
        'points': f'{numbers.points:,}',
        'measured': f'{numbers.measured:,}',
        'repaired': f'{numbers.repaired:,}',
        'seed (row, column)': f'{numbers.seed_row}, {numbers.seed_column}',
        'radius': length_text(numbers.radius, unit),
        'frame': status.hardware_id or '–',
        'stamp': numbers.stamp,
    }
    return _box(f'<table>{bars}{end}</table>') + _box(_table(rows))


def legend(view: View | None, far: int) -> str:
    """The meaning of the colours, and how many points are drawn."""
    if view is None:
        return _box('<span class="sc-dim">No cloud yet.</span>')
    beyond = f' {far:,} outliers are outside the scene and are drawn at its edge.' if far else ''
    return _box(
        f'{_dot(colours.OUTLIER, "outlier")}{_dot(colours.NOT_MEASURED, "not measured")}{_ramp(view.drawing)}'
        f'<div class="sc-dim">{escape(view.caption + beyond)}</div>'
    )


def comparison_legend(view: View) -> str:
    """The meaning of the colours while two settings are compared."""
    dots = ''.join(
        _dot(colour, f'outlier of {whose}')
        for colour, whose in ((colours.ONLY_A, 'A only'), (colours.ONLY_B, 'B only'), (colours.BOTH, 'both'))
    )
    return _box(dots + _ramp(view.drawing))


def _dot(colour: Iterable[int], text: str) -> str:
    return f'<span class="sc-dot" style="background:{_rgb(colour)}"></span>{text}'


def _ramp(drawing: Drawing) -> str:
    """The colours with the values at their two ends."""
    table = colours.height_table(drawing.display.colour_map)
    stops = ','.join(_rgb(tuple(table[index])) for index in range(0, 256, 15))
    is_height = drawing.display.values == 'heights'
    ends = [drawing.height_scale.number(end) if is_height else f'{end:.3g}' for end in drawing.span]
    return (
        f'<div class="sc-ramp" style="background:linear-gradient(90deg,{stops})"></div>'
        f'<div class="sc-ends"><span>{ends[0]}</span><span>{ends[1]}</span></div>'
        f'<div class="sc-dim">{escape(drawing.range_sentence)}</div>'
    )


def chart(title: str, content: str) -> str:
    """A map, a profile or a histogram, with its title."""
    return _box(f'<div class="sc-dim">{escape(title)}</div>{content}') if content else ''


def why(sentences: Iterable[str]) -> str:
    """Why a point was called an outlier, or was kept."""
    return _box(f'<div class="sc-card sc-idle">{" ".join(escape(sentence) for sentence in sentences)}</div>')


def curve(found: FocusCurve, content: str) -> str:
    """The focus curve of a point, what the fit made of it, and the objections to it.

    Args:
        found: the curve, with z in m.
        content: its picture.
    """
    peak = 'no peak' if math.isnan(found.depth) else f'peak at {length_text(found.depth, "m")}'
    objections = f'; {", ".join(reason.replace("_", " ") for reason in found.reasons)}' if found.reasons else ''
    return chart(f'focus curve: {peak}, quality {found.quality:.2f}{objections}', content)


def region(numbers: RegionNumbers, unit: str | None) -> str:
    """The counts, the texture and the verdict of a region of interest.

    Args:
        numbers: of the region.
        unit: of the lengths; None: it is not known.
    """
    row, column, height, width = numbers.place
    share = f' ({share_text(numbers.outliers / numbers.measured)})' if numbers.measured else ''
    counts = {
        'points': f'{numbers.points:,}',
        'measured': f'{numbers.measured:,}',
        'outliers': f'{numbers.outliers:,}{share}',
    }
    with_outliers, kept = numbers.texture_measured, numbers.texture_kept
    values = [
        (name, getattr(with_outliers, name.lower()), getattr(kept, name.lower())) for name in ('Sa', 'Sq', 'Sz')
    ]
    cells = ''.join(
        f'<tr><td>{name}</td><td class="sc-num">{escape(_length(one, unit))}</td>'
        f'<td class="sc-num">{escape(_length(other, unit))}</td></tr>'
        for name, one, other in values
    )
    head = '<tr><td></td><td class="sc-num">measured</td><td class="sc-num">kept</td></tr>'
    passed = ''
    if numbers.verdict is not None:
        kind, word = ('good', 'passed') if numbers.verdict.passed else ('bad', 'failed')
        reasons = escape(' '.join(numbers.verdict.reasons(unit)))
        passed = f'<div class="sc-card sc-{kind}"><b>{word}</b> {reasons}</div>'
    where = f'rows {row} to {row + height - 1}, columns {column} to {column + width - 1}'
    return _box(f'<div class="sc-title">Region: {where}</div>{_table(counts)}<table>{head}{cells}</table>{passed}')


def _length(value: float, unit: str | None) -> str:
    return '–' if math.isnan(value) else length_text(value, unit)


def log(entries: Iterable[LogEntry]) -> str:
    """The lines of the log, in the given order."""
    lines = ''.join(
        f'<div{" style=color:#e8590c" if entry.bad else ""}><span class="sc-dim sc-num">'
        f'{time.strftime("%H:%M:%S", time.localtime(entry.time))}</span> {escape(entry.text)}</div>'
        for entry in entries
    )
    return _box(lines or '<span class="sc-dim">No entries yet.</span>', 'sc-log')


def comparison(compared: Comparison, unit: str | None) -> str:
    """Both settings in numbers.

    Args:
        compared: the results with both.
        unit: of the cloud; None: not known.
    """
    a, b = compared.a, compared.b
    both, only_a, only_b = compared.counts
    rows = (
        ('outliers', f'{a.measurement.values.outliers:,}', f'{b.measurement.values.outliers:,}'),
        ('radius', *(length_text(each.measurement.values.radius, unit) for each in (a, b))),
        ('time', f'{a.measurement.times_ms["total"]:.1f} ms', f'{b.measurement.times_ms["total"]:.1f} ms'),
        *((name, str(one), str(other)) for name, one, other in compared.differing),
    )
    body = ''.join(
        f'<tr><td>{escape(name)}</td><td class="sc-num">{escape(one)}</td>'
        f'<td class="sc-num">{escape(other)}</td></tr>'
        for name, one, other in rows
    )
    dots = ''.join(
        f'<span class="sc-dot" style="background:{_rgb(colour)}"></span>{name} {count:,}'
        for colour, name, count in (
            (colours.ONLY_A, 'only A', only_a),
            (colours.ONLY_B, 'only B', only_b),
            (colours.BOTH, 'both', both),
        )
    )
    same = '' if compared.differing else '<div class="sc-dim">The two settings are identical.</div>'
    return _box(
        f'<table><tr><td></td><td class="sc-num"><b>A: {escape(a.name)}</b></td>'
        f'<td class="sc-num"><b>B: {escape(b.name)}</b></td></tr>{body}</table>{same}<div>{dots}</div>'
    )


def _stage_times_ms(status: Status) -> dict[str, float]:
    """Times in ms by stage, in the order of the stages; a time that is no number is left out."""
    found: dict[str, float] = {}
    prefix, suffix = STAGE_TIME.split('{stage}')
    for key, text in status.values.items():
        if len(found) == _MOST_STAGES:
            break
        if key.startswith(prefix) and key.endswith(suffix):
            with suppress(ValueError):
                found[key.removeprefix(prefix).removesuffix(suffix)] = float(text)
    return found


def _table(rows: Mapping[str, str]) -> str:
    cells = ''.join(
        f'<tr><td class="sc-dim">{escape(name)}</td><td class="sc-num">{escape(value)}</td></tr>'
        for name, value in rows.items()
    )
    return f'<table>{cells}</table>'


def _rgb(colour: Iterable[int]) -> str:
    return f'rgb({",".join(str(int(part)) for part in colour)})'
