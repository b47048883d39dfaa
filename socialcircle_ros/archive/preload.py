# SPDX-License-Identifier: Apache-2.0
"""Imported once by the process from which workers are forked, so that none of them loads what all of them need.

That is the modules of a task, and the kernels that the default settings run, which a small recording loads. A
process that has threads cannot be forked: those of the task end with it.
"""

import contextlib
import tempfile
from pathlib import Path

import numpy as np

from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.kernels.imports import without_module
from socialcircle_ros.messages import point_cloud
from socialcircle_ros.messages.header import Header
from socialcircle_ros.recording import RecordingWriter, ros_topic
from socialcircle_ros.settings import PipelineSettings

from .inputs import find_inputs
from .names import NamePattern
from .tasks import BatchTask
from .work import do_task

_SHAPE = 60, 80  # a smaller cloud does not need all kernels


def _load_what_a_task_needs() -> None:
    heights = np.random.default_rng(0).normal(0, 1e-7, _SHAPE).astype(np.float32)
    heights[::9, ::7] += 1e-5
    y, x = np.mgrid[: _SHAPE[0], : _SHAPE[1]].astype(np.float32) * 1e-6
    with tempfile.TemporaryDirectory(prefix='socialcircle-') as folder:
        path = Path(folder, 'preload.mcap')
        with RecordingWriter(path) as writer:
            writer.add_topic(ros_topic('/points', point_cloud.TYPE))
            cloud = point_cloud.encode_point_cloud(Header.at(0, 'microscope'), np.dstack([x, y, heights]))
            writer.write('/points', cloud, 0)
        (found,) = find_inputs([path])
        # pyarrow would import pandas, for a quarter of a second, to see that it is not used.
        with without_module('pandas'):
            do_task(BatchTask(found, folder, PipelineSettings(), NamePattern(), (), True, False, 'none', '', ''))


# An error would end the process from which workers are forked. They can also load the kernels themselves.
with contextlib.suppress(OSError, SocialCircleError):
    _load_what_a_task_needs()
