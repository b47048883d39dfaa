# SPDX-License-Identifier: Apache-2.0
"""The tab Result: the cloud that is shown in numbers, in the scene, and as map, profile and histogram."""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.focus import FocusCurve
from socialcircle_ros.messages.point_cloud import PointCloud
from socialcircle_ros.settings import LimitSettings
from socialcircle_ros.settings.effects import VOTE_REGION

from . import charts, colours, markup
from .changes import Changes
from .display import ALONG, QUANTITIES, Display, Drawing, drawing_of, quantities_of
from .elements import icon, on_choice
from .link import ShownCloud
from .log import Log
from .regions import region_numbers
from .scene import CloudScene
from .state import CurrentState, State
from .view import View, view_of
from .why import explanation_of, scores_of

if TYPE_CHECKING:
    import viser

    from .comparison import Comparison

_LIMITS = f'{LimitSettings.group}.'

ReadCurve = Callable[[int, tuple[int, int]], FocusCurve | None]
"""Gives the focus curve of a pixel, by the number of its stack in the recording that is open, row and column."""

NO_PICTURE = np.zeros((24, 32, 3), np.uint8)
"""What an image shows before there is a cloud."""


@dataclass(frozen=True)
class _Drawn:
    """What is drawn: which cloud, and how."""

    cloud: ShownCloud
    how: tuple[Display, str | None]


