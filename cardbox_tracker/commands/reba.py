"""``cardbox reba``: computes the REBA score of a table of results, with its uncertainty."""

from __future__ import annotations

import argparse
from pathlib import Path

from cardbox_tracker import __version__
from cardbox_tracker.commands.arguments import (
    add_force,
    add_seed,
    add_settings,
    at_least,
    check_outputs,
    settings_from,
)

NAME = "reba"
HELP = "score the strain on the whole body in a table of 'cardbox track --legs' (REBA)"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``cardbox reba``."""
    from cardbox_tracker.applications.ergonomics.config import RebaConfig

    add = parser.add_argument
    add("table", type=Path, metavar="TABLE.csv", help="table of 'cardbox track --legs --csv'")
    add("--csv", type=Path, metavar="OUT.csv", help="table to write, one row per image")
    add("--plot", type=Path, metavar="OUT.png", help="draw the scores over time")
    add(
        "--shares",
        type=Path,
        metavar="SHARES.csv",
        help="write the time at each score of each part",
    )
    add(
        "--html",
        type=Path,
        metavar="OUT.html",
        help="write one page that prints: scores, shares of time, and the worst moments",
    )
    add("--title", metavar="TEXT", help="heading of --html, such as the task")
    add("--person", type=at_least(1), default=1, metavar="K", help="whom of several people")
    add_seed(parser, "the samples of the postures")
    add_force(parser)
    add_settings(parser, RebaConfig, "the task and the limits that the paper leaves open")


def run(options: argparse.Namespace) -> None:
    """Score every image, and print times, part scores and declared inputs."""
    from cardbox_tracker.applications.ergonomics.config import RebaConfig
    from cardbox_tracker.applications.ergonomics.reba import REBA, read_table, score_table
    from cardbox_tracker.applications.ergonomics.recording import (
        score_shares,
        summarize,
        write_csv,
        write_shares,
    )
    from cardbox_tracker.applications.ergonomics.report import (
        PageContent,
        plot_scores,
        report_lines,
        write_page,
    )

    outputs = options.csv, options.plot, options.shares, options.html
    check_outputs(outputs, options.force, inputs=(options.table,))
    config = settings_from(options, RebaConfig)
    rows = score_table(read_table(options.table, options.person), config, options.seed)
    shares = score_shares(rows, config, REBA)
    for line in report_lines(summarize(rows, REBA), shares, config, REBA):
        print(line)
    if options.csv is not None:
        write_csv(rows, options.csv, REBA)
    if options.plot is not None:
        plot_scores(rows, options.plot, REBA)
    if options.shares is not None:
        write_shares(shares, options.shares)
    if options.html is not None:
        span = f"{rows[0].time_s:.1f} to {rows[-1].time_s:.1f} s, {len(rows)} images"
        facts = {
            "Table": f"{options.table.name}, {span}",
            "Program": f"cardbox_tracker {__version__}",
            "Random seed": str(options.seed),
        }
        title = options.title or f"REBA of {options.table.name}"
        write_page(PageContent(title, facts, config, rows, method=REBA), options.html)
    for path in outputs:
        if path is not None:
            print(f"wrote {path}")
