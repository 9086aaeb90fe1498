"""Write the table of promises, their tests and numbers of inputs in ``docs/reliability.md``.

``python -m tools.reliability`` (``make reliability``) runs every test that has the marker
``promise`` and writes the table between the marks of that page. A test of examples (hypothesis)
tries ``--examples`` inputs; any other test runs once for each of its cases. With paths of tests,
only their rows are replaced. ``--quick`` (``make reliability-quick``) leaves out the slow tests and
those of running nodes, and does not write the page.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from cardbox_tracker.evaluation.marks import replaced
from cardbox_tracker.files import atomic_path

ROOT = Path(__file__).resolve().parents[1]
PAGE = "docs/reliability.md"
BEGIN, END = "<!-- begin of the table -->", "<!-- end of the table -->"
EXAMPLES, QUICK_EXAMPLES = 100_000, 300


@dataclass
class Row:
    """A promise and the tests of one function for it."""

    promise: str
    test: str
    tried: int = 0
    failed: int = 0

    def line(self) -> str:
        """Return the row of the table."""
        survived = "all" if self.failed == 0 else f"**no: {self.failed} failed**"
        return f"| {self.promise} | `{self.test}` | {self.tried:,} | {survived} |"


def run_tests(report: Path, examples: int, paths: list[str], *, quick: bool = False) -> int:
    """Run the tests of promises; return pytest's exit code, 0 if all of them passed."""
    environment = {**os.environ, "RELIABILITY_EXAMPLES": str(examples)}
    command = [sys.executable, "-m", "pytest", f"--junit-xml={report}"]
    if quick:
        command += ["-m", "promise and not slow", "--ignore=test/system", *paths]
    else:
        command += ["-m", "promise", "--timeout", "0", *paths]
    return subprocess.run(command, cwd=ROOT, env=environment, check=False).returncode


def rows_of(report: Path) -> list[Row]:
    """Return the promises in a report of pytest, in its order, without skipped tests."""
    rows: dict[tuple[str, str], Row] = {}
    for case in ElementTree.parse(report).getroot().iter("testcase"):
        found = {entry.get("name"): entry.get("value", "") for entry in case.iter("property")}
        if "promise" not in found or case.find("skipped") is not None:
            continue
        file = "/".join(case.get("classname", "").split(".")) + ".py"
        test = f"{file}::{case.get('name', '').partition('[')[0]}"
        row = rows.setdefault((found["promise"], test), Row(found["promise"], test))
        row.tried += int(found["tried"])
        row.failed += case.find("failure") is not None or case.find("error") is not None
    return list(rows.values())


def kept_lines(page: str, paths: list[str]) -> list[str]:
    """Return the rows of a page whose tests are not in ``paths``; none without paths."""
    table = page.partition(BEGIN)[2].partition(END)[0] if paths else ""
    lines = [line for line in table.splitlines() if "`" in line]
    return [line for line in lines if not line.split("`")[1].startswith(tuple(paths))]


def table_of(rows: list[Row], kept: Sequence[str] = ()) -> str:
    """Return the table of ``rows`` and of lines that are ``kept``, sorted by test."""
    lines = sorted([*kept, *map(Row.line, rows)], key=lambda line: line.split("`")[1])
    return "\n".join(["| promise | test | tried | survived |", "|---|---|---|---|", *lines])


def main(arguments: list[str] | None = None) -> int:
    """Run the tests, write the page; the exit code is 0 if every promise was kept."""
    parser = argparse.ArgumentParser(prog="reliability", description=__doc__)
    parser.add_argument("--examples", type=int, metavar="N", help="of each test")
    parser.add_argument("--quick", action="store_true", help="minutes; writes nothing")
    parser.add_argument("paths", nargs="*", help="tests to run; without them, all")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.xml"
        examples = options.examples or (QUICK_EXAMPLES if options.quick else EXAMPLES)
        code = run_tests(report, examples, options.paths, quick=options.quick)
        rows = rows_of(report)
    tried = f"{sum(row.tried for row in rows):,} inputs"
    if options.quick:
        print(tried)
        return code
    path = ROOT / PAGE
    text = path.read_text(encoding="utf-8")
    table = table_of(rows, kept_lines(text, options.paths))
    page = replaced(text, f"\n{table}\n", BEGIN, END)
    with atomic_path(path) as temporary:
        temporary.write_text(page, encoding="utf-8")
    print(f"{tried}; written: {PAGE}")
    return code


if __name__ == "__main__":
    sys.exit(main())
