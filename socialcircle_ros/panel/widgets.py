# SPDX-License-Identifier: Apache-2.0
"""Widgets that show one value each, and pass on what a visitor chooses."""

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, Protocol

from socialcircle_ros.errors import SettingError
from socialcircle_ros.settings import PARAMETERS, RosValue
from socialcircle_ros.settings.plain_yaml import load_plain_yaml

from .elements import Value, on_choice, set_value
from .link import Descriptor, ParameterKind

if TYPE_CHECKING:
    import viser

_DRAG_PAUSE_S, _TYPING_PAUSE_S = 0.05, 0.7  # in which a newer value replaces one that was dragged to, or typed
_MOST_SLIDER_STEPS = 200  # a parameter with more values is typed
_LOGARITHMIC_DECADES = 3  # a range at least this wide has a logarithmic slider
_MOST_LABELLED_MARKS = 5
_MARKED_PARTS = 4  # into which the marks divide a slider of whole numbers
_SENTENCE_END = re.compile(r"(?<=\.)\s+(?=[A-Z0-9'])")
_INTEGERS = 2**63  # a whole number of ROS is less than this, and at least its negative

Choose = Callable[[RosValue | SettingError, float], None]
"""Takes a value, or the error in a text that was typed, and the time in s in which a newer one replaces it."""


class Widget(Protocol):
    """One or two elements that show one value."""

    def show(self, value: RosValue) -> None:
        """Show the current value."""

    def enable(self, enabled: bool) -> None:
        """Allow the value to be changed, or not."""

    def reveal(self, visible: bool) -> None:
        """Show the elements, or hide them."""


def widget_of(gui: 'viser.GuiApi', row: Descriptor, value: RosValue, choose: Choose) -> Widget:
    """Make the widget that fits a parameter.

    Args:
        gui: of the page. The widget is made in its current container.
        row: the parameter.
        value: its current value.
        choose: called with what a visitor chooses.
    """
    label = row.name.rpartition('.')[2].replace('_', ' ')
    if row.unit:
        label += ' [unit of the cloud]' if row.unit == 'cloud' else f' [{row.unit}]'
    hint = hint_of(row)
    if row.kind is ParameterKind.BOOLEAN:
        return _ElementWidget(gui.add_checkbox(label, bool(value), hint=hint), choose, _DRAG_PAUSE_S)
    if row.choices:
        choices = list(dict.fromkeys([*row.choices, str(value)]))
        dropdown = gui.add_dropdown(label, choices, initial_value=str(value), hint=hint)
        return _ElementWidget(dropdown, choose, _DRAG_PAUSE_S)
    if (
        row.kind is ParameterKind.INTEGER
        and isinstance(value, int)
        and row.low is not None
        and row.high is not None
    ):
        step = int(row.step) or 1
        if (row.high - row.low) / step <= _MOST_SLIDER_STEPS and row.low <= value <= row.high:
            marks = _whole_marks(int(row.low), int(row.high), step)
            slider = gui.add_slider(label, int(row.low), int(row.high), step, value, hint=hint, marks=marks)
            return _ElementWidget(slider, choose, _DRAG_PAUSE_S)
    if row.kind is ParameterKind.TEXT:
        return _ElementWidget(gui.add_text(label, str(value), hint=hint), choose, _TYPING_PAUSE_S)
    return NumberWidget(gui, row, label, hint, value, choose)


class _ElementWidget(Generic[Value]):
    """One element that holds the value of the parameter itself.

    A new value is compared with the value that was shown or chosen last, and not with the element's: the element
    may hold a choice that has not been handled yet.
    """

    def __init__(self, element: 'viser.GuiInputHandle[Value]', choose: Choose, pause_s: float) -> None:
        self._element: viser.GuiInputHandle[Value] = element
        self._choose, self._pause_s = choose, pause_s
        self._known: RosValue = element.value
        on_choice(element, self._chosen)

    def show(self, value: RosValue) -> None:
        if self._known != value:
            self._known = value
            set_value(self._element, value)

    def enable(self, enabled: bool) -> None:
        if self._element.disabled == enabled:
            self._element.disabled = not enabled

    def reveal(self, visible: bool) -> None:
        self._element.visible = visible

    def _chosen(self, value: Value) -> None:
        self._choose(value, self._pause_s)
        self._known = value


