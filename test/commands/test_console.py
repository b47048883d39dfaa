# SPDX-License-Identifier: Apache-2.0
"""What commands draw on a terminal, which is a pseudo-terminal here."""

import os
import select

import pytest

from socialcircle_ros.commands.console import CommandConsole, CommandProgress


@pytest.fixture
def screen(monkeypatch):
    """A console on a terminal, what was written there since the last look, and the groups in the foreground."""
    for name in ('FORCE_COLOR', 'NO_COLOR', 'TTY_COMPATIBLE', 'TTY_INTERACTIVE'):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv('TERM', 'xterm')
    shown, terminal = os.openpty()
    foreground = [os.getpgrp()]
    monkeypatch.setattr(os, 'tcgetpgrp', lambda _: foreground[-1])

    def written():
        text = b''
        while select.select([shown], [], [], 0)[0]:
            text += os.read(shown, 1 << 16)
        return text.decode()

    with os.fdopen(terminal, 'w', encoding='utf-8') as file:
        yield CommandConsole(file=file, width=60), written, foreground
    os.close(shown)


def test_a_bar_is_drawn_in_the_foreground(screen):
    console, written, _ = screen
    with CommandProgress(console=console) as progress:
        progress.add_task('working')
        progress.refresh()
        assert 'working' in written()


def test_nothing_is_drawn_in_the_background_but_lines_are_printed(screen):
    console, written, foreground = screen
    foreground.append(os.getpgrp() + 1)
    with CommandProgress(console=console) as progress, console.status('waiting'):
        progress.add_task('working')
        progress.refresh()
        console.print('a line')
    assert written() == 'a line\r\n'


def test_a_bar_stops_in_the_background_and_goes_on_in_the_foreground(screen):
    console, written, foreground = screen
    with CommandProgress(console=console) as progress:
        progress.add_task('working')
        progress.refresh()
        written()
        foreground.append(os.getpgrp() + 1)
        progress.refresh()
        progress.console.print('a line')
        assert written() == 'a line\r\n'
        foreground.append(os.getpgrp())
        progress.refresh()
        assert 'working' in written()
        foreground.append(os.getpgrp() + 1)
    assert written() == '\x1b[?25h'  # the cursor, which the bar had hidden


def test_nothing_moves_in_a_file(tmp_path):
    path = tmp_path / 'log.txt'
    with path.open('w', encoding='utf-8') as file:
        console = CommandConsole(file=file)
        with CommandProgress(console=console) as progress, console.status('waiting'):
            progress.add_task('working')
            progress.refresh()
            console.print('a line')
    assert path.read_text(encoding='utf-8') == 'a line\n'
