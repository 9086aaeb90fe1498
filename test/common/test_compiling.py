"""Compiled code is kept where that is possible, and never outlives its sources."""

from __future__ import annotations

import itertools
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numba
import pytest

import cardbox_tracker
from cardbox_tracker.common import compiling

ROOT = Path(__file__).resolve().parents[2]
FACTOR = "FACTOR = 2\n"
CONSTANTS = "from cardbox_tracker.factor import FACTOR\nTWICE = FACTOR\n"
CALLEE = """
from cardbox_tracker.common.compiling import kernel
from cardbox_tracker.constants import (
    TWICE,
)

@kernel
def scaled(x):
    return TWICE * x
"""
CALLER = """
from cardbox_tracker import callee
from cardbox_tracker.common.compiling import kernel

scaled = callee.scaled

@kernel
def double(x):
    return scaled(x)

@kernel
def read(array, place):
    return array[place]
"""


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A small package of the same name, whose function ``double`` calls one of another file."""
    folder, source = tmp_path / "cardbox_tracker", Path(compiling.__file__)
    copy = folder / source.relative_to(Path(cardbox_tracker.__file__).parent)
    copy.parent.mkdir(parents=True)
    shutil.copy(source, copy)
    texts = {"factor": FACTOR, "constants": CONSTANTS, "callee": CALLEE, "caller": CALLER}
    for name, text in {"__init__": "", "other": "", **texts}.items():
        (folder / f"{name}.py").write_text(text)
    return folder


# A process with numba and nothing of the package, of which a copy runs each program.
SERVER = """
import json, os, sys, traceback
import numba
numba.njit(lambda x: x)(1)
for line in sys.stdin:
    folder, program, environment, *outputs = json.loads(line)
    if copy := os.fork():
        print(os.waitstatus_to_exitcode(os.waitpid(copy, 0)[1]), flush=True)
        continue
    for number, path in enumerate(outputs, 1):
        os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
    os.environ.update(environment)
    numba.config.reload_config()
    sys.path[0] = folder
    try:
        exec(program)
    except BaseException:
        traceback.print_exc()
        os._exit(1)
    sys.stdout.flush()
    os._exit(0)
"""


@pytest.fixture(scope="module")
def server() -> Iterator[subprocess.Popen[str]]:
    values = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    values.pop("NUMBA_CACHE_DIR", None)
    command, pipe = [sys.executable, "-c", SERVER], subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, env=values, text=True) as started:
        yield started


@pytest.fixture
def run(package: Path, server: subprocess.Popen[str]) -> Callable[..., tuple[str, str]]:
    """Return what runs a program with the package, and returns its output and its warnings."""

    def run(program: str, **environment: str) -> tuple[str, str]:
        assert server.stdin is not None and server.stdout is not None
        outputs = [package.parent / name for name in ("out", "said")]
        request = [str(package.parent), program, environment, *map(str, outputs)]
        print(json.dumps(request), file=server.stdin, flush=True)
        code = int(server.stdout.readline())
        out, said = (path.read_text() for path in outputs)
        assert code == 0, said
        return out, said

    return run


USE = """
from cardbox_tracker.caller import double
print(double(21), sum(double.stats.cache_hits.values()))
"""


def test_code_is_kept_until_a_source_changes(package: Path, run: Callable) -> None:
    assert run(USE) == ("42 0\n", "")
    (package / "other.py").write_text("CHANGED = True")
    assert run(USE) == ("42 1\n", ""), "no kernel contains the other file"
    for name, old, new in (
        ("callee", "TWICE * x", "TWICE * x + 1"),
        ("factor", "2", "3"),
    ):
        path = package / f"{name}.py"
        path.write_text(path.read_text().replace(old, new))
        out, _ = run(USE)
        assert out == ("43 0\n" if name == "callee" else "64 0\n")
    assert run(USE) == ("64 1\n", "")


def test_only_the_last_folders_are_kept(package: Path) -> None:
    found = []
    for count in range(6):
        (package / "factor.py").write_text(f"FACTOR = {count}")
        found.append(compiling.choose_folder(str(package)))
        assert found[-1] is not None
        os.utime(found[-1], (count, count))
    (package / "factor.py").write_text("FACTOR = 2")
    assert compiling.choose_folder(str(package)) == found[2]
    assert set((package / "__pycache__").iterdir()) == set(found[2:])


BOUNDS = """
import numpy
from cardbox_tracker.caller import read
try:
    print(read(numpy.zeros(3)[:2], 2))
