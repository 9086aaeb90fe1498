"""No array, whatever its shape, type, content and layout, crashes the functions of compiled code.

The functions run in another process (``kernel_calls.py``), so that a crash is a failed test whose
input hypothesis makes small. ``make reliability`` tries many more arrays, and ``make bounds`` the
same ones with bounds checks, in which each access beyond an array is an error.
"""

from __future__ import annotations

import ast
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from select import select
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = Path(__file__).with_name("kernel_calls.py")
# The first call of each function may compile it.
PATIENCE_S = 240.0
MOST_ARRAYS, MOST_NUMBERS = 10, 8


def constant(name: str) -> Any:
    """Return a literal of the program, which is not imported here."""
    for node in ast.parse(PROGRAM.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == name:
            return ast.literal_eval(node.value)
        if isinstance(node, ast.AnnAssign) and ast.unparse(node.target) == name:
            assert isinstance(node.value, ast.Dict)
            return tuple(ast.literal_eval(key) for key in node.value.keys if key is not None)
    raise KeyError(name)


class Child:
    """The process in which the functions run; a new one after each crash."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[str] | None = None

    def call(self, described: dict[str, Any]) -> int:
        """Call a function with arrays; return how many it took."""
        if self._process is None:
            self._process = subprocess.Popen(
                [sys.executable, "-X", "faulthandler", str(PROGRAM)],
                cwd=ROOT,
                env={**os.environ, "PYTHONPATH": str(ROOT)},
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
            )
        process = self._process
        assert process.stdin is not None and process.stdout is not None
        print(json.dumps(described), file=process.stdin, flush=True)
        answers = select([process.stdout], [], [], PATIENCE_S)[0]
        line = process.stdout.readline() if answers else ""
        if not line:
            code = self.end()
            pytest.fail(f"{described['call']} ended its process ({code}) or never: {described}")
        error, taken = json.loads(line)
        assert not error, f"{error}\n{described}"
        return int(taken)

    def end(self) -> int | None:
        process, self._process = self._process, None
        if process is None:
            return None
        if process.poll() is None:
            process.kill()
        process.communicate()
        return process.returncode


@pytest.fixture(scope="module")
def child() -> Iterator[Child]:
    child = Child()
    yield child
    child.end()


@pytest.fixture(scope="module")
def count(call: str, child: Child) -> int:
    """Return how many arrays a function takes, so that hypothesis makes no others."""
    numbers = [1] * MOST_NUMBERS

    def taken(content: str) -> int:
        usual = {"shape": None, "type": None, "content": content, "seed": 0, "layout": "C"}
        arrays = [usual] * MOST_ARRAYS
        return child.call({"call": call, "size": (20, 16), "arrays": arrays, "numbers": numbers})

    # One that is refused ends a call early.
    return max(map(taken, constant("CONTENTS")))


SIZES = st.one_of(
    *2 * [st.tuples(st.integers(0, 20), st.integers(0, 33) | st.sampled_from([8, 16, 24]))],
    st.tuples(st.integers(1, 3), st.sampled_from([63, 64, 65, 1000, 4095, 4096])),
    st.tuples(st.sampled_from([63, 64, 65, 1000, 4095, 4096]), st.integers(1, 3)),
)
SHAPES = st.lists(st.integers(0, 20), max_size=4) | SIZES
ARRAYS = st.fixed_dictionaries(
    {
        "shape": st.none() | st.none() | st.none() | SHAPES,
        "type": st.none() | st.none() | st.none() | st.sampled_from(constant("TYPES")),
        "content": st.sampled_from(constant("CONTENTS")),
        "seed": st.integers(0, 1000),
        "layout": st.just("C") | st.just("C") | st.sampled_from(constant("LAYOUTS")),
    }
)


@pytest.mark.promise("No array crashes compiled code")
@pytest.mark.parametrize("call", constant("CALLS"), scope="module")
@given(
    size=SIZES,
    numbers=st.lists(st.integers(-1, 40), min_size=MOST_NUMBERS, max_size=MOST_NUMBERS),
    data=st.data(),
)
def test_any_arrays(
    call: str,
    child: Child,
    count: int,
    size: tuple[int, int],
    numbers: list[int],
    data: st.DataObject,
) -> None:
    arrays = data.draw(st.lists(ARRAYS, min_size=count, max_size=count))
    child.call({"call": call, "size": size, "arrays": arrays, "numbers": numbers})


def test_a_crash_and_an_error_fail() -> None:
    """The test itself notices what it is for."""
    child = Child()
    wrong = {"call": "none such", "size": [1, 1], "arrays": [], "numbers": []}
    with pytest.raises(AssertionError, match="KeyError"):
        child.call(wrong)
    assert child._process is not None
    child._process.kill()
    child._process.wait()
    with pytest.raises((BrokenPipeError, pytest.fail.Exception)):
        child.call(wrong)
    child.end()
