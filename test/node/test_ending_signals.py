# SPDX-License-Identifier: Apache-2.0
"""The signals that end the node."""

import signal
import subprocess
import sys

import pytest

PROGRAM = """
import signal, threading
from socialcircle_ros.node.ending_signals import EndingSignals
signals, woken = EndingSignals(), threading.Event()
assert not signals.came
signals.wake_by(woken.set)
for _ in range(2):
    signal.raise_signal({number})
    assert signals.came
    assert woken.wait(60)
signals.ignore()
assert signal.getsignal({number}) is signal.SIG_IGN  # Python gives up its own handlers at the exit
"""


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_is_noted_wakes_the_node_and_interrupts_nothing(number):
    program = PROGRAM.format(number=int(number))
    assert subprocess.run([sys.executable, '-c', program], check=False).returncode == 0
