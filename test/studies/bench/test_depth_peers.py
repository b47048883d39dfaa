# SPDX-License-Identifier: Apache-2.0
"""Other libraries measure the same stacks where they are installed, and are named where they are not."""

import importlib.util

import pytest

from socialcircle_ros.studies.bench import depth_peers


def test_peers_that_are_not_installed_are_named_and_left_out(monkeypatch):
    monkeypatch.setattr(importlib.util, 'find_spec', lambda name: None)
    monkeypatch.setattr(depth_peers, 'STACKS', {'rough plane, step DOF': ('flat', 1.0)})
    assert depth_peers.missing_peers() == ['opencv-python-headless', 'scipy']
    rows = list(depth_peers.peer_rows((32,)))
    assert [row.method for row in rows] == [depth_peers.OURS, depth_peers.TRUSTED]
    assert rows[0].deviation < 0.06
    assert rows[0].frame_ms > 0
    assert rows[1].bad <= rows[0].bad


@pytest.mark.parametrize(('module', 'name'), [('scipy', 'SciPy variance'), ('cv2', 'OpenCV Laplacian')])
def test_a_peer_that_is_installed_finds_the_plane(module, name, monkeypatch):
    pytest.importorskip(module)
    monkeypatch.setattr(depth_peers, 'STACKS', {'rough plane, step DOF': ('flat', 1.0)})
    rows = {row.method.split(',')[0]: row for row in depth_peers.peer_rows((32,))}
    assert rows[name].deviation < 0.1
    assert rows[name].good > 0.9
