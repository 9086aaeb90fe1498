"""Write the table of promises and numbers of tried inputs in ``docs/reliability.md``.

``python -m lab.tools.reliability`` (``make reliability``) runs every test that has the marker
``promise`` and writes the table between the marks of that page. A test of examples (hypothesis)
tries ``--examples`` inputs; any other test runs once for each of its cases. ``--quick`` (``make
reliability-quick``) leaves out the slow tests and those of running nodes, and writes nothing.
"""

from __future__ import annotations

import argparse
import os
import re
import signal
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import write_file
from lab.pages import replaced

ROOT = Path(__file__).resolve().parents[2]
PAGE = "docs/reliability.md"
BEGIN, END = "<!-- begin of the table -->", "<!-- end of the table -->"
EXAMPLES, QUICK_EXAMPLES = 100_000, 300
# A busy machine takes this for what takes a tenth of a second.
PATIENCE_S = 60.0
WORDS_OF_PYTHON = re.compile(
    r"object (has no attribute|is not|cannot)|NoneType|codec can't|literal for|unhashable"
    r"|(to|cannot) unpack|unpack(_from)? requires"
    r"|(index|indices|argument) (must be|out of range)|convert (string|float)|must be (real|str)"
    r"|unsupported operand|not supported between|broadcast|reshape|inhomogeneous|array element"
    r"|recursion|division by|[Ss]ingular|positional|keyword|too large to convert"
)


@contextmanager
def refusals(*also: type[Exception]) -> Iterator[None]:
    """Context of an input that is read, or refused in words within :data:`PATIENCE_S`."""

    def late(*_: Any) -> None:
        raise AssertionError(f"it takes more than {PATIENCE_S:g} s")

    allowed: tuple[type[Exception], ...] = CardboxError, *also
    before = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, PATIENCE_S)
    try:
        yield
    except allowed as error:
        assert 0 < len(str(error)) < 2000
        assert not WORDS_OF_PYTHON.search(str(error)), str(error)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


@dataclass
class Row:
    """A promise, with the number of inputs that its tests tried and of the tests that failed."""

    promise: str
    tried: int = 0
    failed: int = 0

    def line(self) -> str:
        """Return the row of the table."""
        failures = f" (**{self.failed} tests failed**)" if self.failed else ""
        return f"| {self.promise} | {self.tried:,}{failures} |"


def run_tests(report: Path, examples: int, *, quick: bool = False) -> int:
    """Run the tests of promises; return pytest's exit code, 0 if all of them passed."""
    environment = {**os.environ, "RELIABILITY_EXAMPLES": str(examples)}
    command = [sys.executable, "-m", "pytest", f"--junit-xml={report}"]
    if quick:
        command += ["-m", "promise and not slow", "--ignore=test/system"]
    else:
        command += ["-m", "promise", "--timeout", "0"]
    return subprocess.run(command, cwd=ROOT, env=environment, check=False).returncode


def rows_of(report: Path) -> list[Row]:
    """Return the promises in a report of pytest, without skipped tests, in alphabetical order."""
    rows: dict[str, Row] = {}
    for case in ElementTree.parse(report).getroot().iter("testcase"):
        found = {entry.get("name"): entry.get("value", "") for entry in case.iter("property")}
        if "promise" not in found or case.find("skipped") is not None:
            continue
        row = rows.setdefault(found["promise"], Row(found["promise"]))
        row.tried += int(found["tried"])
        row.failed += case.find("failure") is not None or case.find("error") is not None
    return [rows[promise] for promise in sorted(rows)]


def table_of(rows: Sequence[Row]) -> str:
    """Return the table of the promises."""
    return "\n".join(["| promise | inputs tried |", "|---|---|", *map(Row.line, rows)])


def main(arguments: list[str] | None = None) -> int:
    """Run the tests, write the page; the exit code is 0 if every promise was kept."""
    parser = argparse.ArgumentParser(prog="reliability", description=__doc__)
    parser.add_argument("--examples", type=int, metavar="N", help="of each test")
    parser.add_argument("--quick", action="store_true", help="minutes; writes nothing")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.xml"
        examples = options.examples or (QUICK_EXAMPLES if options.quick else EXAMPLES)
        code = run_tests(report, examples, quick=options.quick)
        rows = rows_of(report)
    tried = f"{sum(row.tried for row in rows):,} inputs"
    if options.quick:
        print(tried)
        return code
    path = ROOT / PAGE
    page = replaced(path.read_text(encoding="utf-8"), f"\n{table_of(rows)}\n", BEGIN, END)
    write_file(path, page)
    print(f"{tried}; written: {PAGE}")
    return code


if __name__ == "__main__":
    sys.exit(main())
