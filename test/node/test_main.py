# SPDX-License-Identifier: Apache-2.0
"""How the executable ends where the node cannot be closed in order."""

from types import SimpleNamespace

import pytest

from socialcircle_ros.node import main, social_circle_node, start


def closing_fails():
    raise RuntimeError('the middleware does not answer')


@pytest.mark.parametrize('close', [lambda: False, closing_fails])
def test_a_process_with_a_thread_that_may_be_left_exits_at_once(monkeypatch, capsys, close):
    node = SimpleNamespace(get_fully_qualified_name=lambda: '/social_circle', start=lambda: None, close=close)
    ended = []
    monkeypatch.setattr(social_circle_node, 'SocialCircleNode', lambda **_: node)
    monkeypatch.setattr(start, 'start_ros', lambda *_, **__: None)
    for name in ('prepare_process', '_spin'):
        monkeypatch.setattr(main, name, lambda *_: None)
    monkeypatch.setattr(main.sys, 'setswitchinterval', lambda _: None)
    monkeypatch.setattr(main, '_exit_at_once', ended.append)
    assert main._run([], SimpleNamespace(came=False)) == 0
    assert ended == [node]
    assert ('the middleware does not answer' in capsys.readouterr().err) == (close is closing_fails)
