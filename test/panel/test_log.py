# SPDX-License-Identifier: Apache-2.0
"""The log of the page, and the guard that writes failures into it."""

from types import SimpleNamespace

import pytest

from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.panel.link import LogEntry, Snapshot
from socialcircle_ros.panel.log import Log


class Server:
    """A server with one visitor, without viser."""

    def __init__(self):
        self.html = SimpleNamespace(content='')
        self.notifications = []
        self.gui = SimpleNamespace(add_html=lambda _: self.html)

    def get_clients(self):
        return {0: SimpleNamespace(add_notification=lambda _, text, **__: self.notifications.append(text))}


@pytest.fixture
def server():
    return Server()


def fail(error):
    raise error


def test_a_failure_is_shown_once_until_the_step_succeeds_again(server, logged):
    log = Log(server)
    for _ in range(3):
        log.guarded('Drawing', fail, ValueError('no room'))
    log.guarded('Counting', fail, ValueError('no room'))
    assert server.notifications == [
        f'{step} failed: ValueError: no room.' for step in ('Drawing', 'Counting')
    ] == [record.getMessage() for record in logged()]  # fmt: skip
    log.guarded('Drawing', lambda: None)
    log.guarded('Drawing', fail, ValueError('no room'))
    assert len(server.notifications) == 3
    assert server.html.content.count('Drawing failed') == 2


def test_an_error_for_the_visitor_is_shown_as_its_sentence_and_without_a_trace(server, logged):
    Log(server).guarded('Loading', fail, SocialCircleError('There is no such preset.'))
    assert server.notifications == ['There is no such preset.']
    assert logged() == []


def test_a_failure_that_cannot_be_shown_ends_nothing(server, logged):
    log = Log(server)
    server.get_clients = lambda: fail(RuntimeError('no visitors'))
    log.guarded('Drawing', fail, ValueError('no room'))
    assert [record.getMessage() for record in logged()] == [
        'Drawing failed: ValueError: no room.',
        'A failure could not be shown on the page.',
    ]


def test_each_entry_of_the_link_is_taken_once_and_the_newest_are_kept(server):
    log = Log(server)
    entries = tuple(LogEntry(0.0, f'entry {number}.') for number in range(100))
    log.take(Snapshot(log=entries[:70], log_total=70))
    log.take(Snapshot(log=entries[:70], log_total=70))
    log.take(Snapshot(log=entries, log_total=100))
    assert server.html.content.count('entry ') == 60
    assert server.html.content.index('entry 99.') < server.html.content.index('entry 40.')
