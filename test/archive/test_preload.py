# SPDX-License-Identifier: Apache-2.0
"""What the process loads from which workers are forked."""

import runpy
import tempfile

import pytest

pytest.importorskip('pyarrow')


def test_a_temporary_folder_that_cannot_be_used_does_not_end_the_process(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, 'tempdir', str(tmp_path / 'none'))
    module = runpy.run_module('socialcircle_ros.archive.preload')
    assert 'do_task' in module
