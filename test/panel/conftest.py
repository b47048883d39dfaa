# SPDX-License-Identifier: Apache-2.0
import threading
from types import SimpleNamespace

import pytest
from browser import Visitor, browser
from panel.fake import FakeGraph, FakeLink


@pytest.fixture(scope='session')
def chromium():
    with browser() as found:
        yield found


@pytest.fixture
def logged(caplog):
    """The records of the page and of its server; what asyncio says of other tests is none of them."""
    own = ('socialcircle_ros', 'viser', 'websockets')
    return lambda: [each for each in caplog.records if each.name.partition('.')[0] in own]


@pytest.fixture
def tuning(chromium, tmp_path):
    """The page of a node without ROS, opened by a visitor."""
    from socialcircle_ros.panel.page import page_of
    from socialcircle_ros.panel.presets import Presets

    link, presets, stop = FakeLink(), Presets(tmp_path / 'presets'), threading.Event()
    server, page, address = page_of(FakeGraph(link), presets, '127.0.0.1', 0)
    thread = threading.Thread(target=page.run, args=(stop.is_set,))
    thread.start()
    visitor = Visitor(chromium, address)
    yield SimpleNamespace(link=link, presets=presets, server=server, page=page, address=address, visitor=visitor)
    visitor.leave()
    stop.set()
    thread.join()
    server.stop()
