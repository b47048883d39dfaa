# SPDX-License-Identifier: Apache-2.0
"""Signals of a process, each test in a process of its own."""

import subprocess
import sys

PROGRAM = """
import signal, sys, threading
from socialcircle_ros.storage import lasting_interruption

class Finalized:
    def __del__(self):
        signal.raise_signal(signal.SIGINT)

try:
    with lasting_interruption() as interrupted:
        {body}
except KeyboardInterrupt:
    print('stopped', interrupted.first)
print(signal.getsignal(signal.SIGINT) is signal.default_int_handler, sys.unraisablehook is sys.__unraisablehook__)
"""


def said(body):
    program = PROGRAM.format(body=body)
    done = subprocess.run([sys.executable, '-c', program], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines(), done.stderr


def test_an_interruption_that_a_finalizer_loses_is_raised_again():
    out, err = said('Finalized(); threading.Event().wait()')
    assert out == ['stopped 2', 'True True']
    assert err == ''


def test_an_interruption_is_noted_whatever_a_library_makes_of_it():
    body = """
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            pass
        print(interrupted.first)"""
    assert said(body)[0] == ['2', 'True True']


def test_another_error_in_a_finalizer_is_shown_as_ever():
    out, err = said("Finalized.__del__ = lambda _: 1 / 0; Finalized(); print('on', interrupted.first)")
    assert out == ['on None', 'True True']
    assert 'ZeroDivisionError' in err


def test_a_handler_that_is_set_meanwhile_stays():
    out, _ = said('signal.signal(signal.SIGINT, signal.SIG_IGN)')
    assert out == ['False True']
