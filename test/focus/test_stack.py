import numpy as np
import pytest
from focus.stacks import errors, make_stack
from naive import focus as naive

from socialcircle_ros.errors import StackError
from socialcircle_ros.focus import FocusStack, Reason, depth_from_focus, focus_measure
from socialcircle_ros.focus.curve import Curves
from socialcircle_ros.settings import FocusSettings


def _same(one, other):
    return all(
        np.array_equal(getattr(one, name), getattr(other, name), equal_nan=name == 'depth')
        for name in ('depth', 'quality', 'image', 'reasons')
    )


@pytest.fixture(scope='module')
def clean():
    return make_stack()
