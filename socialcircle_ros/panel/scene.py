"""The 3D scene with its legend and its switches."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from socialcircle_ros.errors import SettingError
from socialcircle_ros.messages.image import OUTLIER
from socialcircle_ros.messages.point_cloud import PointCloud
from socialcircle_ros.settings import RosValue

from . import colours, markup
from .comparison import Comparison
from .elements import on_choice, set_value
from .link import Descriptor, ParameterKind
from .log import Log
from .view import SIDE, View, stretched, view_of
from .widgets import NumberWidget

if TYPE_CHECKING:
    import viser

_MOST_STRETCH = 1e5
_STRETCH = Descriptor(
    'z scale', ParameterKind.REAL, 'Factor on the heights in the scene.', low=1.0, high=_MOST_STRETCH
)


class CloudScene:
    """The scene: the node's cloud, or both clouds of a comparison.

    Its methods are called within `update()`.

    Args:
        server: of the page. The legend and the switches are made in its current container.
        log: gets the reason where the scene cannot be drawn.
    """

    def __init__(self, server: 'viser.ViserServer', log: Log) -> None:
        self._server, self._log = server, log
        self._drawing = threading.RLock()
        self._view: View | None = None
        self._comparison: Comparison | None = None
        self._stretch = 1.0
        self._set_camera()
        gui = server.gui
        self._legend = gui.add_html(markup.legend(None, 0))
        with gui.add_folder('scene'):
            self._show_kept = gui.add_checkbox('kept points', initial_value=True)
            self._show_outliers = gui.add_checkbox('outliers', initial_value=True)
            self._fit_stretch = gui.add_checkbox(
                'fit z scale', initial_value=True, hint='Choose the z scale of each cloud from its heights.'
            )
            self._scale = NumberWidget(gui, _STRETCH, 'z scale', _STRETCH.sentence, 1.0, self._stretch_chosen)
        for switch in (self._show_kept, self._show_outliers, self._fit_stretch):
            on_choice(switch, lambda _: log.guarded('Drawing the scene', self._redraw))

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

    def clear(self, reason: str) -> None:
        """Show no cloud, and why."""
        self._view = None
        for name in ('/cloud', '/compare'):
            self._server.scene.remove_by_name(name)
        self._legend.content = markup.note(reason, bad=True)

    def show_comparison(self, comparison: Comparison) -> None:
        """Show both clouds of a comparison in place of the node's cloud."""
        self._comparison = comparison
        self._server.scene.remove_by_name('/cloud')
        self._draw_comparison(comparison)

    def end_comparison(self) -> None:
        """Show the node's cloud again."""
        self._comparison = None
        self._server.scene.remove_by_name('/compare')
        if self._view is not None:
            self._draw_node_cloud(self._view)

    def _set_camera(self) -> None:
        self._server.scene.set_up_direction('+z')
        self._server.scene.world_axes.visible = False
        camera = self._server.initial_camera
        camera.position = (0.0, -1.5 * SIDE, 1.2 * SIDE)
        camera.look_at = (0.0, -0.05 * SIDE, 0.0)
        camera.fov = 0.75

    def _redraw(self) -> None:
        with self.update():
            if self._comparison is not None:
                self._draw_comparison(self._comparison)
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
        self._place_floor(view)
        outliers, far = view.stretched_outliers(self._stretch)
        self._legend.content = markup.legend(view, far)
        self._draw('/cloud', view, outliers, colours.OUTLIER)

    def _draw_comparison(self, comparison: Comparison) -> None:
        """Draw both results side by side; the colour of an outlier says whether both settings find it."""
        xyz = PointCloud.decode(comparison.cloud).xyz()
        a, b = comparison.a, comparison.b
        for side, other, letter, colour in ((a, b, 'A', colours.ONLY_A), (b, a, 'B', colours.ONLY_B)):
            view = view_of(xyz, side.mask)
            self._place_floor(view)
            outliers, _ = view.stretched_outliers(self._stretch)
            shared = other.mask[side.mask == OUTLIER] == OUTLIER
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

    def _place_floor(self, view: View) -> None:
        """Fit the z scale to the cloud, where that is switched on, and place the floor below the cloud."""
        if self._fit_stretch.value:
            self._stretch = view.stretch()
            self._scale.show(self._stretch)
        self._server.scene.add_grid(
            '/floor', 1.6 * SIDE, 1.6 * SIDE, cell_size=SIDE / 10, section_size=SIDE / 2, plane='xy',
            position=(0.0, 0.0, -0.5 * view.height * self._stretch - SIDE / 20),
            cell_color=(60, 64, 72), section_color=(80, 86, 96),
        )  # fmt: skip
