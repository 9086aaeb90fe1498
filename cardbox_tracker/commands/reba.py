"""``cardbox reba``: computes the REBA score of a table of results, with its uncertainty."""

from __future__ import annotations

from dataclasses import MISSING, dataclass
from pathlib import Path

from cardbox_tracker import __version__
from cardbox_tracker.applications.ergonomics.reba import REBA, RebaConfig, images_of, score_table
from cardbox_tracker.applications.ergonomics.report import PageContent
from cardbox_tracker.commands.arguments import (
    TrackedResults,
    at_least,
    check_outputs,
    option,
)
from cardbox_tracker.commands.rula import ScoreFiles, write_scores


@dataclass(frozen=True, kw_only=True)
class Arguments(TrackedResults, ScoreFiles, RebaConfig):
    """A table, and what no image shows.

    Attributes:
        results: table of 'cardbox track --detector'
        person: whom of several people (default: 1)
        seed: random seed of the samples of the postures
    """

    group = "what no image shows"
    results: Path = option("TABLE.csv", default=MISSING)
    seed: int = option(read=at_least(0), default=0)


def run(given: Arguments) -> None:
    """Score every image, and print times, part scores and declared inputs."""
    check_outputs(given.outputs, given.force, inputs=(given.results,))
    rows = score_table(images_of(given.read()), given, given.seed)
    span = f"{rows[0].time_s:.1f} to {rows[-1].time_s:.1f} s, {len(rows)} images"
    facts = {
        "Table": f"{given.results.name}, {span}",
        "Program": f"cardbox_tracker {__version__}",
        "Random seed": str(given.seed),
    }
    title = given.title or f"REBA of {given.results.name}"
    write_scores(given, PageContent(title, facts, given, rows, method=REBA))
