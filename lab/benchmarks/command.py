"""The arguments of ``cardbox benchmark``."""

from __future__ import annotations

import argparse
from pathlib import Path

from lab.benchmarks import run as benchmark


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``cardbox benchmark``."""
    parser.add_argument("--json", type=Path, required=True, metavar="FILE", help="results to write")
    parser.add_argument("--report", type=Path, metavar="FILE.md", help="report to write")
    parser.add_argument(
        "--session",
        type=Path,
        metavar="SESSION",
        help="recorded session with a person for the node detector, which finds nobody in drawn "
        "images",
    )


def run(options: argparse.Namespace) -> None:
    """Measure, write the results and print a short table."""
    results = benchmark.run_benchmark(options.json, options.report, session=options.session)
    print(benchmark.short_table(results))
    print(f"wrote {options.json}" + (f" and {options.report}" if options.report else ""))
