"""Signals that come at a bad time."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

# Python deletes this object when it has put its handlers away.
NODE = """
import os, sys, types
from cardbox_tracker.common import interrupts
from cardbox_tracker import start

class Last:
    def __del__(self, kill=os.kill, own=os.getpid()):
        kill(own, {number})

def main():
    with interrupts.only_noted():
        os.kill(os.getpid(), {number})
        return 0

last = Last()
sys.modules["fake"] = types.SimpleNamespace(main=main)
start.NODES["tracker"] = "fake"
sys.exit(start.tracker())
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_second_signal_while_python_ends_changes_nothing(number: signal.Signals) -> None:
    program = NODE.format(number=int(number))
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (0, b"")


# As if Ctrl-C came while a dataclass is defined; Python keeps a note of it where nobody sees.
COMMAND = """
import sys, types
from cardbox_tracker.common import interrupts
from cardbox_tracker import start

def main():
    try:
        with interrupts.raised():
            exec("import os, signal; os.kill(os.getpid(), signal.SIGINT)")
    except KeyboardInterrupt:
        print("interrupted")
        return 130

sys.modules[start.COMMAND] = types.SimpleNamespace(main=main)
sys.exit(start.cardbox())
"""


def test_an_interrupted_command_has_its_exit_code_wherever_the_interrupt_came(
    tmp_path: Path,
) -> None:
    (tmp_path / "within_exec.py").write_text(COMMAND)
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


# A call in another thread never ends, as that of a detector may.
HANGING = """
import os, runpy, signal, sys, time, types
from cardbox_tracker.commands.arguments import Options
from cardbox_tracker.common.beside import results_ahead

def images():
    for _ in range(2):
        yield 1e6
        time.sleep(0.1)
    os.kill(os.getpid(), signal.SIGINT)

def run(_):
    return [*results_ahead(time.sleep, images())]

sys.modules["cardbox_tracker.commands.body"] = types.SimpleNamespace(Arguments=Options, run=run)
sys.argv = ["cardbox", "body"]
runpy.run_module("cardbox_tracker.commands.main", run_name="__main__")
"""


def test_an_interrupted_module_waits_for_no_foreign_code() -> None:
    done = subprocess.run(
        [sys.executable, "-c", HANGING], capture_output=True, text=True, check=False, timeout=100
    )
    assert (done.returncode, done.stderr) == (130, "cardbox body: interrupted\n")


def test_an_ignored_signal_stays_ignored() -> None:
    program = (
        "import os, signal; from cardbox_tracker.common import interrupts\n"
        "signal.signal(signal.SIGHUP, signal.SIG_IGN)\n"
        "with interrupts.raised():\n"
        "    os.kill(os.getpid(), signal.SIGHUP)\n"
        "print(interrupts.received())"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, check=True)
    assert done.stdout == b"0\n"