except IndexError:
    print("refused")
"""


def test_code_with_bounds_checks_is_kept_apart(package: Path, run: Callable) -> None:
    for _ in range(2):
        assert run(BOUNDS, NUMBA_BOUNDSCHECK="0") == ("0.0\n", "")
        assert run(BOUNDS, NUMBA_BOUNDSCHECK="1") == ("refused\n", "")
    kept = [path.parent for path in package.rglob("*.read-*.nbc")]
    assert len(kept) == len(set(kept)) == 2, "neither replaces the other"


DAMAGED = """
from cardbox_tracker.common import compiling
from cardbox_tracker.caller import double
try:
    double(21)
except compiling.DAMAGED:
    compiling.discard()
print(double(21), len(list(compiling.FOLDER.rglob("*.double-*"))))
"""


@pytest.mark.promise("No compiled code is run that is damaged or that others may have written")
def test_a_file_that_was_cut_off_is_made_again(package: Path, run: Callable) -> None:
    run(USE)
    for ending, part in itertools.product((".nbi", ".nbc"), (0.0, 0.5)):
        (file,) = package.rglob(f"*.double-*{ending}")
        whole = file.read_bytes()
        file.write_bytes(whole[: int(part * len(whole))])
        out, said = run(DAMAGED)
        assert out == "42 2\n", "it was kept again"
        assert "damaged" in said and str(file.parents[1]) in said and "Traceback" not in said
    assert run(USE) == ("42 1\n", "")


PARTS = """
from cardbox_tracker.common import compiling

@compiling.inlined_kernel
def moved(x, by):
    return x + by

@compiling.kernel
def move(x):
    return moved(x, 1) + moved(moved(x, 20), by=x)
"""


def test_a_part_of_other_kernels_is_compiled_once_and_kept_within_them(
    package: Path, run: Callable
) -> None:
    """For each constant, numba would compile a version, and keep each in a file."""
    (package / "parts.py").write_text(PARTS)
    use = "from cardbox_tracker.parts import move, moved; print(move(5), len(moved.signatures))"
    assert run(use) == ("36 1\n", "")
    assert {path.name.split(".")[1].split("-")[0] for path in package.rglob("*.nbc")} == {"move"}
    assert run(use) == ("36 0\n", ""), "kept code has the part"


FULL = """
from numba.core import caching
def full(*_):
    raise OSError(28, "No space left on device")