class NumberWidget:
    """Numbers as text, because a length may be 1.25e-6; below them a slider, where the range suits one.

    Only numbers without a unit get a slider: the range of a length says what is possible, which is far more than
    what is sensible.

    Args:
        gui: of the page. The elements are made in its current container.
        row: the parameter.
        label: of the text.
        hint: shown while the pointer is over an element.
        value: the current value.
        choose: called with what a visitor chooses.
    """

    def __init__(
        self,
        gui: 'viser.GuiApi',
        row: Descriptor,
        label: str,
        hint: str,
        value: RosValue,
        choose: Choose,
    ) -> None:
        self._row = row
        self._choose = choose
        self._known: RosValue | None = value  # None: a text that is no number
        self._text = gui.add_text(label, text_of(value, row.name), hint=hint)
        self._scale = _SliderScale.of(row)
        self._slider: viser.GuiSliderHandle[float] | None = None
        if self._scale is not None and isinstance(value, (int, float)):
            first, last = self._scale.place(self._scale.low), self._scale.place(self._scale.high)
            # page.css hides the number beside a slider without a label: of a logarithmic one it is a power of ten.
            self._slider = gui.add_slider(
                '', first, last, (last - first) / _MOST_SLIDER_STEPS, self._scale.place(value), hint=hint,
                marks=self._scale.marks(),
            )  # fmt: skip
            on_choice(self._slider, self._dragged)
        on_choice(self._text, self._typed)

    def show(self, value: RosValue) -> None:
        """Show the current value."""
        if self._known != value:
            self._known = value
            set_value(self._text, text_of(value, self._row.name))
            self._move_slider(value)

    def enable(self, enabled: bool) -> None:
        """Allow the value to be changed, or not."""
        for element in (self._text, self._slider):
            if element is not None and element.disabled == enabled:
                element.disabled = not enabled

    def reveal(self, visible: bool) -> None:
        """Show the elements, or hide them."""
        for element in (self._text, self._slider):
            if element is not None:
                element.visible = visible

    def _dragged(self, place: float) -> None:
        if self._scale is None:
            return
        value = self._scale.value(place)
        set_value(self._text, text_of(value, self._row.name))
        self._choose(value, _DRAG_PAUSE_S)
        self._known = value

    def _typed(self, text: str) -> None:
        try:
            value = value_of(text, self._row)
        except SettingError as error:
            self._choose(error, _TYPING_PAUSE_S)
            self._known = None
        else:
            self._choose(value, _TYPING_PAUSE_S)
            self._known = value
            self._move_slider(value)

    def _move_slider(self, value: RosValue) -> None:
        if self._slider is not None and self._scale is not None and isinstance(value, (int, float)):
            set_value(self._slider, self._scale.place(value))


@dataclass(frozen=True)
class _SliderScale:
    """Places of the values of a range on a slider: linear, or logarithmic where the range is wide."""

    low: float
    high: float

    @classmethod
    def of(cls, row: Descriptor) -> '_SliderScale | None':
        """The scale for a parameter; None where a slider does not suit it."""
        if row.kind is not ParameterKind.REAL or row.unit or row.low is None or row.high is None:
            return None
        return cls(row.low, row.high) if 0 < row.high - row.low < math.inf else None

    @property
    def logarithmic(self) -> bool:
        return self.low > 0 and self.high / self.low >= 10**_LOGARITHMIC_DECADES

    def place(self, value: float) -> float:
        """The place of a value; of a value outside the range, the end that is nearer."""
        inside = min(max(float(value), self.low), self.high)
        return math.log10(inside) if self.logarithmic else inside

    def value(self, place: float) -> float:
        """The value at a place, rounded to 3 significant digits because a slider is not finer."""
        value = 10.0**place if self.logarithmic else place
        return min(max(float(f'{value:.3g}'), self.low), self.high)

    def marks(self) -> tuple[tuple[float, str], ...]:
        """Place and label of the marks: the ends of a linear scale, the powers of ten of a logarithmic one."""
        if not self.logarithmic:
            return (self.low, f'{self.low:g}'), (self.high, f'{self.high:g}')
        powers = range(math.ceil(self.place(self.low)), math.floor(self.place(self.high)) + 1)
        labelled = 1 if len(powers) <= _MOST_LABELLED_MARKS else 2
        return tuple((float(power), f'{10.0**power:g}' if power % labelled == 0 else '') for power in powers)


def _whole_marks(low: int, high: int, step: int) -> tuple[tuple[int, str], ...]:
    """Marks of a slider of whole numbers, all of them values that it takes: odd ones where only odd ones are."""
    count = (high - low) // step
    places = sorted({low + step * round(count * part / _MARKED_PARTS) for part in range(_MARKED_PARTS + 1)})
    return tuple((place, str(place)) for place in places)


def hint_of(row: Descriptor) -> str:
    """The help for a parameter in one sentence: the first of its description, and the accepted values."""
    first = _SENTENCE_END.split(row.sentence, maxsplit=1)[0].strip().rstrip('.')
    if row.choices and ' ' not in first:
        return f'{first}: {" or ".join(row.choices)}.'
    return f'{first} ({row.allowed}).' if row.allowed else f'{first}.'


def text_of(value: RosValue, name: str = '') -> str:
    """A value as text, in the form in which it can be typed.

    Args:
        value: the value.
        name: of its parameter; the value may be one that stands for automatic, or for none.
    """
    parameter = PARAMETERS.get(name)
    if parameter is not None and parameter.empty is not None and value == parameter.empty:
        return parameter.empty_text
    return ', '.join(str(item) for item in value) if isinstance(value, list) else f'{value}'


def value_of(text: str, row: Descriptor) -> RosValue:
    """Read a text that was typed for a parameter of numbers.

    Raises:
        SettingError: it does not hold what the parameter holds.
    """
    parameter = PARAMETERS.get(row.name)
    if parameter is not None and parameter.empty is not None and text.strip() == parameter.empty_text:
        return parameter.empty
    try:
        if row.kind is ParameterKind.REAL:
            return float(text if '.' in text else text.replace(',', '.', 1))  # 1,5 is 1.5
        whole = row.kind is ParameterKind.INTEGER
        found: object = [int(text)] if whole else load_plain_yaml(f'[{text.strip().strip("[]")}]')
    except ValueError:
        found = None
    items = [item for item in found if type(item) is int] if isinstance(found, list) else []
    if not isinstance(found, list) or len(items) < len(found):
        raise SettingError(f'{row.name} must be {row.kind.value}, not {text!r}.')
    if any(not -_INTEGERS <= item < _INTEGERS for item in items):
        raise SettingError(f'{row.name} cannot be {text!r}: ROS holds whole numbers of at most 64 bits.')
    return items[0] if whole else items
