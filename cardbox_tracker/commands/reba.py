"""``cardbox reba``: computes the REBA score of a table of results, with its uncertainty."""

from __future__ import annotations

import argparse
from pathlib import Path

from cardbox_tracker import __version__
from cardbox_tracker.applications.ergonomics.reba import REBA, RebaConfig, images_of, score_table
from cardbox_tracker.applications.ergonomics.report import PageContent
from cardbox_tracker.commands.arguments import (
    add_force,
    add_seed,
    add_settings,
    at_least,
    check_outputs,
    results_of,
    settings_from,
)
from cardbox_tracker.commands.rula import add_score_outputs, outputs_of, write_scores


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``cardbox reba``."""
    add = parser.add_argument
    add("table", type=Path, metavar="TABLE.csv", help="table of 'cardbox track --detector'")
    add_score_outputs(parser)
    add("--person", type=at_least(1), metavar="K", help="whom of several people (default: 1)")
    add_seed(parser, "the samples of the postures")
    add_force(parser)
    add_settings(parser, RebaConfig, "what no image shows")


def run(options: argparse.Namespace) -> None:
    """Score every image, and print times, part scores and declared inputs."""
    check_outputs(outputs_of(options), options.force, inputs=(options.table,))
    config = settings_from(options, RebaConfig)
    results = results_of(options.table, options.person)
    rows = score_table(images_of(results), config, options.seed)
    span = f"{rows[0].time_s:.1f} to {rows[-1].time_s:.1f} s, {len(rows)} images"
    facts = {
        "Table": f"{options.table.name}, {span}",
        "Program": f"cardbox_tracker {__version__}",
        "Random seed": str(options.seed),
    }
    title = options.title or f"REBA of {options.table.name}"
    write_scores(options, PageContent(title, facts, config, rows, method=REBA))
