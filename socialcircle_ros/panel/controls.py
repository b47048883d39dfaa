"""The controls of a node's parameters, made from what the node says of them."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import yaml

from socialcircle_ros.errors import SettingError
from socialcircle_ros.settings import RosValue

from . import markup
from .changes import Changes
from .link import Descriptor, ParameterKind

_DRAGGED, _TYPED = 0.05, 0.7  # s in which a newer value replaces one that was dragged to, or typed
_MOST_STEPS = 200  # of a slider; beyond, a number is typed
_DECADES = 3  # from which on a range is shown in powers of ten
_HIDDEN = ('qos_overrides.', 'use_sim_time', 'start_type_description_service')  # ROS's own, fixed at the start


class _Widget(Protocol):
    """One or two elements that show one value."""

    def show(self, value: RosValue) -> None:
        """Show the value that is in force."""

    def enable(self, enabled: bool) -> None:
        """Let it be moved or not."""


Asked = Callable[[RosValue | SettingError, float], None]
"""Called with a value, or with what is wrong with a text, and the seconds in which a newer one replaces it."""


class Controls:
    """All controls in the container in which `build` is called.

    Args:
        gui: where they are made.
        changes: takes what they are moved to.
    """

    def __init__(self, gui: Any, changes: Changes) -> None:
        self._gui = gui
        self._changes = changes
        self._descriptors: tuple[Descriptor, ...] = ()
        self._containers: list[Any] = []
        self._widgets: dict[str, _Widget] = {}
        self._reasons: dict[str, Any] = {}

    def build(self, descriptors: Sequence[Descriptor], values: Mapping[str, RosValue]) -> None:
        """Make the controls, unless those that are there fit: the first group open, the others folded."""
        shown = tuple(row for row in descriptors if row.name in values and not row.name.startswith(_HIDDEN))
        if shown == self._descriptors:
            return
        for container in self._containers:
            container.remove()
        self._containers, self._widgets, self._reasons = [], {}, {}
        self._descriptors = shown
        groups: dict[str, list[Descriptor]] = {}
        for row in shown:
            groups.setdefault(row.name.rpartition('.')[0] or 'node', []).append(row)
        for number, (group, rows) in enumerate(groups.items()):
            folder = self._gui.add_folder(group, expand_by_default=number == 0)
            self._containers.append(folder)
            with folder:
                for row in rows:
                    self._add(row, values[row.name])

    def show(self, values: Mapping[str, RosValue], enabled: bool) -> None:
        """Show values in force; a control that is being moved is left alone."""
        for row in self._descriptors:
            if row.name in values and not self._changes.settling(row.name):
                self._widgets[row.name].show(values[row.name])
            self._widgets[row.name].enable(enabled and not row.read_only)

    def refused(self, names: Sequence[str], reason: str) -> None:
        """Show why a value was refused below its control."""
        for name in names:
            if name in self._reasons:
                self._reasons[name].content = markup.refusal(reason)
                self._reasons[name].visible = True

    def accepted(self, names: Sequence[str]) -> None:
        """Take refusals back."""
        for name in names:
            if name in self._reasons:
                self._reasons[name].visible = False

    def _add(self, row: Descriptor, value: RosValue) -> None:
        def asked(chosen: RosValue | SettingError, pause: float) -> None:
            self._changes.ask(row.name, chosen, pause)

        self._widgets[row.name] = _widget(self._gui, row, value, asked)
        self._reasons[row.name] = self._gui.add_html('', visible=False)


def _widget(gui: Any, row: Descriptor, value: RosValue, asked: Asked) -> _Widget:
    label = row.name.rpartition('.')[2].replace('_', ' ')
    if row.unit:
        label += f' [{row.unit}]'
    hint = f'{row.sentence} Allowed: {row.allowed}.' if row.allowed else row.sentence
    if row.kind is ParameterKind.BOOLEAN:
        return _Plain(gui.add_checkbox(label, bool(value), hint=hint), asked, _DRAGGED)
    if row.choices:
        choices = list(dict.fromkeys([*row.choices, str(value)]))
        return _Plain(gui.add_dropdown(label, choices, initial_value=str(value), hint=hint), asked, _DRAGGED)
    if (
        row.kind is ParameterKind.INTEGER
        and isinstance(value, int)
        and row.low is not None
        and row.high is not None
    ):
        step = int(row.step) or 1
        if (row.high - row.low) / step <= _MOST_STEPS and row.low <= value <= row.high:
            slider = gui.add_slider(label, int(row.low), int(row.high), step, value, hint=hint)
            return _Plain(slider, asked, _DRAGGED)
    if row.kind is ParameterKind.TEXT:
        return _Plain(gui.add_text(label, str(value), hint=hint), asked, _TYPED)
    return NumberWidget(gui, row, label, hint, value, asked)


class _Plain:
    """One element whose value is the parameter's.

    What it shows is compared with what was shown or chosen last, never with the element: that may hold a choice
    that is still on its way to us.
    """

    def __init__(self, handle: Any, asked: Asked, pause: float) -> None:
        self._handle = handle
        self._known = handle.value

        def chosen(event: Any) -> None:
            if event.client_id is not None:
                value = event.target.value
                asked(value, pause)
                self._known = value

        handle.on_update(chosen)

    def show(self, value: RosValue) -> None:
        if self._known != value:
            self._known = self._handle.value = value

    def enable(self, enabled: bool) -> None:
        if self._handle.disabled == enabled:
            self._handle.disabled = not enabled


class NumberWidget:
    """Numbers as text, because a length may be 1.25e-6; above it a slider, where a range says where to look.

    A range of lengths says what is possible, not what is sensible: only numbers without a unit get a slider.
    """

    def __init__(
        self,
        gui: Any,
        row: Descriptor,
        label: str,
        hint: str,
        value: RosValue,
        asked: Asked,
    ) -> None:
        self._row = row
        self._known: RosValue | None = value
        self._slider: Any = None
        self._logarithmic = False
        self._text = gui.add_text(label, text_of(value), hint=hint)
        low, high = row.low, row.high
        if row.kind is ParameterKind.REAL and not row.unit and low is not None and high is not None and high > low:
            self._logarithmic = low > 0 and high / low >= 10**_DECADES
            first, last = self._place(low), self._place(high)
            # Without a label, page.css hides the slider's own number, which would be a power of ten.
            self._slider = gui.add_slider(
                '', first, last, (last - first) / _MOST_STEPS, self._place(value), hint=hint,
                marks=_decades(first, last) if self._logarithmic else ((low, f'{low:g}'), (high, f'{high:g}')),
            )  # fmt: skip

            def dragged(event: Any) -> None:
                if event.client_id is not None:
                    chosen = self._at(event.target.value)
                    self._text.value = text_of(chosen)
                    asked(chosen, _DRAGGED)
                    self._known = chosen

            self._slider.on_update(dragged)

        def typed(event: Any) -> None:
            if event.client_id is None:
                return
            try:
                typed_value = value_of(event.target.value, row)
            except SettingError as error:
                asked(error, _TYPED)
                self._known = None
            else:
                asked(typed_value, _TYPED)
                self._known = typed_value
                if self._slider is not None:
                    self._slider.value = self._place(typed_value)

        self._text.on_update(typed)

    def show(self, value: RosValue) -> None:
        """Show the value that is in force."""
        if self._known != value:
            self._known = value
            self._text.value = text_of(value)
            if self._slider is not None:
                self._slider.value = self._place(value)

    def enable(self, enabled: bool) -> None:
        """Let it be moved or not."""
        for handle in (self._text, self._slider):
            if handle is not None and handle.disabled == enabled:
                handle.disabled = not enabled

    def _place(self, value: Any) -> float:
        """Where on the slider a value is."""
        low, high = self._row.low or 0.0, self._row.high or 0.0
        inside = min(max(float(value), low), high)
        return math.log10(inside) if self._logarithmic else inside

    def _at(self, place: float) -> float:
        """The value of a place, to three digits: a slider is not finer."""
        value = 10.0**place if self._logarithmic else place
        return min(max(float(f'{value:.3g}'), self._row.low or 0.0), self._row.high or 0.0)


def _decades(first: float, last: float) -> tuple[tuple[float, str], ...]:
    """Marks at the powers of ten between two; where there are many, every other has its number."""
    powers = range(math.ceil(first), math.floor(last) + 1)
    every = 1 if len(powers) <= 5 else 2
    return tuple((float(power), f'{10.0**power:g}' if power % every == 0 else '') for power in powers)


def text_of(value: RosValue) -> str:
    """A value as it is shown, and typed."""
    return ', '.join(str(item) for item in value) if isinstance(value, list) else f'{value}'


def value_of(text: str, row: Descriptor) -> RosValue:
    """The value that was typed for a parameter of numbers.

    Raises:
        SettingError: it is none.
    """
    try:
        if row.kind is ParameterKind.REAL:
            return float(text)
        if row.kind is ParameterKind.INTEGER:
            return int(text)
        items = yaml.safe_load(f'[{text.strip().strip("[]")}]')
    except (ValueError, yaml.YAMLError):
        items = [None]
    if row.kind is ParameterKind.INTEGERS and all(type(item) is int for item in items):
        return list(items)
    raise SettingError(f'{row.name} must be {row.kind.value}, not {text!r}.')
