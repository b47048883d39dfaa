# SPDX-License-Identifier: Apache-2.0
"""The 3D scene with its legend, its switches, and what a visitor points at."""

import math
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from socialcircle_ros.errors import SettingError
from socialcircle_ros.messages.image import OUTLIER
from socialcircle_ros.settings import RosValue
from socialcircle_ros.settings.groups import VOTERS

from . import colours, markup
from .axes import axes_of
from .comparison import Comparison
from .elements import icon, on_choice, set_value
from .link import Descriptor, ParameterKind
from .log import Log
from .pointing import on_ground, ray, region_between
from .view import SIDE, View, stretched
from .widgets import NumberWidget

if TYPE_CHECKING:
    import viser

_MOST_STRETCH = 1e5
_STRETCH = Descriptor(
    'z scale', ParameterKind.REAL, 'Factor on the heights in the scene.', low=1.0, high=_MOST_STRETCH
)
_FROM_THE_FRONT = (0.0, -2.0 * SIDE, 1.77 * SIDE), (0.0, -0.08 * SIDE, 0.0)
_FROM_ABOVE = (0.0, -1e-3 * SIDE, 2.7 * SIDE), (0.0, 0.0, 0.0)
_AXES, _MARK, _INTEREST = (150, 156, 166), (255, 255, 255), (255, 212, 59)

TakePoint = Callable[[tuple[int, int]], None]
"""Takes row and column of a point that was clicked."""

TakeRegion = Callable[[list[int]], None]
"""Takes a region that was drawn: row, column, height and width."""


