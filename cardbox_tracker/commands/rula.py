"""``cardbox rula``: computes the RULA score of a recording, with its uncertainty."""

from __future__ import annotations

import argparse
from pathlib import Path

from cardbox_tracker.commands.output_paths import add_force, check_outputs
from cardbox_tracker.commands.settings_arguments import add_settings, settings_from
from cardbox_tracker.commands.tracking import add_inputs, inputs_of, track_inputs

NAME = "rula"
HELP = "score the strain on arms, neck and trunk in a recording (RULA)"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``cardbox rula``."""
    from cardbox_tracker.ergonomics.config import RulaConfig

    add_inputs(parser)
    parser.add_argument(
        "--csv",
        type=Path,
        required=True,
        metavar="OUT.csv",
        help="table to write, one row per image: the expected score and the chance of each",
    )
    parser.add_argument(
        "--plot", type=Path, default=None, metavar="OUT.png", help="also draw the scores over time"
    )
    add_force(parser)
    add_settings(parser, RulaConfig, "the task and the limits that the paper leaves open")


def run(options: argparse.Namespace) -> None:
    """Track the person, score every image, and print the time at each level.

    Raises:
        CardboxError: the recording or the body model cannot be read, a setting is out of range, or
            a result cannot be written.
    """
    from cardbox_tracker.ergonomics.config import RulaConfig
    from cardbox_tracker.ergonomics.plot import plot_scores
    from cardbox_tracker.ergonomics.recording import ABOVE, summarize, write_csv
    from cardbox_tracker.ergonomics.tables import ACTION_LEVELS
    from cardbox_tracker.recordings.rula import RulaObserver

    check_outputs((options.csv, options.plot), options.force, inputs=inputs_of(options))
    observer = RulaObserver(settings_from(options, RulaConfig), options.seed)
    track_inputs(options, observers=(observer,))
    write_csv(observer.rows, options.csv)
    summary = summarize(observer.rows)
    if summary.measured_s:
        share = summary.above_s / summary.measured_s
        print(
            f"expected RULA score {summary.mean:.1f}; above {ABOVE} for {summary.above_s:.1f} of "
            f"{summary.measured_s:.1f} s ({share:.0%})"
        )
        for (low, high, meaning), time_s in zip(ACTION_LEVELS, summary.by_level_s, strict=True):
            scores = str(low) if low == high else f"{low}-{high}"
            print(f"  {scores:<3} {time_s:6.1f} s  {meaning}")
    print(f"wrote {options.csv}")
    if options.plot is not None:
        plot_scores(observer.rows, options.plot)
        print(f"wrote {options.plot}")
