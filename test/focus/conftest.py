# SPDX-License-Identifier: Apache-2.0
"""Focus stacks with a known truth that several tests share."""

import numpy as np
import pytest
from focus.stacks import make_stack


@pytest.fixture(scope='module')
def clean():
    """16 bits, no noise."""
    return make_stack(dtype=np.uint16)


@pytest.fixture(scope='module')
def noisy():
    """8 bits, the noise of a camera."""
    return make_stack(electrons=6000)


@pytest.fixture(scope='module')
def fine():
    """As `noisy`, but curves four times as wide in steps."""
    return make_stack(electrons=6000, width=5.2, margin=30.0)
