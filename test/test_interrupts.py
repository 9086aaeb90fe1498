"""Signals that come at a bad time."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

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


# As if Ctrl-C came while a dataclass is defined; Python keeps a note of it where nobody sees.
WITHIN_EXEC = """
import sys
from cardbox_tracker import start
from cardbox_tracker.interrupts import INTERRUPTED

def command():
    try:
        exec("raise KeyboardInterrupt")
    except KeyboardInterrupt:
        print("interrupted")
        return INTERRUPTED

start._command = command
sys.exit(start.cardbox())
"""


def test_an_interrupted_command_has_its_exit_code_wherever_the_interrupt_came(
    tmp_path: Path,
) -> None:
    (tmp_path / "within_exec.py").write_text(WITHIN_EXEC)
    # Only a module that Python runs by -m is ended by the note.
    command = [sys.executable, "-m", "within_exec"]
    paths = os.pathsep.join([str(tmp_path), *filter(None, sys.path)])
    done = subprocess.run(
        command,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": paths},
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "interrupted\n", "")
