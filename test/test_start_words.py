"""An executable that was built for another Python says what that lacks."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
from importlib import import_module
from pathlib import Path
from unittest.mock import Mock

import pytest
from numba.core.caching import IndexDataCacheFile

from cardbox_tracker.common import compiling
from cardbox_tracker.start import other_package, start

ROOT = Path(__file__).resolve().parents[1]
WITHOUT = """
import sys
sys.modules[sys.argv.pop(1)] = None  # an import of it fails, as under the system's Python
from cardbox_tracker import start
sys.exit(start.{name}())
"""


@pytest.mark.parametrize(("name", "missing"), [("tracker", "numba"), ("play_bag", "rosbags")])
def test_a_missing_package_is_told_in_words(name: str, missing: str) -> None:
    pytest.importorskip("rclpy", reason="rclpy is not installed")
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT.format(name=name), missing],
        capture_output=True,
        text=True,
        cwd=ROOT,
        check=False,
    )
    assert done.returncode == 1
    assert f"{name}: the Python package '{missing}' is missing" in done.stderr
    assert "python -m colcon build" in done.stderr and sys.executable in done.stderr
    assert "Traceback" not in done.stderr


def test_a_program_has_one_thread_of_openblas_unless_told() -> None:
    program = """
import os, sys
from cardbox_tracker import start
print(os.environ["OPENBLAS_NUM_THREADS"], "numpy" in sys.modules)
"""
    without = {k: v for k, v in os.environ.items() if k != "OPENBLAS_NUM_THREADS"}
    for given, expected in (({}, "1 False\n"), ({"OPENBLAS_NUM_THREADS": "3"}, "3 False\n")):
        command = [sys.executable, "-c", program]
        done = subprocess.run(
            command, capture_output=True, text=True, cwd=ROOT, env=without | given, check=True
        )
        assert done.stdout == expected


def test_another_fault_keeps_its_traceback() -> None:
    with pytest.raises(ModuleNotFoundError):
        start("tracker", lambda: import_module("cardbox_tracker.nothing").main())


@pytest.mark.parametrize("content", [b"", b"\x80\x04\x95\xff"])
def test_damaged_compiled_code_is_removed_and_told_in_words(
    content: bytes,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    removed: list[bool] = []
    monkeypatch.setattr(compiling, "discard", lambda: removed.append(True))
    (tmp_path / "rate.nbi").write_bytes(content)
    damaged = IndexDataCacheFile(str(tmp_path), "rate", "stamp")
    assert start("cardbox", lambda: damaged.load("signature")) == 1
    assert removed == [True]
    assert "cardbox: start it again" in capsys.readouterr().err


def test_an_error_of_other_data_leaves_the_compiled_code(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiling, "discard", Mock(side_effect=AssertionError))
    with pytest.raises(EOFError):
        start("cardbox", Mock(side_effect=EOFError("Ran out of input")))


@pytest.mark.parametrize("name", ["cardbox", "tracker"])
def test_ctrl_c_during_the_first_imports_has_no_traceback(name: str) -> None:
    """The finder stands for a signal that comes while a module of the standard library loads."""
    program = f"""
import runpy, sys
class Finder:
    def find_spec(self, name, *_):
        if name == "cardbox_tracker.common.interrupts":
            raise KeyboardInterrupt
sys.meta_path.insert(0, Finder())
sys.argv = ["start", "{name}"]
runpy.run_module("cardbox_tracker.start", run_name="__main__")
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode in (-2, 130)
    assert done.stderr == ""


SCRIPT = Path(sysconfig.get_path("scripts")) / "cardbox"
INSTALLED = Path(sysconfig.get_path("purelib")) / "cardbox_tracker"


def test_only_an_executable_of_the_environment_can_run_another_package(tmp_path: Path) -> None:
    environment, workspace = tmp_path / "environment", tmp_path / "workspace"
    for folder in (environment, workspace):
        (folder / "cardbox_tracker").mkdir(parents=True)
    own, other = str(environment / "cardbox_tracker"), str(workspace / "cardbox_tracker")
    # The tutorial installs the same sources twice.
    assert not other_package(str(SCRIPT), other, str(environment))
    (workspace / "cardbox_tracker" / "start.py").write_text("changed = True\n")
    assert other_package(str(SCRIPT), other, str(environment))
    assert not other_package(str(SCRIPT), own, str(environment))
    assert not other_package(str(SCRIPT), other, str(tmp_path / "without a copy"))
    assert not other_package(str(workspace / "cardbox"), other, str(environment))


@pytest.mark.skipif(
    not SCRIPT.is_file() or not INSTALLED.is_dir(), reason="cardbox_tracker is not installed"
)
@pytest.mark.parametrize("is_changed", [True, False])
def test_a_package_before_the_installed_one_is_told_if_it_differs(
    tmp_path: Path, is_changed: bool
) -> None:
    workspace = tmp_path / "cardbox_tracker"
    shutil.copytree(INSTALLED, workspace, ignore=shutil.ignore_patterns("__pycache__"))
    if is_changed:
        (workspace / "newer.py").touch()
    done = subprocess.run(
        [SCRIPT, "--version"],
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    told = [line for line in done.stderr.splitlines() if str(workspace) in line]
    assert len(told) == len(done.stderr.splitlines()) == is_changed
