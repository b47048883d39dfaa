"""The texts and tables of the page as HTML. Text from outside this module is escaped."""

import time
from collections.abc import Iterable, Mapping
from html import escape
from pathlib import Path

from socialcircle_ros.messages.diagnostics import Status

from . import colours
from .comparison import Comparison
from .link import LogEntry, Presence, Snapshot
from .view import View

STYLE = f'<style>{Path(__file__).with_name("page.css").read_text(encoding="utf-8")}</style>'

_LEVELS = ('good', 'warn', 'bad')
_PRESENCE = {
    Presence.ABSENT: 'not found',
    Presence.SILENT: 'does not respond',
    Presence.INACTIVE: 'inactive',
    Presence.ACTIVE: 'active',
}


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


def measurement(status: Status | None) -> str:
    """The counts of the last measurement, and the warning of the node where there is one."""
    if status is None:
        return _box('<span class="sc-dim">No measurement yet.</span>')
    values = status.values
    measured, outliers = _whole(values, 'measured'), _whole(values, 'outliers')
    share = f'{100 * outliers / measured:.2f} %' if measured else '–'
    counts = {'kept': f'{_whole(values, "kept"):,}', 'outliers': f'{outliers:,}', 'of measured': share}
    big = ''.join(f'<div>{title}<b>{count}</b></div>' for title, count in counts.items())
    return _box(f'<div class="sc-big">{big}</div>') + (note(status.message, bad=True) if status.level else '')


def details(status: Status | None) -> str:
    """The stage times of the last measurement as bars, and its other values."""
    if status is None:
        return ''
    values = status.values
    stages = _times(status)
    total = stages.pop('total', sum(stages.values()))
    longest = max([*stages.values(), 1e-9])
    bars = ''.join(
        f'<tr><td>{escape(stage)}</td><td style="width:50%"><div class="sc-bar"'
        f' style="width:{100 * value / longest:.1f}%"></div></td><td class="sc-num">{value:.1f} ms</td></tr>'
        for stage, value in stages.items()
    )
    end = f'<tr><td><b>total</b></td><td></td><td class="sc-num"><b>{total:.1f} ms</b></td></tr>'
    rows = {
        'points': f'{_whole(values, "points"):,}',
        'measured': f'{_whole(values, "measured"):,}',
        'repaired': f'{_whole(values, "repaired"):,}',
        'seed (row, column)': f'{values.get("seed_row", "–")}, {values.get("seed_column", "–")}',
        'radius': _short(values.get('radius', '–')),
        'frame': status.hardware_id or '–',
        'stamp': values.get('stamp', '–'),
    }
    return _box(f'<table>{bars}{end}</table>') + _box(_table(rows))


def legend(view: View | None, far: int) -> str:
    """The meaning of the colours, and how many points are drawn."""
    if view is None:
        return _box('<span class="sc-dim">No cloud yet.</span>')
    low, high = view.span
    table = colours.height_table()
    stops = ','.join(_rgb(tuple(table[index])) for index in range(0, 256, 15))
    beyond = f' {far:,} outliers are outside the scene and are drawn at its edge.' if far else ''
    return _box(
        f'<span class="sc-dot" style="background:{_rgb(colours.OUTLIER)}"></span>outlier'
        f'<span class="sc-dot" style="background:{_rgb(colours.NOT_MEASURED)}"></span>not measured'
        f'<div class="sc-ramp" style="background:linear-gradient(90deg,{stops})"></div>'
        f'<div class="sc-ends"><span>{low:.4g}</span><span class="sc-dim">height of kept points</span>'
        f'<span>{high:.4g}</span></div><div class="sc-dim">{escape(view.caption + beyond)}</div>'
    )


def log(entries: Iterable[LogEntry]) -> str:
    """The lines of the log, in the given order."""
    lines = ''.join(
        f'<div{" style=color:#e8590c" if entry.bad else ""}><span class="sc-dim sc-num">'
        f'{time.strftime("%H:%M:%S", time.localtime(entry.time))}</span> {escape(entry.text)}</div>'
        for entry in entries
    )
    return _box(lines or '<span class="sc-dim">No entries yet.</span>', 'sc-log')


def comparison(compared: Comparison) -> str:
    """Both settings in numbers."""
    a, b = compared.a, compared.b
    both, only_a, only_b = compared.counts
    rows = (
        ('outliers', f'{a.outputs.outliers:,}', f'{b.outputs.outliers:,}'),
        ('radius', f'{a.outputs.radius:.4g}', f'{b.outputs.radius:.4g}'),
        ('time', f'{a.outputs.times["total"]:.1f} ms', f'{b.outputs.times["total"]:.1f} ms'),
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


def _times(status: Status) -> dict[str, float]:
    """Times in ms by stage, in the order of the stages; a time that is no number is left out."""
    found = {}
    for key, text in status.values.items():
        if key.startswith('time_') and key.endswith('_ms'):
            try:
                found[key[5:-3]] = float(text)
            except ValueError:
                continue
    return found


def _table(rows: Mapping[str, str]) -> str:
    cells = ''.join(
        f'<tr><td class="sc-dim">{escape(name)}</td><td class="sc-num">{escape(value)}</td></tr>'
        for name, value in rows.items()
    )
    return f'<table>{cells}</table>'


def _whole(values: Mapping[str, str], name: str) -> int:
    text = values.get(name, '0')
    return int(text) if text.isdecimal() else 0


def _short(text: str) -> str:
    try:
        return f'{float(text):.5g}'
    except ValueError:
        return text


def _rgb(colour: Iterable[int]) -> str:
    return f'rgb({",".join(str(int(part)) for part in colour)})'
