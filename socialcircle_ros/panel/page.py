"""The page: a scene between two docks, kept up to date with what the link says."""

import io
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from socialcircle_ros.errors import SettingError, SocialCircleError
from socialcircle_ros.messages.image import OUTLIER
from socialcircle_ros.messages.point_cloud import PointCloud
from socialcircle_ros.settings import RosValue

from . import colours, markup
from .changes import Changes
from .clouds import RecordedClouds
from .comparison import Comparison, compare
from .controls import Controls, NumberWidget
from .link import Descriptor, Link, LogEntry, ParameterKind, Presence, ShownCloud, Snapshot
from .presets import Presets
from .view import SIDE, View, height_picture, mask_picture, stretched, view

if TYPE_CHECKING:
    import viser

PERIOD = 0.25  # s between two updates of the page, at least
_IN_FORCE = 'in force now'
_NO_PRESET = 'none saved yet'
_PREVIOUS, _NEXT = '◀ previous', 'next ▶'
_LOG_LINES = 60
_STRETCH = Descriptor('z scale', ParameterKind.REAL, 'How many times heights are stretched.', low=1.0, high=1e5)
_EMPTY = np.zeros((24, 32, 3), np.uint8)


class Page:
    """The page of one node.

    Args:
        server: viser's, listening already.
        link: to the node.
        presets: where they are kept.
    """

    def __init__(self, server: 'viser.ViserServer', link: Link, presets: Presets) -> None:
        self._server, self._link, self._presets = server, link, presets
        self._snapshot = Snapshot()
        self._log: deque[LogEntry] = deque(maxlen=_LOG_LINES)
        self._logged = 0
        self._drawing = threading.RLock()
        self._shown: ShownCloud | None = None
        self._view: View | None = None
        self._stretch = 1.0
        self._clouds: RecordedClouds | None = None
        self._stepping = threading.RLock()
        self._wanted = 1  # cloud of the recording
        self._comparison: Comparison | None = None
        self._changes = Changes(link, lambda: self._snapshot.values, self._refused, self._accepted)
        self._build()

    def run(self, stop: Callable[[], bool]) -> None:
        """Follow the node until `stop` says so."""
        try:
            while not stop():
                began = time.monotonic()
                self.follow(self._link.wait(self._snapshot.revision, PERIOD))
                time.sleep(max(0.0, PERIOD - (time.monotonic() - began)))
        finally:
            self._changes.stop()
            if self._clouds is not None:
                self._clouds.close()

    def follow(self, snapshot: Snapshot) -> None:
        """Show what has changed since the last snapshot."""
        before, self._snapshot = self._snapshot, snapshot
        self._node.content = markup.node_card(self._link.name, snapshot)
        self._take_log(snapshot)
        if snapshot.values:
            with self._tab_tune:
                self._controls.build(snapshot.descriptors, snapshot.values)
            there = snapshot.presence in (Presence.ACTIVE, Presence.INACTIVE)
            self._controls.show(snapshot.values, there)
            self._waiting.visible = False
        self._undo.disabled = not self._changes.undoable
        if (
            snapshot.shown_cloud is not None
            and snapshot.shown_cloud is not self._shown
            and self._server.get_clients()
        ):
            self._show_answer(snapshot.shown_cloud)
        if before.values.keys() != snapshot.values.keys():
            self._list_presets()
        if snapshot.presence is Presence.ACTIVE and before.presence is not Presence.ACTIVE:
            self._go(self._wanted)  # a node that has just come has no cloud to be tuned on

    def open_recording(self, path: Path) -> None:
        """Open a recording and show its first cloud."""
        self._path.value = str(path)
        self._recording_note.content = markup.note(f'Reading {path} …')
        try:
            clouds = RecordedClouds(path)
        except SocialCircleError as error:
            self._recording_note.content = markup.note(str(error), bad=True)
            return
        with self._stepping:
            if self._clouds is not None:
                self._clouds.close()
            self._clouds = clouds
        self._note(f'Opened {path.name}: {len(clouds)} clouds.')
        self._place.max = max(2, len(clouds))
        for handle in (self._place, self._steps):
            handle.visible = len(clouds) > 1
        self._again.visible = True
        self._go(1)

    # The parts of the page

    def _build(self) -> None:
        server = self._server
        gui: Any = server.gui  # viser's types do not let values be set
        gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False, brand_color=(29, 145, 192))
        gui.set_panel_label('Social circle')
        server.scene.set_up_direction('+z')
        server.scene.world_axes.visible = False
        server.initial_camera.position = (0.0, -1.5 * SIDE, 1.2 * SIDE)
        server.initial_camera.look_at = (0.0, -0.05 * SIDE, 0.0)
        server.initial_camera.fov = 0.75
        gui.add_html(markup.STYLE)
        self._node = gui.add_html(markup.node_card(self._link.name, self._snapshot))
        tabs = gui.add_tab_group()
        self._tab_tune = tabs.add_tab('Tune', 'adjustments-horizontal')
        with self._tab_tune:
            self._build_tuning()
        with tabs.add_tab('Presets', 'bookmarks'):
            self._build_presets()
        with tabs.add_tab('Recording', 'player-track-next'):
            self._build_recording()
        gui.main_panel.dock_left()
        gui.main_panel.set_width(340)
        results = gui.add_panel()
        with results.add_tab('Result', 'chart-dots-3'):
            self._build_result()
        with results.add_tab('Log', 'list'):
            self._lines = gui.add_html(markup.log(()))
        results.dock_right()
        results.set_width(320)

    def _build_tuning(self) -> None:
        gui: Any = self._server.gui
        self._undo = gui.add_button(
            'Undo', icon='arrow-back-up', disabled=True, hint='Take the last change of this page back.'
        )
        self._undo.on_click(lambda _: self._take_back())
        command = gui.add_command('Undo', hotkey='Z', modifier='cmd/ctrl', icon='arrow-back-up')
        command.on_trigger(lambda _: self._take_back())
        self._waiting = gui.add_html(
            markup.note('The controls appear once the node has told its parameters.'), visible=True
        )
        self._controls = Controls(gui, self._changes)

    def _build_presets(self) -> None:
        gui: Any = self._server.gui
        self._name = gui.add_text('name', 'my setting', hint='Letters, digits, spaces and - _ . +')
        save = gui.add_button(
            'Save the settings in force', icon='device-floppy',
            hint=f'As a parameter file in {self._presets.folder}, which a node also starts from.',
        )  # fmt: skip
        save.on_click(lambda _: self._save_preset())
        self._preset = gui.add_dropdown('preset', [_NO_PRESET])
        load = gui.add_button('Load it into the node', icon='upload')
        load.on_click(lambda _: self._load_preset())
        keep = gui.add_button(
            'Have the node save its parameters', icon='file-check',
            hint='Calls ~/save_parameters: the node writes its parameters_file.',
        )  # fmt: skip
        keep.on_click(lambda _: self._tell(self._link.save()))
        self._preset_note = gui.add_html('', visible=False)
        with gui.add_folder('Compare two settings'):
            self._a = gui.add_dropdown('A', [_IN_FORCE])
            self._b = gui.add_dropdown('B', [_IN_FORCE])
            button = gui.add_button(
                'Compare on this cloud', icon='columns-2',
                hint='Filters the cloud that is shown with both, on this machine; the node is not asked.',
            )  # fmt: skip
            button.on_click(lambda _: self._compare())
            self._back = gui.add_button('Back to the node', icon='arrow-left', visible=False)
            self._back.on_click(lambda _: self._end_comparison())
            self._compared = gui.add_html('', visible=False)
            self._difference = gui.add_image(_EMPTY, label='where they differ', format='png', visible=False)
        self._list_presets()

    def _build_recording(self) -> None:
        gui: Any = self._server.gui
        self._path = gui.add_text(
            'path', '', hint='An MCAP file or a rosbag2 directory on the machine of this page.'
        )
        opening = gui.add_button('Open', icon='folder-open')
        opening.on_click(lambda _: self.open_recording(Path(self._path.value.strip()).expanduser()))
        self._place = gui.add_slider('cloud', 1, 2, 1, 1, visible=False)
        self._place.on_update(lambda event: self._go(event.target.value) if event.client_id is not None else None)
        self._steps = gui.add_button_group('step', (_PREVIOUS, _NEXT), visible=False)
        self._steps.on_click(
            lambda event: self._go(self._place.value + (1 if 'next' in event.target.value else -1))
        )
        self._again = gui.add_button('Send it again', icon='refresh', visible=False)
        self._again.on_click(lambda _: self._go(self._place.value))
        self._recording_note = gui.add_html(
            markup.note(
                'Open a recording to step through it: each cloud goes to the node, and its answer is shown.'
            )
        )

    def _build_result(self) -> None:
        gui: Any = self._server.gui
        self._measurement = gui.add_html(markup.measurement(None))
        self._legend = gui.add_html(markup.legend(None, 0))
        with gui.add_folder('scene'):
            self._show_kept = gui.add_checkbox('kept points', True)
            self._show_outliers = gui.add_checkbox('outliers', True)
            self._fitted = gui.add_checkbox('fit z scale', True, hint='Stretch heights as each cloud needs.')
            hint = _STRETCH.sentence
            self._scale = NumberWidget(gui, _STRETCH, 'z scale', hint, 1.0, self._stretched)
        for handle in (self._show_kept, self._show_outliers, self._fitted):
            handle.on_update(lambda event: self._redraw() if event.client_id is not None else None)
        self._heights = gui.add_image(_EMPTY, label='heights that are kept', format='png')
        self._mask = gui.add_image(_EMPTY, label='outlier mask', format='png')
        self._details = gui.add_html(markup.details(None))

    # Showing

    def _show_answer(self, answer: ShownCloud) -> None:
        with self._drawing:
            self._shown = answer
            try:
                xyz = PointCloud.decode(answer.cloud).xyz()
                drawn = view(xyz, answer.mask)
            except SocialCircleError as error:
                self._note(str(error), bad=True)
                return
            self._view = drawn
            with self._server.atomic():
                self._measurement.content = markup.measurement(answer.measurement)
                self._details.content = markup.details(answer.measurement)
                self._heights.image = height_picture(xyz, answer.mask, drawn.span)
                self._mask.image = mask_picture(answer.mask)
                if self._comparison is None:
                    self._draw_scene()

    def _draw_scene(self) -> None:
        """The cloud of the node's answer."""
        drawn = self._view
        if drawn is None:
            return
        self._fit(drawn)
        outliers, far = drawn.stretched_outliers(self._stretch)
        self._legend.content = markup.legend(drawn, far)
        self._draw('/cloud', drawn, outliers, colours.OUTLIER)

    def _draw(
        self, name: str, drawn: View, outliers: Any, outlier_colours: Any, x: float = 0.0, share: float = 1.0
    ) -> None:
        """One cloud, with its middle at x and `share` of its size; viser's own scale would scale the marks too."""
        style: dict[str, Any] = {'point_shading': 'flat', 'precision': 'float32', 'position': (x, 0.0, 0.0)}
        kept = stretched(drawn.kept, self._stretch)
        self._server.scene.add_point_cloud(
            f'{name}/kept', share * kept, drawn.kept_colours, point_size=1.1 * share * drawn.pitch,
            visible=self._show_kept.value, **style,
        )  # fmt: skip
        self._server.scene.add_point_cloud(
            f'{name}/outliers', share * outliers, outlier_colours, point_size=share * drawn.outlier_size,
            point_shape='circle', visible=self._show_outliers.value, **style,
        )  # fmt: skip

    def _stretched(self, stretch: RosValue | SettingError, _: float) -> None:
        """Take over a z scale that was typed or dragged to; what is none yet is on the way to one."""
        if not isinstance(stretch, float) or not stretch >= 1.0:
            return
        self._fitted.value = False
        self._stretch = min(stretch, 1e5)
        self._scale.show(self._stretch)
        self._redraw()

    def _redraw(self) -> None:
        with self._drawing, self._server.atomic():
            if self._comparison is None:
                self._draw_scene()
            else:
                self._draw_comparison(self._comparison)

    def _fit(self, drawn: View) -> None:
        """Stretch heights as the cloud needs, where that is wanted, and lay the floor below it."""
        if self._fitted.value:
            self._stretch = drawn.stretch()
            self._scale.show(self._stretch)
        self._server.scene.add_grid(
            '/floor', 1.6 * SIDE, 1.6 * SIDE, cell_size=SIDE / 10, section_size=SIDE / 2, plane='xy',
            position=(0.0, 0.0, -0.5 * drawn.height * self._stretch - SIDE / 20),
            cell_color=(60, 64, 72), section_color=(80, 86, 96),
        )  # fmt: skip

    def _take_log(self, snapshot: Snapshot) -> None:
        new = snapshot.log_total - self._logged
        if new > 0:
            self._logged = snapshot.log_total
            self._log.extend(snapshot.log[-new:])
            self._lines.content = markup.log(reversed(self._log))

    def _note(self, text: str, *, bad: bool = False) -> None:
        """A line for the log."""
        self._log.append(LogEntry(time.time(), text, bad))
        self._lines.content = markup.log(reversed(self._log))

    def _tell(self, text: str, *, bad: bool = False) -> None:
        """A line for the log, and a note that goes away by itself."""
        self._note(text, bad=bad)
        for client in self._server.get_clients().values():
            client.add_notification('Social circle', text, auto_close_seconds=8, color='orange' if bad else 'teal')

    # Changing

    def _refused(self, names: Sequence[str], reason: str) -> None:
        self._controls.refused(names, reason)
        self._tell(f'{", ".join(names)} refused: {reason}', bad=True)

    def _accepted(self, names: Sequence[str]) -> None:
        self._controls.accepted(names)

    def _take_back(self) -> None:
        values, reason = self._changes.undo()
        self._tell(reason or f'Undone: {_listed(values)}.', bad=bool(reason))

    # Presets

    def _list_presets(self) -> None:
        names = self._presets.names()
        self._preset.options = names or [_NO_PRESET]
        for handle in (self._a, self._b):
            handle.options = [_IN_FORCE, *names]

    def _save_preset(self) -> None:
        writable = {row.name for row in self._snapshot.descriptors if not row.read_only}
        values = {name: value for name, value in self._snapshot.values.items() if name in writable}
        if not values:
            self._tell('There is nothing to save before the node has told its parameters.', bad=True)
            return
        try:
            path = self._presets.save(self._name.value.strip(), values)
        except SocialCircleError as error:
            self._preset_said(str(error), bad=True)
            return
        self._list_presets()
        self._preset.value = path.stem
        self._preset_said(f'Saved as {path}.')

    def _load_preset(self) -> None:
        if self._preset.value == _NO_PRESET:
            self._preset_said('Save a preset first.', bad=True)
            return
        try:
            values = self._presets.load(self._preset.value)
        except SocialCircleError as error:
            self._preset_said(str(error), bad=True)
            return
        writable = {row.name for row in self._snapshot.descriptors if not row.read_only}
        unknown = sorted(values.keys() - self._snapshot.values.keys())
        reason = self._changes.apply({name: value for name, value in values.items() if name in writable})
        if reason:
            self._preset_said(f'{self._preset.value} was refused: {reason}', bad=True)
            return
        left_out = f' The node has no {", ".join(unknown)}.' if unknown else ''
        self._preset_said(f'{self._preset.value} is in force.{left_out}', bad=bool(unknown))

    def _preset_said(self, text: str, *, bad: bool = False) -> None:
        self._preset_note.content = markup.note(text, bad=bad)
        self._preset_note.visible = True
        self._note(text, bad=bad)

    # Comparing

    def _compare(self) -> None:
        answer = self._shown
        if answer is None:
            self._preset_said('There is no cloud yet to compare on.', bad=True)
            return
        self._compared.content = markup.note('Filtering; the first time, the filter is compiled here as well …')
        self._compared.visible = True
        try:
            comparison = compare(
                answer.cloud,
                self._settings(self._a.value),
                self._settings(self._b.value),
                answer.depth_of_field,
            )
        except SocialCircleError as error:
            self._compared.content = markup.note(str(error), bad=True)
            return
        with self._drawing, self._server.atomic():
            self._comparison = comparison
            self._compared.content = markup.compared(comparison)
            self._difference.image = comparison.picture()
            self._difference.visible = self._back.visible = True
            self._remove('/cloud/kept', '/cloud/outliers')
            self._draw_comparison(comparison)

    def _settings(self, name: str) -> tuple[str, Mapping[str, RosValue]]:
        values = dict(self._snapshot.values)
        return name, values if name == _IN_FORCE else values | self._presets.load(name)

    def _draw_comparison(self, comparison: Comparison) -> None:
        """Both answers side by side; colours say whether the other setting found an outlier too."""
        xyz = PointCloud.decode(comparison.cloud).xyz()
        a, b = comparison.a, comparison.b
        for side, other, letter, colour in ((a, b, 'A', colours.ONLY_A), (b, a, 'B', colours.ONLY_B)):
            drawn = view(xyz, side.mask)
            self._fit(drawn)
            outliers, _ = drawn.stretched_outliers(self._stretch)
            shared = other.mask[side.mask == OUTLIER] == OUTLIER
            shades = np.where(shared[:, None], colours.BOTH, colour).astype(np.uint8)
            x = (drawn.size[0] / 4 + SIDE / 40) * (-1 if letter == 'A' else 1)
            self._draw(f'/compare/{letter}', drawn, outliers, shades, x, 0.5)
            self._server.scene.add_label(
                f'/compare/{letter}/label', f'{letter}: {side.name}, {side.cleaned.outliers:,} outliers',
                position=(x - drawn.size[0] / 8, -drawn.size[1] / 4 - SIDE / 20, 0.0),
            )  # fmt: skip

    def _end_comparison(self) -> None:
        with self._drawing, self._server.atomic():
            self._comparison = None
            self._remove('/compare')
            for handle in (self._compared, self._difference, self._back):
                handle.visible = False
            self._draw_scene()

    def _remove(self, *names: str) -> None:
        for name in names:
            self._server.scene.remove_by_name(name)

    # Recording

    def _go(self, number: int) -> None:
        """Send a cloud of the recording to the node, by its number from 1 on, unless a later wish overtakes it."""
        self._wanted = number
        with self._stepping:
            clouds = self._clouds
            if clouds is None or self._wanted != number:
                return
            number = min(max(number, 1), len(clouds))
            self._place.value = number
            try:
                message = clouds[number - 1]
            except SocialCircleError as error:
                self._recording_note.content = markup.note(str(error), bad=True)
                return
            when = time.strftime('%Y-%m-%d %H:%M:%S', time.localtime(message.log_time / 1e9))
            said = f'Cloud {number} of {len(clouds)}, recorded {when} on {message.topic}.'
            if self._snapshot.presence is Presence.ACTIVE:
                missed = self._link.publish(message.data)
            else:
                missed = 'It is sent once the node is active.'
            trouble = [text for text in (missed, clouds.damage) if text]
            self._recording_note.content = markup.note(' '.join([said, *trouble]), bad=bool(trouble))


