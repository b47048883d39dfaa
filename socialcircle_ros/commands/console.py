# SPDX-License-Identifier: Apache-2.0
"""What commands print with Rich: tables, and what moves, such as progress bars."""

from rich.console import Console
from rich.control import Control
from rich.progress import Progress, ProgressColumn

from socialcircle_ros.terminal import is_in_foreground


class CommandConsole(Console):
    """A console on which nothing moves while it is no terminal, or the process is in the background of a shell.

    A bar would be drawn over the prompt, and over what is typed there. Whole lines are printed all the same.
    """

    _hides_cursor = False

    @property
    def is_terminal(self) -> bool:
        """Whether this is a terminal, and belongs to this process now: Ctrl-Z, `bg` and `fg` change it."""
        return super().is_terminal and self._is_in_foreground()

    @property
    def is_interactive(self) -> bool:
        """Whether what moves can be drawn."""
        return self.is_terminal and not self.is_dumb_terminal

    @is_interactive.setter
    def is_interactive(self, _: bool) -> None:
        """Rich keeps here what was true at the beginning."""

    def control(self, *control: Control) -> None:
        """Move the cursor, unless it is on a prompt."""
        if self.is_terminal:
            super().control(*control)

    def show_cursor(self, show: bool = True) -> bool:
        """Show or hide the cursor. A bar that ends in the background gives back what it hid before."""
        is_shown_behind = show and self._hides_cursor and not self.is_terminal
        if is_shown_behind:  # Rich leaves out control codes where it may not move the cursor
            self.file.write(str(Control.show_cursor(True)))
            self.file.flush()
        is_done = super().show_cursor(show) or is_shown_behind
        self._hides_cursor = is_done and not show
        return is_done

    def _is_in_foreground(self) -> bool:
        try:
            return is_in_foreground(self.file.fileno())
        except (AttributeError, OSError, ValueError):
            return True  # not a file of the system


class CommandProgress(Progress):
    """Bars that leave nothing behind.

    Args:
        columns: of a bar; none: those of Rich.
        console: to draw on; None: stderr.
        speed_estimate_period: seconds over which the speed is averaged.
    """

    def __init__(
        self,
        *columns: str | ProgressColumn,
        console: CommandConsole | None = None,
        speed_estimate_period: float = 30.0,
    ) -> None:
        super().__init__(
            *columns,
            console=console or CommandConsole(stderr=True),
            transient=True,
            speed_estimate_period=speed_estimate_period,
        )

    def stop(self) -> None:
        """Take the bars away; Rich prints an empty line in place of bars that were never drawn."""
        self.live.stop()
