"""Several nodes in one page, and a page that waits for the first one."""

import threading

import pytest
from browser import Visitor
from examples import cloud
from panel.fake import FakeGraph, FakeLink

pytest.importorskip('viser', reason='the page needs viser: pip install ".[panel]"')

from socialcircle_ros.panel.page import page_of
from socialcircle_ros.panel.presets import Presets

SCALE = 'circle.radius_scale'


def test_the_page_waits_for_a_node_offers_several_and_shows_each_with_its_own_cloud_and_values(chromium, tmp_path):
    first, second = FakeLink('/cell1/social_circle'), FakeLink('/cell2/social_circle')
    graph, stop = FakeGraph(), threading.Event()
    server, page, address = page_of(graph, Presets(tmp_path), '127.0.0.1', 0)
    thread = threading.Thread(target=page.run, args=(stop.is_set,))
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
        visitor.leave()
    finally:
        stop.set()
        thread.join()
        server.stop()