caching.IndexDataCacheFile._open_for_write = full
"""


def test_a_full_disk_does_not_end_it(package: Path, run: Callable) -> None:
    """The function calls another one, which cannot be kept either; this is said once."""
    out, said = run(FULL + USE)
    assert out == "42 0\n"
    assert said.count("No space left on device") == 1 and "Traceback" not in said
    assert run(USE) == ("42 0\n", "")


@pytest.fixture
def places(package: Path, tmp_path: Path) -> dict[str, str]:
    """Environment with a read-only package and home, and a folder for temporary files."""
    (package / "__pycache__").touch()
    (tmp_path / "temporary").mkdir()
    return {
        "XDG_CACHE_HOME": str(package / "__pycache__" / "below a file"),
        "TMPDIR": str(tmp_path / "temporary"),
    }


def test_the_users_folder_comes_first(package: Path, run: Callable, tmp_path: Path) -> None:
    run(USE, NUMBA_CACHE_DIR=str(tmp_path / "mine"))
    assert list((tmp_path / "mine").glob("cardbox_tracker-*/**/*.double-*.nbc"))
    assert not (package / "__pycache__").exists()


def test_a_package_that_is_read_only_is_kept_elsewhere(
    package: Path, run: Callable, places: dict[str, str], tmp_path: Path
) -> None:
    assert run(USE, **places) == ("42 0\n", "")
    assert run(USE, **places) == ("42 1\n", "")
    (kept,) = (tmp_path / "temporary").glob("cardbox_tracker-*")
    assert kept.stat().st_mode & 0o077 == 0
    home = {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    assert run(USE, **places | home) == ("42 0\n", "")
    assert list((tmp_path / "cache").rglob("*.nbc"))


@pytest.mark.promise("No compiled code is run that is damaged or that others may have written")
@pytest.mark.parametrize("planted", ["open to all", "a link", "somebody else's", "a file"])
def test_a_folder_that_somebody_planted_is_not_used(
    planted: str,
    package: Path,
    run: Callable,
    places: dict[str, str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", places["XDG_CACHE_HOME"])
    monkeypatch.setattr(tempfile, "tempdir", places["TMPDIR"])
    folder = compiling.choose_folder(str(package))
    assert folder is not None and folder.parent == tmp_path / "temporary"
    folder.rmdir()
    program = USE
    if planted == "a link":
        (tmp_path / "theirs").mkdir(mode=0o700)
        folder.symlink_to(tmp_path / "theirs")
    elif planted == "a file":
        folder.touch()
    else:
        folder.mkdir()
        folder.chmod(0o777 if planted == "open to all" else 0o700)
    if planted == "somebody else's":
        somebody = os.geteuid() + 1
        folder.rename(folder.with_name(folder.name.replace(f"-{somebody - 1}-", f"-{somebody}-")))
        program = f"import os\nos.geteuid = lambda: {somebody}\n{USE}"
    out, said = run(program, **places)
    assert out == "42 0\n"
    assert "set NUMBA_CACHE_DIR" in said
    assert not list(tmp_path.rglob("*.nb?"))


def test_other_packages_keep_their_folder() -> None:
    before = numba.config.CACHE_DIR
    compiling.kernel(lambda x: x)
    assert before == numba.config.CACHE_DIR


@pytest.mark.parametrize(
    ("command", "library"),
    [("urdf", "numba"), ("synthesize", "numba"), ("call", "numba"), ("track", "scipy.optimize")],
)
def test_libraries_that_take_long_and_are_not_needed_are_not_loaded(
    command: str, library: str
) -> None:
    code = (
        "import sys\nfrom cardbox_tracker.commands.main import main\n"
        f"try: main([{command!r}, '--help'])\nexcept SystemExit: pass\n"
        "import cardbox_tracker.person.urdf, cardbox_tracker.person.model_file\n"
        f"assert {library!r} not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)


@pytest.mark.parametrize(
    ("first", "environment"),
    [
        ("", {}),
        ("", {"NUMBA_DISABLE_JIT": "1", "NUMBA_NUM_THREADS": "0"}),
        ("import numba; ", {"NUMBA_DISABLE_JIT": "1"}),
    ],
)
def test_settings_of_numba_with_which_nothing_works_are_not_followed(
    first: str, environment: dict[str, str]
) -> None:
    program = f"{first}from cardbox_tracker.common.compiling import kernel; import numba; "
    program += "print(kernel(lambda x: 1.5 * x)(3), numba.config.DISABLE_JIT)"
    run = subprocess.run(
        [sys.executable, "-c", program],
        env={**os.environ, "PYTHONPATH": str(ROOT), **environment},
        capture_output=True,
        text=True,
        check=True,
    )
    assert run.stdout.split() == ["4.5", "0"]
    for name, value in environment.items():
        assert f"{name}={value} is not followed" in run.stderr
    assert bool(run.stderr) == bool(environment)
