# SPDX-License-Identifier: Apache-2.0
"""ONNX Runtime without its telemetry. Other modules import it from here, and on demand, since it is slow to load.

From version 1.29 on its import starts a thread that tells its maker about the machine, the models and the runs,
and keeps a file in the user's cache folder. A measurement cell tells nobody. Besides, a process that was forked
would wait at its end for that thread, which it does not have.
"""

import os

os.environ['ORT_DISABLE_TELEMETRY'] = '1'  # before the import: no thread, no file, no event

import onnxruntime

onnxruntime.disable_telemetry_events()  # as much as can be done where others imported it before

__all__ = ['onnxruntime']
