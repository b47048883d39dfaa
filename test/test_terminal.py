# SPDX-License-Identifier: Apache-2.0
"""Whether a terminal belongs to this process."""

import os

import pytest

from socialcircle_ros.terminal import is_in_foreground


@pytest.mark.parametrize(('ahead', 'foreground'), [(0, True), (1, False)])
def test_the_group_of_the_foreground_decides(monkeypatch, ahead, foreground):
    monkeypatch.setattr(os, 'tcgetpgrp', lambda _: os.getpgrp() + ahead)
    assert is_in_foreground(0) == foreground


def test_a_file_that_controls_no_process_counts_as_the_foreground(tmp_path):
    with (tmp_path / 'file').open('w', encoding='utf-8') as file:
        assert is_in_foreground(file.fileno())
