"""The tab Recording: step through the clouds of a recording and send each to the node."""

import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from socialcircle_ros.errors import SocialCircleError

from . import markup
from .clouds import RecordedClouds
from .elements import icon, on_choice, set_value
from .link import Link
from .log import Log

if TYPE_CHECKING:
    import viser

_PREVIOUS, _NEXT = '◀ previous', 'next ▶'


class RecordingTab:
    """The opened recording, if there is one.

    Args:
        gui: of the page. The elements are made in its current container.
        link: to the node.
        log: gets what was opened.
        active: gives whether the node is active.
    """

    def __init__(self, gui: 'viser.GuiApi', link: Link, log: Log, active: Callable[[], bool]) -> None:
        self._link, self._log, self._active = link, log, active
        self._clouds: RecordedClouds | None = None
        self._stepping = threading.RLock()
        self._wanted = 1  # number of the cloud that was asked for last
        self._path = gui.add_text(
            'path', '', hint='An MCAP file or a rosbag2 directory on the machine that serves this page.'
        )
        open_button = gui.add_button('Open', icon=icon('folder-open'))
        open_button.on_click(lambda _: log.guarded('Opening the recording', self._open_typed))
        self._number = gui.add_slider('cloud', 1, 2, 1, 1, visible=False)
        on_choice(self._number, lambda number: log.guarded('Sending the cloud', self._go, number))
        self._steps = gui.add_button_group('step', (_PREVIOUS, _NEXT), visible=False)
        self._steps.on_click(lambda event: log.guarded('Sending the cloud', self._step, event.target.value))
        self._again = gui.add_button('Send again', icon=icon('refresh'), visible=False)
        self._again.on_click(lambda _: log.guarded('Sending the cloud', self._go, self._number.value))
        self._note = gui.add_html(
            markup.note(
                'Open a recording to step through its clouds. Each cloud is sent to the node, and the page'
                ' shows the result.'
            )
        )

    def open(self, path: Path) -> None:
        """Open a recording and send its first cloud to the node."""
        set_value(self._path, str(path))
        self._note.content = markup.note(f'Reading {path} …')
        try:
            clouds = RecordedClouds(path)
        except SocialCircleError as error:
            self._note.content = markup.note(str(error), bad=True)
            return
        with self._stepping:
            self.close()
            self._clouds = clouds
        self._log.add(f'Opened {path.name}: {len(clouds)} clouds.')
        self._number.max = max(2, len(clouds))
        for element in (self._number, self._steps):
            element.visible = len(clouds) > 1
        self._again.visible = True
        self._go(1)

    def send_again(self) -> None:
        """Send the cloud that was asked for last, for a node that has just become active."""
        self._go(self._wanted)

    def close(self) -> None:
        """Close the recording."""
        if self._clouds is not None:
            self._clouds.close()

    def _open_typed(self) -> None:
        self.open(Path(self._path.value.strip()).expanduser())

    def _step(self, choice: str) -> None:
        self._go(self._number.value + (1 if choice == _NEXT else -1))

    def _go(self, number: int) -> None:
        """Send a cloud to the node, unless another one is asked for meanwhile.

        Args:
            number: of the cloud, from 1 on; the nearest one where there is no such cloud.
        """
        self._wanted = number
        with self._stepping:
            clouds = self._clouds
            if clouds is None or self._wanted != number:
                return
            number = min(max(number, 1), len(clouds))
            set_value(self._number, number)
            try:
                message = clouds[number - 1]
            except SocialCircleError as error:
                self._note.content = markup.note(str(error), bad=True)
                return
            recorded = time.strftime('%Y-%m-%d %H:%M:%S', time.localtime(message.log_time / 1e9))
            sentence = f'Cloud {number} of {len(clouds)}, recorded {recorded} on {message.topic}.'
            if self._active():
                problem = self._link.publish(message.data)
            else:
                problem = 'It will be sent when the node is active.'
            problems = [text for text in (problem, clouds.damage) if text]
            self._note.content = markup.note(' '.join([sentence, *problems]), bad=bool(problems))
