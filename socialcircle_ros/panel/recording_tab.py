# SPDX-License-Identifier: Apache-2.0
"""The tab Recording: step through the clouds and the stacks of a recording, and send each to the node."""

import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING

from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.focus import FocusCurve
from socialcircle_ros.recording.names import found_parameters
from socialcircle_ros.settings import PARAMETERS, PipelineSettings
from socialcircle_ros.settings.files import read_parameter_file

from . import markup
from .changes import Changes
from .elements import icon, on_choice, set_value
from .focus_curves import focus_curve
from .link import Link, Presence
from .log import Log
from .recorded import RecordedClouds
from .state import CurrentState, OpenRecording, Sent, State

if TYPE_CHECKING:
    import viser

_PREVIOUS, _NEXT = '◀ previous', 'next ▶'
_PROGRESS_S = 0.5  # between two reports of progress


class RecordingTab:
    """The opened recording, if there is one.

    Args:
        gui: of the page. The elements are made in its current container.
        link: to the node.
        changes: loads the parameters of a stack into the node.
        current: the state of the page.
        log: gets what was opened.
    """

    def __init__(self, gui: 'viser.GuiApi', link: Link, changes: Changes, current: CurrentState, log: Log) -> None:
        self._link, self._changes, self._current, self._log = link, changes, current, log
        self._recorded: RecordedClouds | None = None
        self._stepping = threading.RLock()
        self._beside: Path | None = None
        self._path = gui.add_text(
            'path', '', hint='An MCAP file, a rosbag2 directory or a measurement file on the machine of this page.'
        )
        open_button = gui.add_button('Open', icon=icon('folder-open'))
        open_button.on_click(lambda _: log.guarded('Opening the recording', self._open_typed))
        self._problem = gui.add_html('', visible=False)
        self._load = gui.add_button('', icon=icon('upload'), visible=False)
        self._load.on_click(lambda _: log.guarded('Loading the parameters', self._load_and_open))
        self._number = gui.add_slider('cloud', 1, 2, 1, 1, visible=False)
        on_choice(self._number, lambda number: log.guarded('Sending the cloud', self._go, number))
        self._steps = gui.add_button_group('step', (_PREVIOUS, _NEXT), visible=False)
        self._steps.on_click(lambda event: log.guarded('Sending the cloud', self._step, event.target.value))
        self._again = gui.add_button('Send again', icon=icon('refresh'), visible=False)
        self._again.on_click(lambda _: log.guarded('Sending the cloud', self.send_again))
        self._note = gui.add_html(
            markup.note(
                'Open a recording to step through its clouds, or its focus stacks. Each one is sent to the node,'
                ' and the page shows the result.'
            )
        )

    def show(self, state: State) -> None:
        """Show which cloud of the recording was asked for, and what became of it."""
        self._problem.content = markup.note(state.open_problem, bad=True)
        self._problem.visible = bool(state.open_problem)
        recording = state.recording
        if recording is None:
            return
        if self._number.max != max(2, recording.count):
            self._number.max = max(2, recording.count)
        if self._number.value != recording.number:
            set_value(self._number, recording.number)
        for element in (self._number, self._steps):
            element.visible = recording.count > 1
        self._again.visible = True
        waits = '' if state.snapshot.presence is Presence.ACTIVE else 'It will be sent when the node is active.'
        problem = ' '.join(text for text in (waits, state.stepping_problem) if text)
        self._note.content = markup.note(f'{state.stepping} {problem}'.strip(), bad=bool(problem)) + (
            markup.stack(recording.cloud.stack) if recording.cloud.stack is not None else ''
        )

    def open(self, path: Path) -> None:
        """Open a recording and send its first cloud to the node; the one that is open stays if it cannot be."""
        set_value(self._path, str(path))
        self._load.visible = False
        reported = time.monotonic()

        def progress(done: int, total: int) -> None:
            nonlocal reported
            if time.monotonic() - reported > _PROGRESS_S:
                reported = time.monotonic()
                self._note.content = markup.note(f'Reading {path.name}: {done:,} of {total:,} messages …')

        try:
            recorded = RecordedClouds(path, self._settings(), progress)
        except SocialCircleError as error:
            self._refuse(str(error))
            self._offer_parameters(path)
            return
        with self._stepping:
            self.close()
            self._recorded = recorded
            self._log.add(f'Opened {path.name}: {len(recorded)} clouds.')
            opened = OpenRecording(path, len(recorded), 1, recorded[0], recorded.damage or '')
            self._current.change(lambda state: state.opened(opened))
        self._go(1)

    def send_again(self) -> None:
        """Send the cloud that was asked for last, also for a node that has just started."""
        recording = self._current.now.recording
        if recording is not None:
            self._go(recording.number)

    def focus_curve(self, number: int, place: tuple[int, int]) -> FocusCurve | None:
        """The focus curve of a pixel, with the settings of the node; None: no recording is open.

        Args:
            number: of the stack in the recording, from 1 on.
            place: row and column of the pixel.

        Raises:
            SocialCircleError: the stack cannot be read or measured.
        """
        with self._stepping:
            if self._recorded is None:
                return None
            return focus_curve(self._recorded.stack_messages(number - 1), self._settings(), place)

    def close(self) -> None:
        """Close the recording, once the cloud that is being read has been sent."""
        with self._stepping:
            if self._recorded is not None:
                self._recorded.close()

    def _settings(self) -> PipelineSettings:
        """How the node measures now; the page may not show the last change yet."""
        values = self._link.newest.values
        return PipelineSettings.from_ros({name: values[name] for name in PARAMETERS if name in values})

    def _open_typed(self) -> None:
        self.open(Path(self._path.value.strip()).expanduser())

    def _offer_parameters(self, path: Path) -> None:
        """Offer the parameters that lie beside a recording of frames, as `import` and `simulate` write them."""
        self._beside = found_parameters(path)
        if self._beside is not None:
            self._load.label = f'Load {self._beside.name} into the node, and open'
            self._load.visible = True

    def _load_and_open(self) -> None:
        """Set the parameters beside a recording, and open it again."""
        if self._beside is None:
            return
        found = read_parameter_file(self._beside, self._link.name.rpartition('/')[2])
        writable = self._link.newest.writable()
        reason = self._changes.apply({name: value for name, value in found.items() if name in writable})
        if reason:
            self._refuse(reason)
            return
        self.open(Path(self._path.value.strip()).expanduser())

    def _refuse(self, reason: str) -> None:
        self._current.change(lambda state: state.not_opened(reason))

    def _step(self, choice: str) -> None:
        recording = self._current.now.recording
        if recording is not None:
            self._go(recording.number + (1 if choice == _NEXT else -1))

    def _go(self, number: int) -> None:
        """Send a cloud to the node, unless another one is asked for meanwhile.

        Args:
            number: of the cloud, from 1 on; the nearest one where there is no such cloud.
        """
        recorded = self._recorded
        if recorded is None:
            return
        number = min(max(number, 1), len(recorded))
        self._current.change(lambda state: state.asked(number, recorded[number - 1]))
        with self._stepping:
            now = self._current.now
            if recorded is not self._recorded or now.recording is None or now.recording.number != number:
                return
            if now.snapshot.presence is not Presence.ACTIVE:
                return
            cloud = recorded[number - 1]
            stack = cloud.stack
            try:
                data = recorded.message(number - 1).data if stack is None else b''
            except SocialCircleError as error:
                self._refuse(str(error))
                return
            stamp = stack.stamp if stack else None
            sent = Sent(recorded.path, len(recorded), number, stamp, data, unit=cloud.unit)
            self._current.change(lambda state: state.sending(sent))
            if stack is None:
                problem = self._link.publish(data)
            else:
                problem = self._link.publish_stack(recorded.stack_messages(number - 1))
            self._current.change(lambda state: state.delivered(sent, problem))
