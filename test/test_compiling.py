"""Compiled code is kept where that is possible, and nothing fails where it is not."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from cardbox_tracker import compiling

ROOT = Path(__file__).resolve().parents[1]
MODULE = """
from cardbox_tracker.compiling import njit

@njit(cache=True)
def double(x):
    return 2 * x
"""
USE = "import sys; sys.path.insert(0, '.'); import twice; print(twice.double(21))"


@pytest.fixture
def module(tmp_path: Path) -> Path:
    """A module of one compiled function, in a folder of its own."""
    folder = tmp_path / "module"
    folder.mkdir()
    (folder / "twice.py").write_text(MODULE)
    return folder


def used(module: Path, **environment: str) -> tuple[str, str]:
    """Call the function in a new interpreter; return its output and its warnings."""
    values = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": "1", **environment}
    command = [sys.executable, "-c", USE]
    done = subprocess.run(command, cwd=module, env=values, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout, done.stderr


@pytest.mark.promise("No compiled code is run that is damaged or that others may have written")
@pytest.mark.parametrize("ending", [".nbi", ".nbc"])
def test_a_file_that_was_cut_off_is_made_again(ending: str, module: Path) -> None:
    assert used(module) == ("42\n", "")
    (file,) = (module / "__pycache__").glob(f"*{ending}")
    whole = file.read_bytes()
    for length in (0, 1, len(whole) // 2, len(whole) - 1):
        file.write_bytes(whole[:length])
        out, told = used(module)
        assert out == "42\n"
        assert "is damaged" in told and "Traceback" not in told
        assert used(module) == ("42\n", ""), "it was kept again"


READER = """
import numpy
from cardbox_tracker.compiling import njit

@njit(cache=True)
def read(array, place):
    return array[place]

def double(place):
    try:
        return read(numpy.zeros(place + 1)[:place], place)
    except IndexError:
        return "refused"
"""


def test_code_with_bounds_checks_is_kept_apart(module: Path) -> None:
    (module / "twice.py").write_text(READER)
    for _ in range(2):
        assert used(module, NUMBA_BOUNDSCHECK="0") == ("0.0\n", "")
        assert used(module, NUMBA_BOUNDSCHECK="1") == ("refused\n", "")
    assert len(list((module / "__pycache__").glob("*.nbc"))) == 2, "neither replaces the other"


CALLEE = """
from cardbox_tracker.compiling import njit
{constant}

@njit(cache=True)
def scaled(x):
    return FACTOR * x
"""
CALLER = """
from cardbox_tracker.compiling import njit
from twice.callee import scaled

@njit(cache=True)
def double(x):
    return scaled(x)
"""


@pytest.mark.parametrize("changed", ["callee", "constants"])
def test_a_caller_is_compiled_again_when_another_file_changes(changed: str, tmp_path: Path) -> None:
    folder = tmp_path / "twice"
    folder.mkdir()
    (folder / "__init__.py").write_text("from twice.caller import double")
    (folder / "caller.py").write_text(CALLER)
    found = []
    for factor in (2, 3, 3):
        constant = f"FACTOR = {factor}"
        if changed == "constants":
            (folder / "constants.py").write_text(constant)
            constant = "from twice.constants import FACTOR"
        (folder / "callee.py").write_text(CALLEE.format(constant=constant))
        found.append(used(tmp_path))
        files = sorted(path.name for path in (folder / "__pycache__").glob("*.nb?"))
    assert found == [("42\n", ""), ("63\n", ""), ("63\n", "")]
    assert len(files) == 4, f"an index and one version of both functions, not {files}"


@pytest.fixture
def nowhere(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Path]:
    """Numba finds no place for its cache; temporary files go to a folder of ours."""

    def refuse(*_: object) -> None:
        raise OSError(30, "Read-only file system")

    from numba.core.caching import CacheImpl

    for locator in CacheImpl._locator_classes:
        if "UserProvided" not in locator.__name__:
            monkeypatch.setattr(locator, "ensure_cache_path", refuse)
    monkeypatch.setattr("numba.config.CACHE_DIR", "")
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setattr(compiling, "_said", set())
    yield tmp_path / f"cardbox_tracker-{os.geteuid()}"


def triple(x: int) -> int:
    return 3 * x


def test_a_folder_of_our_own_is_used_where_numba_has_none(nowhere: Path) -> None:
    assert compiling.njit(cache=True)(triple)(14) == 42
    assert list(nowhere.rglob("*.nbc"))
    assert nowhere.stat().st_mode & 0o077 == 0
    again = compiling.njit(cache=True)(triple)
    assert again(14) == 42
    assert sum(again.stats.cache_hits.values()) == 1


@pytest.mark.promise("No compiled code is run that is damaged or that others may have written")
@pytest.mark.parametrize("planted", ["open to all", "a link", "somebody else's", "a file"])
def test_a_folder_that_somebody_planted_is_not_used(
    planted: str, nowhere: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    if planted == "a link":
        (nowhere.parent / "theirs").mkdir(mode=0o700)
        nowhere.symlink_to(nowhere.parent / "theirs")
    elif planted == "a file":
        nowhere.touch()
    else:
        nowhere.mkdir()
        nowhere.chmod(0o777 if planted == "open to all" else 0o700)
    if planted == "somebody else's":
        somebody = os.geteuid() + 1
        monkeypatch.setattr("os.geteuid", lambda: somebody)
        nowhere.rename(nowhere.with_name(f"cardbox_tracker-{os.geteuid()}"))
    for _ in range(2):
        assert compiling.njit(cache=True)(triple)(14) == 42
    assert not list(nowhere.parent.rglob("*.nb*"))
    (record,) = caplog.records
    assert "set NUMBA_CACHE_DIR" in record.message


def test_a_full_disk_does_not_end_it(
    nowhere: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    function = compiling.njit(cache=True)(triple)
    monkeypatch.setattr("numba.core.caching.IndexDataCacheFile._open_for_write", full)
    assert function(14) == 42
    assert "No space left on device" in caplog.text


@pytest.mark.parametrize("command", ["urdf", "synthesize", "call"])
def test_what_needs_no_compiled_code_does_not_load_the_compiler(command: str) -> None:
    code = (
        "import sys\nfrom cardbox_tracker.commands.main import main\n"
        f"try: main([{command!r}, '--help'])\nexcept SystemExit: pass\n"
        "import cardbox_tracker.body.urdf, cardbox_tracker.body.model_file\n"
        "assert 'numba' not in sys.modules"
    )
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


SUMS = """
import numpy
from cardbox_tracker.compiling import njit

@njit(cache=True)
def total(values):
    if values.any():
        return values.sum() / values.shape[0]
    raise ValueError("nothing to add")

@njit()
def more(values):
    return total(values) + numpy.median(values)
"""
USE_SUMS = """
import sys
sys.path.insert(0, ".")
import numpy, sums
print(sums.total(numpy.arange(4.0)), "numba.np.arraymath" in sys.modules)
try:
    sums.total(numpy.zeros(2))
except ValueError as error:
    print(error)
print(sums.more(numpy.arange(4.0)))
"""


def test_kept_code_is_read_without_the_compiler_which_still_works(tmp_path: Path) -> None:
    """The modules of numba's own functions are only imported when code is compiled."""
    (tmp_path / "sums.py").write_text(SUMS)
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-c", USE_SUMS]
    told = []
    for _ in range(2):
        done = subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True
        )
        assert (done.returncode, done.stderr) == (0, "")
        told.append(done.stdout)
    assert told[0] == "1.5 True\nnothing to add\n3.0\n"
    assert told[1] == "1.5 False\nnothing to add\n3.0\n"
