"""``cardbox benchmark``: the speed on this machine."""

from __future__ import annotations

import argparse
from pathlib import Path

NAME = "benchmark"
HELP = "measure how fast the tracker is on this machine"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``cardbox benchmark``."""
    parser.add_argument("--json", type=Path, required=True, metavar="FILE", help="results to write")
    parser.add_argument("--report", type=Path, metavar="FILE.md", help="report to write")


def run(options: argparse.Namespace) -> None:
    """Measure, write the results and print a short table.

    Raises:
        CardboxError: the results cannot be written.
    """
    from cardbox_tracker.benchmarks.run import run_benchmark, short_table

    print(short_table(run_benchmark(options.json, options.report)))
    print(f"wrote {options.json}" + (f" and {options.report}" if options.report else ""))