class ResultTab:
    """The cloud that is shown.

    Args:
        server: of the page. The elements are made in its current container.
        changes: takes a vote region that is drawn.
        current: the state of the page.
        log: gets the reason where a cloud cannot be shown.
        focus_curve: of a pixel, from the recording that is open.
    """

    def __init__(
        self,
        server: 'viser.ViserServer',
        changes: Changes,
        current: CurrentState,
        log: Log,
        focus_curve: ReadCurve,
    ) -> None:
        gui = server.gui
        self._changes, self._current, self._log = changes, current, log
        self._focus_curve = focus_curve
        self._shown: ShownCloud | None = None
        self._drawn: _Drawn | None = None
        self._compared: tuple[Comparison, Display] | None = None
        self._charted: tuple[object, ...] = ()
        self._view: View | None = None
        self._scores: tuple[ShownCloud, npt.NDArray[np.float32] | None] | None = None
        self._title = gui.add_html('')
        self._measurement = gui.add_html(markup.measurement(None))
        self._scene = CloudScene(server, log, self._pick, self._draw_region, self._look_at)
        self._build_display(gui)
        self._map = gui.add_html('')
        self._region = gui.add_html('')
        self._why = gui.add_html('')
        self._curve_button = gui.add_button(
            'Focus curve of this point', icon=icon('chart-histogram'), visible=False,
            hint='Measures the frames of the recording again.',
        )  # fmt: skip
        self._curve_button.on_click(lambda _: log.guarded('Measuring the focus curve', self._measure_curve))
        self._curve = gui.add_html('')
        self._profile = gui.add_html('')
        self._histogram = gui.add_html('')
        self._details = gui.add_html(markup.details(None))

    def show(self, state: State) -> None:
        """Show the cloud of the state and what the node made of it, or the comparison on it."""
        self._title.content = markup.title(state)
        shown = state.shown
        if shown is None:
            return
        drawn = self._drawn
        if drawn is None or drawn.cloud is not shown or drawn.how != (state.display, state.unit):
            self._draw(shown, state)
        self._show_comparison(state)
        limits = [value for name, value in state.snapshot.values.items() if name.startswith(_LIMITS)]
        charted = (
            id(self._drawn), state.picked, state.region, state.votes, id(self._scores), state.region_of_interest,
            id(state.curve), state.stack_number, *limits,
        )  # fmt: skip
        if self._view is not None and charted != self._charted:
            self._charted = charted
            with self._scene.update():
                self._scene.mark(state.picked, state.region, state.region_of_interest, votes=state.votes)
                self._draw_charts(self._view.drawing, state)
                self._show_region(self._view.drawing, state)

    def _build_display(self, gui: 'viser.GuiApi') -> None:
        with gui.add_folder('display', expand_by_default=False):
            self._values = gui.add_dropdown('values', [str(QUANTITIES[0])], hint='What the colours show.')
            self._colours = gui.add_dropdown('colours', colours.MAPS)
            self._full = gui.add_checkbox(
                'full range', initial_value=False, hint='Colours span all kept points, not 99 % of them.'
            )
            self._level = gui.add_checkbox(
                'level', initial_value=False, hint='Heights are relative to the plane through the kept points.'
            )
            self._along = gui.add_dropdown(
                'profile', [str(along) for along in ALONG], hint='Click a point to choose which one.'
            )

        def chosen(_: object) -> None:
            self._log.guarded('Displaying the cloud', self._choose_display)

        on_choice(self._values, chosen)
        on_choice(self._colours, chosen)
        on_choice(self._along, chosen)
        on_choice(self._full, chosen)
        on_choice(self._level, chosen)

    def _choose_display(self) -> None:
        chosen = Display(
            values=next(values for values in QUANTITIES if values == self._values.value),
            colour_map=self._colours.value,
            full_range=self._full.value,
            levelled=self._level.value,
            along=next(along for along in ALONG if along == self._along.value),
        )
        self._current.change(lambda state: state.displaying(chosen))

    def _draw(self, shown: ShownCloud, state: State) -> None:
        """Draw the cloud of the node, and show its numbers."""
        self._drawn = _Drawn(shown, (state.display, state.unit))
        with self._scene.update():
            self._details.content = markup.details(shown, state.unit)
            if shown is not self._shown:
                self._shown = shown
                self._measurement.content = markup.measurement(shown)
            try:
                cloud = PointCloud.decode(shown.cloud)
                offered = quantities_of(cloud)
                self._view = view_of(_drawing(cloud, shown.mask, state))
            except SocialCircleError as error:
                self._view = None
                self._log.add(str(error), bad=True)
                self._curve_button.visible = False
                for element in (self._map, self._region, self._why, self._curve, self._profile, self._histogram):
                    element.content = ''
                self._scene.clear(str(error))
                return
            if self._values.options != offered:
                self._values.options = offered
            self._scene.show(self._view)

    def _show_comparison(self, state: State) -> None:
        comparison, before = state.comparison, self._compared
        if comparison is None and before is None:
            return
        if before is not None and before[0] is comparison and before[1] == state.display:
            return
        self._compared = (comparison, state.display) if comparison is not None else None
        with self._scene.update():
            if comparison is None:
                self._scene.end_comparison()
                return
            cloud = PointCloud.decode(comparison.cloud)
            sides = (comparison.a, comparison.b)
            self._scene.show_comparison(
                comparison, *(view_of(_drawing(cloud, side.mask, state)) for side in sides)
            )

    def _draw_charts(self, drawing: Drawing, state: State) -> None:
        self._map.content = markup.chart(
            f'map: {drawing.range_sentence}',
            charts.map_svg(drawing, state.picked, state.region, state.region_of_interest),
        )
        place = state.picked or (drawing.down.count // 2, drawing.across.count // 2)
        which = f'row {place[0]}' if drawing.display.along == 'row' else f'column {place[1]}'
        self._profile.content = markup.chart(f'profile: {which}', charts.profile_svg(drawing, place))
        self._histogram.content = markup.chart('heights, number of points', charts.histogram_svg(drawing))
        self._why.content = self._reason(drawing, state)
        self._curve_button.visible = state.picked is not None and state.stack_number is not None
        self._curve.content = (
            '' if state.curve is None else markup.curve(state.curve, charts.curve_svg(state.curve))
        )

    def _show_region(self, drawing: Drawing, state: State) -> None:
        place = state.region_of_interest
        if not place:
            self._region.content = ''
            return
        limits = LimitSettings.from_ros(state.snapshot.values)
        self._region.content = markup.region(region_numbers(drawing, place, limits), drawing.unit)

    def _reason(self, drawing: Drawing, state: State) -> str:
        if state.picked is None or state.shown is None:
            return markup.why(['Click a point in the scene to see why it was removed or kept.'])
        scores = self._scores[1] if self._scores is not None and self._scores[0] is state.shown else None
        radius = state.shown.numbers.radius if state.shown.numbers is not None else float('nan')
        return markup.why(explanation_of(drawing, state.picked, radius, scores).sentences(state.unit))

    def _pick(self, place: tuple[int, int]) -> None:
        """Show why a point was called an outlier; its score follows, because it is computed here."""
        state = self._current.change(lambda state: state.picking(place))
        shown = state.shown
        if shown is None or state.differing or (self._scores is not None and self._scores[0] is shown):
            return
        xyz = PointCloud.decode(shown.cloud).xyz()
        self._scores = shown, scores_of(xyz, state.snapshot.values, shown.depth_of_field)
        self._current.change(dataclasses.replace)

    def _measure_curve(self) -> None:
        """Show the focus curve of the point that was clicked."""
        state = self._current.now
        shown, place, number = state.shown, state.picked, state.stack_number
        if shown is None or place is None or number is None:
            return
        self._curve.content = markup.note('Measuring the frames …')
        try:
            curve = self._focus_curve(number, place)
        except SocialCircleError as error:
            self._curve.content = markup.note(str(error), bad=True)
            return
        if curve is not None:
            self._current.change(lambda state: state.with_curve((shown.cloud, place), curve))

    def _look_at(self, region: list[int]) -> None:
        self._current.change(lambda state: state.looking_at(tuple(region)))

    def _draw_region(self, region: list[int]) -> None:
        reason = self._changes.apply({VOTE_REGION: region})
        if not reason:
            self._log.notify(f'The vote region is now {region}.')


def _drawing(cloud: PointCloud, mask: npt.NDArray[np.uint8], state: State) -> Drawing:
    return drawing_of(cloud, mask, state.display, state.unit)