class CloudScene:
    """The scene: the node's cloud, or both clouds of a comparison.

    Its methods are called within `update()`.

    Args:
        server: of the page. The legend and the switches are made in its current container.
        log: gets the reason where the scene cannot be drawn.
        pick: called with a point that is clicked.
        draw_region: called with a vote region that is drawn.
        look_at: called with a region of interest that is drawn; [] where it is to be forgotten.
    """

    def __init__(
        self,
        server: 'viser.ViserServer',
        log: Log,
        pick: TakePoint,
        draw_region: TakeRegion,
        look_at: TakeRegion,
    ) -> None:
        self._server, self._log, self._pick = server, log, pick
        self._draw_region, self._look_at = draw_region, look_at
        self._drawing = threading.RLock()
        self._view: View | None = None
        self._comparison: tuple[Comparison, View, View] | None = None
        self._picked: tuple[int, int] | None = None
        self._region: tuple[int, ...] = ()
        self._of_interest: tuple[int, ...] = ()
        self._stretch = 1.0
        self._set_camera()
        gui = server.gui
        self._legend = gui.add_html(markup.legend(None, 0))
        looks = gui.add_button_group('view', ('3D', 'from above'), hint='Resets the view.')
        looks.on_click(lambda event: log.guarded('Turning the view', self._look, event.target.value))
        self._build_regions(gui)
        with gui.add_folder('scene', expand_by_default=False):
            self._show_kept = gui.add_checkbox('kept points', initial_value=True)
            self._show_outliers = gui.add_checkbox('outliers', initial_value=True)
            self._show_axes = gui.add_checkbox('axes', initial_value=True)
            self._fit_stretch = gui.add_checkbox(
                'fit z scale', initial_value=True, hint='Choose the z scale of each cloud from its heights.'
            )
            self._scale = NumberWidget(gui, _STRETCH, 'z scale', _STRETCH.sentence, 1.0, self._stretch_chosen)
        for switch in (self._show_kept, self._show_outliers, self._show_axes, self._fit_stretch):
            on_choice(switch, lambda _: log.guarded('Drawing the scene', self._redraw))
        server.scene.on_click()(lambda event: log.guarded('Pointing at the cloud', self._clicked, event))

    @contextmanager
    def update(self) -> Iterator[None]:
        """One change of the scene: no other thread draws meanwhile, and browsers show it in one step."""
        with self._drawing, self._server.atomic():
            yield

    def show(self, view: View) -> None:
        """Show the node's cloud; while a comparison is shown, keep it for later."""
        self._view = view
        if self._comparison is None:
            self._draw_node_cloud(view)

    def mark(
        self,
        picked: tuple[int, int] | None,
        region: tuple[int, ...],
        of_interest: tuple[int, ...],
        *,
        votes: bool,
    ) -> None:
        """Mark the point that was clicked and the regions.

        Args:
            picked: row and column; None: no point.
            region: row, column, height and width of the vote region; empty: none.
            of_interest: row, column, height and width of the region of interest; empty: none.
            votes: whether the mode of the node has a vote region, so that one can be drawn.
        """
        self._vote_button.visible = votes
        self._interest_button.visible = self._view is not None
        self._forget_button.visible = bool(of_interest)
        self._picked, self._region, self._of_interest = picked, region, of_interest
        self._draw_marks()

    def clear(self, reason: str) -> None:
        """Show no cloud, and why."""
        self._view = self._comparison = None
        for name in ('/cloud', '/compare', '/axes', '/marks'):
            self._server.scene.remove_by_name(name)
        self._legend.content = markup.note(reason, bad=True)

    def show_comparison(self, comparison: Comparison, a: View, b: View) -> None:
        """Show both clouds of a comparison in place of the node's cloud."""
        self._comparison = comparison, a, b
        for name in ('/cloud', '/axes', '/marks'):
            self._server.scene.remove_by_name(name)
        self._draw_comparison(comparison, a, b)

    def end_comparison(self) -> None:
        """Show the node's cloud again."""
        self._comparison = None
        self._server.scene.remove_by_name('/compare')
        if self._view is not None:
            self._draw_node_cloud(self._view)

    def _build_regions(self, gui: 'viser.GuiApi') -> None:
        drag = 'Drag a rectangle over the cloud, seen from above.'
        self._interest_button = gui.add_button(
            'Look at a region', icon=icon('zoom-in-area'), visible=False, hint=drag
        )
        self._forget_button = gui.add_button('Close the region', icon=icon('x'), visible=False)
        self._vote_button = gui.add_button(
            'Draw the vote region', icon=icon('marquee-2'), visible=False, hint=drag
        )
        self._interest_button.on_click(
            lambda _: self._log.guarded('Drawing a region', self._begin_region, self._look_at, math.inf)
        )
        self._forget_button.on_click(lambda _: self._log.guarded('Closing the region', self._look_at, []))
        self._vote_button.on_click(
            lambda _: self._log.guarded('Drawing the vote region', self._begin_region, self._draw_region, VOTERS)
        )

    def _set_camera(self) -> None:
        self._server.scene.set_up_direction('+z')
        self._server.scene.world_axes.visible = False
        camera = self._server.initial_camera
        camera.position, camera.look_at = _FROM_THE_FRONT
        camera.fov = 0.75

    def _look(self, name: str) -> None:
        """Turn the view of every visitor."""
        position, look_at = _FROM_THE_FRONT if name == '3D' else _FROM_ABOVE
        for client in self._server.get_clients().values():
            with client.atomic():
                client.camera.up_direction = (0.0, 0.0, 1.0) if name == '3D' else (0.0, 1.0, 0.0)
                client.camera.position, client.camera.look_at = position, look_at

    def _clicked(self, event: 'viser.SceneClickEvent') -> None:
        view = self._view
        if view is None or self._comparison is not None:
            return
        found = view.nearest(np.array(event.ray_origin), np.array(event.ray_direction), self._stretch)
        if found is not None:
            self._pick(found)

    def _begin_region(self, take: TakeRegion, most: float) -> None:
        """Let a visitor drag a rectangle.

        Args:
            take: called with the region below it.
            most: number of points that it may have.
        """
        self._look('from above')

        def selected(event: 'viser.SceneRectSelectEvent') -> None:
            self._server.scene.remove_rect_select_callback('all')
            self._log.guarded('Drawing the region', self._end_region, event, take, most)

        self._server.scene.remove_rect_select_callback('all')
        self._server.scene.on_rect_select()(selected)
        self._log.notify('Drag a rectangle over the cloud.')

    def _end_region(self, event: 'viser.SceneRectSelectEvent', take: TakeRegion, most: float) -> None:
        view, camera = self._view, event.client.camera
        if view is None:
            return
        corners = [
            on_ground(camera.position, ray(corner, camera.wxyz, camera.fov, camera.aspect))
            for corner in (event.screen_min, event.screen_max)
        ]
        if corners[0] is not None and corners[1] is not None:
            take(region_between(view, corners[0], corners[1], most))

    def _redraw(self) -> None:
        with self.update():
            if self._comparison is not None:
                self._draw_comparison(*self._comparison)
            elif self._view is not None:
                self._draw_node_cloud(self._view)

    def _stretch_chosen(self, stretch: RosValue | SettingError, _: float) -> None:
        """Apply a z scale that was typed or dragged to; an incomplete number is ignored."""
        if not isinstance(stretch, float) or not stretch >= 1.0:
            return
        set_value(self._fit_stretch, False)
        self._stretch = min(stretch, _MOST_STRETCH)
        self._scale.show(self._stretch)
        self._log.guarded('Drawing the scene', self._redraw)

    def _draw_node_cloud(self, view: View) -> None:
        self._fit(view)
        outliers, far = view.stretched_outliers(self._stretch)
        self._legend.content = markup.legend(view, far)
        self._draw('/cloud', view, outliers, colours.OUTLIER)
        self._draw_axes(view)
        self._draw_marks()

    def _draw_comparison(self, comparison: Comparison, *views: View) -> None:
        """Draw both results side by side; the colour of an outlier says whether both settings find it."""
        a, b = comparison.a, comparison.b
        self._legend.content = markup.comparison_legend(views[0])
        rows = zip((a, b), (b, a), views, 'AB', (colours.ONLY_A, colours.ONLY_B), strict=True)
        for side, other, view, letter, colour in rows:
            self._fit(view)
            outliers, _ = view.stretched_outliers(self._stretch)
            shared = other.mask[view.drawing.outliers] == OUTLIER
            outlier_colours = np.where(shared[:, None], colours.BOTH, colour).astype(np.uint8)
            x = (view.size[0] / 4 + SIDE / 40) * (-1 if letter == 'A' else 1)
            self._draw(f'/compare/{letter}', view, outliers, outlier_colours, x, 0.5)
            self._server.scene.add_label(
                f'/compare/{letter}/label',
                f'{letter}: {side.name}, {side.measurement.values.outliers:,} outliers',
                position=(x - view.size[0] / 8, -view.size[1] / 4 - SIDE / 20, 0.0),
            )  # fmt: skip

    def _draw(
        self,
        name: str,
        view: View,
        outliers: npt.NDArray[np.float32],
        outlier_colours: npt.NDArray[np.uint8] | tuple[int, int, int],
        x: float = 0.0,
        size: float = 1.0,
    ) -> None:
        """Draw one cloud.

        Points are multiplied by `size` here, because viser's own scale would also scale the marks.

        Args:
            name: of its node in the scene.
            view: the cloud.
            outliers: (m, 3) the stretched positions of its outliers.
            outlier_colours: (m, 3), or one colour for all.
            x: of the middle of the cloud, in the scene.
            size: factor on the cloud.
        """
        self._server.scene.add_point_cloud(
            f'{name}/kept', size * stretched(view.kept, self._stretch), view.kept_colours,
            point_size=1.1 * size * view.pitch, point_shading='flat', precision='float32',
            position=(x, 0.0, 0.0), visible=self._show_kept.value,
        )  # fmt: skip
        self._server.scene.add_point_cloud(
            f'{name}/outliers', size * outliers, outlier_colours, point_size=size * view.outlier_size,
            point_shape='circle', point_shading='flat', precision='float32',
            position=(x, 0.0, 0.0), visible=self._show_outliers.value,
        )  # fmt: skip

    def _draw_axes(self, view: View) -> None:
        scene = self._server.scene
        scene.remove_by_name('/axes')
        if not self._show_axes.value:
            return
        axes = axes_of(view, self._stretch)
        scene.add_line_segments('/axes/lines', axes.lines, _AXES, thickness=1.5, thickness_units='screen')
        for number, (text, position) in enumerate(axes.labels):
            scene.add_label(
                f'/axes/{number}', text, position=position, anchor='center-center', font_screen_scale=0.85
            )

    def _draw_marks(self) -> None:
        """Draw a ring at the point that was clicked, and the outlines of the regions."""
        scene, view = self._server.scene, self._view
        scene.remove_by_name('/marks')
        if view is None or self._comparison is not None:
            return
        if self._picked is not None:
            height = float(view.drawing.heights[self._picked])
            x, y, z = view.position(*self._picked, height, self._stretch)
            scene.add_icosphere(
                '/marks/picked', radius=SIDE / 90, color=_MARK, wireframe=True,
                position=(x, y, float(np.clip(z, -SIDE, SIDE))),
            )  # fmt: skip
        for name, region, colour in (('vote', self._region, _MARK), ('interest', self._of_interest, _INTEREST)):
            if not region:
                continue
            row, column, tall, wide = region
            top = view.drawing.height_span[1]
            places = [
                (row - 0.5, column - 0.5), (row - 0.5, column + wide - 0.5),
                (row + tall - 0.5, column + wide - 0.5), (row + tall - 0.5, column - 0.5),
            ]  # fmt: skip
            corners = [view.position(*place, top, self._stretch) for place in places]
            lines = np.array(list(zip(corners, [*corners[1:], corners[0]], strict=True)), np.float32)
            scene.add_line_segments(f'/marks/{name}', lines, colour, thickness=2.0, thickness_units='screen')

    def _fit(self, view: View) -> None:
        """Fit the z scale to the cloud, where that is switched on."""
        if self._fit_stretch.value:
            self._stretch = view.stretch()
            self._scale.show(self._stretch)