def _listed(values: Mapping[str, RosValue]) -> str:
    return ', '.join(f'{name} = {value}' for name, value in values.items())


def require_viser() -> None:
    """See that viser is here.

    Raises:
        SocialCircleError: it is not; says how to get it.
    """
    try:
        import viser  # noqa: F401, PLC0415 - an extra
    except ImportError:
        raise SocialCircleError('The page needs viser: pip install "socialcircle_ros[panel]".') from None


def page_of(link: Link, presets: Presets, host: str, port: int) -> 'tuple[viser.ViserServer, Page]':
    """Serve the page; the server's port is `port`, or the next that is free.

    Args:
        link: to the node.
        presets: where they are kept.
        host: the address to listen on: 127.0.0.1, unless others shall see it.
        port: 0: any that is free.

    Raises:
        SocialCircleError: viser is not installed, or this machine has no such address.
    """
    require_viser()
    import viser  # noqa: PLC0415 - an extra

    try:
        # viser takes any failure for a port that is in use, and would try the next for ever.
        family, kind, *_, address = socket.getaddrinfo(host, 0, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind) as trial:
            trial.bind(address)
    except OSError as error:
        raise SocialCircleError(f'The page cannot listen on {host}: {error.strerror}.') from None

    with redirect_stdout(io.StringIO()):  # viser announces itself
        server = viser.ViserServer(host=host, port=port, label='Social circle', verbose=False)
    return server, Page(server, link, presets)
