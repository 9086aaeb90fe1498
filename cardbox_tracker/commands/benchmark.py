"""``cardbox benchmark``: the speed of this machine, measured by ``lab/`` of a checkout."""

from __future__ import annotations

import argparse
from pathlib import Path

from cardbox_tracker.commands.checkout import from_checkout

NAME = "benchmark"
HELP = "measure how fast the tracker is on this machine (in a checkout)"


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
    benchmark = from_checkout("lab.benchmarks.run", "benchmark")
    results = benchmark.run_benchmark(options.json, options.report, session=options.session)
    print(benchmark.short_table(results))
    print(f"wrote {options.json}" + (f" and {options.report}" if options.report else ""))
