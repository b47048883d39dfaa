# SPDX-License-Identifier: Apache-2.0
"""Several nodes in one page, and a page that waits for the first one."""

import threading
import time
from pathlib import Path

import pytest
from browser import Visitor
from examples import cloud
from panel.fake import FakeGraph, FakeLink, descriptors

pytest.importorskip('viser', reason='the page needs viser: pip install ".[panel]"')

from socialcircle_ros.panel.link import Presence
from socialcircle_ros.panel.page import page_of
from socialcircle_ros.panel.presets import Presets
from socialcircle_ros.settings.files import read_parameter_file

BAGS = Path(__file__).resolve().parents[2] / 'bags'

SCALE = 'circle.radius_scale'


def test_the_page_waits_for_a_node_offers_several_and_shows_each_with_its_own_cloud_and_values(chromium, tmp_path):
    first, second = FakeLink('/cell1/social_circle'), FakeLink('/cell2/social_circle')
    graph, stop, announced = FakeGraph(), threading.Event(), []
    server, page, address = page_of(graph, Presets(tmp_path), '127.0.0.1', 0)
    thread = threading.Thread(target=page.run, args=(stop.is_set, announced.append))
    thread.start()
    try:
        visitor = Visitor(chromium, address, tab=None)
        assert visitor.sees('Nodes: 0.')
        graph.links = {link.name: link for link in (first, second)}
        assert visitor.sees('Nodes: 2.')
        visitor.choose('node', second.name)
        assert visitor.wait_until('node', second.name)
        visitor.field('radius scale').fill('3')
        second.wait_for(lambda values: values[SCALE] == 3.0)
        second.publish(cloud())
        assert visitor.sees('of measured')
        visitor.choose('node', first.name)
        assert visitor.sees('No cloud yet.')
        assert visitor.wait_until('radius scale', '1.0')
        visitor.choose('node', second.name)
        assert visitor.wait_until('radius scale', '3.0')
        assert visitor.sees('of measured')
        assert first.asked == []
        assert announced == [second.name, first.name, second.name]
        visitor.leave()
    finally:
        stop.set()
        thread.join()
        server.stop()


@pytest.mark.long
def test_frames_that_are_given_at_the_start_wait_for_the_parameters_of_the_node(tmp_path, monkeypatch):
    monkeypatch.setattr('socialcircle_ros.panel.page._PATIENCE_S', 0.0)  # the first try comes too early
    link, stop = FakeLink(), threading.Event()
    values = {**link.snapshot.values, **read_parameter_file(BAGS / 'stack.yaml', 'social_circle')}
    link.update(values={}, descriptors=(), presence=Presence.ABSENT)
    server, page, _ = page_of(FakeGraph(link), Presets(tmp_path), '127.0.0.1', 0, BAGS / 'stack.mcap')
    thread = threading.Thread(target=page.run, args=(stop.is_set,))
    thread.start()
    try:
        while not page._node._current.now.open_problem:
            time.sleep(0.05)
        assert 'stack.pitch_x is not set' in page._node._current.now.open_problem
        link.update(values=values, descriptors=descriptors(), presence=Presence.ACTIVE)
        while not (state := page._node._current.now).title:
            time.sleep(0.05)
        assert state.title == 'Cloud 1 of 1 of stack.mcap'
        assert (state.open_problem, state.stepping_problem) == ('', '')
    finally:
        stop.set()
        thread.join()
        server.stop()
