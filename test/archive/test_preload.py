# SPDX-License-Identifier: Apache-2.0
"""What the process loads from which workers are forked."""

import importlib
import tempfile

import pytest

pytest.importorskip('pyarrow')


def test_a_temporary_folder_that_cannot_be_used_does_not_end_the_process(tmp_path, monkeypatch):
    module = importlib.import_module('socialcircle_ros.archive.preload')
    monkeypatch.setattr(tempfile, 'tempdir', str(tmp_path / 'none'))
    with pytest.raises(FileNotFoundError):
        module._load_what_a_task_needs()
    importlib.reload(module)
