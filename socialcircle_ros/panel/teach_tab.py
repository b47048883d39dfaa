# SPDX-License-Identifier: Apache-2.0
"""The tab Teach: clouds that a person calls good, and the lesson that is taught on them."""

import threading
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.settings import PipelineSettings
from socialcircle_ros.storage import write_file
from socialcircle_ros.teaching.clouds import GoodCloud, good_cloud
from socialcircle_ros.teaching.page import check_libraries, lesson_page
from socialcircle_ros.teaching.teach import Teaching, teach

from . import markup
from .changes import Changes
from .elements import icon
from .log import Log
from .presets import Presets
from .state import MOST_GOOD, CurrentState, State

if TYPE_CHECKING:
    import viser

_INVITATION = (
    f'Show clouds of good parts, and call each one good: up to {MOST_GOOD}. A lesson learns to tell the texture of'
    ' such a part from outliers, which are put in.'
)


@dataclass(frozen=True)
class _CheckPage:
    """The page of the check of a lesson.

    Attributes:
        name: of its file.
        page: HTML.
    """

    name: str
    page: str


class TeachTab:
    """Collects good clouds, teaches, and gives the lesson to the node.

    Args:
        gui: of the page. The elements are made in its current container.
        presets: the folder of the lessons, too.
        changes: gives the lesson to the node.
        current: the state of the page, with the good clouds.
        log: gets what was taught.
    """

    def __init__(
        self, gui: 'viser.GuiApi', presets: Presets, changes: Changes, current: CurrentState, log: Log
    ) -> None:
        self._presets, self._changes, self._current, self._log = presets, changes, current, log
        self._check: _CheckPage | None = None
        self._teaching = threading.Lock()
        good = gui.add_button(
            'This is good', icon=icon('thumb-up'),
            hint='Takes the cloud that is shown as one of a good part, without outliers.',
        )  # fmt: skip
        good.on_click(lambda _: log.guarded('Taking a good cloud', self._take))
        self._clouds = gui.add_html(markup.note(_INVITATION))
        self._forget = gui.add_button('Forget these clouds', icon=icon('trash'), visible=False)
        self._forget.on_click(lambda _: log.guarded('Forgetting', current.change, State.forgetting_good))
        self._name = gui.add_text('lesson name', 'part', hint=f'Name of its file in {presets.folder}.')
        self._start = gui.add_button('Teach', icon=icon('school'), disabled=True)
        self._start.on_click(lambda _: log.guarded('Teaching', self._teach))
        self._progress = gui.add_progress_bar(0, visible=False)
        self._note = gui.add_html('', visible=False)
        self._save = gui.add_button(
            'Save the page of the check', icon=icon('download'), visible=False,
            hint='Figures before and after, and pictures of what would be removed.',
        )  # fmt: skip
        self._save.on_click(lambda event: log.guarded('Saving the check', self._send, event.client))

    def show(self, state: State) -> None:
        """Show which clouds are called good."""
        names = [cloud.name for cloud in state.good.values()]
        self._clouds.content = markup.good_clouds(names) if names else markup.note(_INVITATION)
        self._forget.visible = bool(names)
        self._start.disabled = not names or self._teaching.locked()

    def _take(self) -> None:
        """Take the cloud that is shown."""
        state = self._current.now
        shown = state.shown
        if shown is None:
            self._say('There is no cloud to call good yet.', bad=True)
            return
        not_measured = PipelineSettings.from_ros(state.snapshot.values).circle.not_measured
        try:
            cloud = good_cloud(state.title, shown.cloud, not_measured, shown.depth_of_field, state.unit)
        except SocialCircleError as error:
            self._say(str(error), bad=True)
            return
        self._current.change(lambda now: now.calling_good(shown.cloud, cloud))

    def _teach(self) -> None:
        if not self._teaching.acquire(blocking=False):
            return
        try:
            self._start.disabled = True
            self._note.visible = self._save.visible = False
            self._told(0, 1)
            self._progress.visible = True
            self._teach_on(list(self._current.now.good.values()))
        finally:
            self._teaching.release()
            self._progress.visible = False
            self._current.change(lambda state: state)

    def _teach_on(self, clouds: Sequence[GoodCloud]) -> None:
        try:
            check_libraries()
            path = self._presets.free_lesson(self._name.value.strip())
            settings = PipelineSettings.from_ros(self._current.now.snapshot.values).circle
            taught = teach(clouds, self._told, settings)
            self._check = _CheckPage(f'{path.stem}.html', lesson_page(taught))
            self._save.visible = True
            if taught.refusal:
                self._say(' '.join([taught.refusal, *taught.warnings]), bad=True)
                return
            path.parent.mkdir(parents=True, exist_ok=True)
            write_file(path, taught.lesson.to_text())
        except SocialCircleError as error:
            self._say(str(error), bad=True)
            return
        reason = self._changes.apply({'circle.mode': 'adaptive', 'circle.lesson': str(path)})
        use = (
            f'The node refused it: {reason} Copy the file to the machine of the node, and set circle.lesson.'
            if reason
            else 'The node uses it.'
        )
        self._say(f'{_figures(taught)} Saved as {path}. {use}', bad=bool(reason))

    def _told(self, done: int, all_steps: int) -> None:
        self._progress.value = 100 * done / all_steps  # type: ignore[misc] # as in set_value

    def _send(self, client: 'viser.ClientHandle | None') -> None:
        if client is not None and self._check is not None:
            client.send_file_download(self._check.name, self._check.page.encode(), save_immediately=True)

    def _say(self, text: str, *, bad: bool = False) -> None:
        self._note.content = markup.note(text, bad=bad)
        self._note.visible = True
        self._log.add(text, bad=bad)


def _figures(taught: Teaching) -> str:
    before, after = taught.before, taught.after
    text = (
        f'F1 of the outliers put in: {before.f1:.3f} before, {after.f1:.3f} with the lesson. Of those at steps and'
        f' beside holes: {before.f1_at_edges:.3f} before, {after.f1_at_edges:.3f} with it. Good points removed:'
        f' {before.removed_text} before, {after.removed_text} with it.'
    )
    return ' '.join([text, *taught.warnings])
