# SPDX-License-Identifier: Apache-2.0
import importlib
import sys

import pytest

from socialcircle_ros.kernels.imports import without_module


def test_a_module_can_be_withheld_for_a_while():
    with without_module('tabnanny'), pytest.raises(ModuleNotFoundError):
        importlib.import_module('tabnanny')
    importlib.import_module('tabnanny')
    with without_module('tabnanny'):  # what is loaded stays
        importlib.import_module('tabnanny')
    del sys.modules['tabnanny']  # other tests start without it
