"""Signals that come at a bad time."""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest

# An object of the module is deleted when Python has put its handlers away.
PROGRAM = """
import os
from cardbox_tracker import interrupts

class Last:
    def __del__(self, kill=os.kill, own=os.getpid()):
        kill(own, {number})

with interrupts.only_noted():
    last = Last()
    os.kill(os.getpid(), {number})
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_second_signal_while_python_ends_changes_nothing(number: signal.Signals) -> None:
    program = PROGRAM.format(number=int(number))
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (0, b"")
