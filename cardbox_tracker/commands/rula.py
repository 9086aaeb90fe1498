"""``cardbox rula``: computes the RULA score of a recording, with its uncertainty."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from cardbox_tracker import __version__
from cardbox_tracker.applications.ergonomics import recording, report
from cardbox_tracker.applications.ergonomics.recording import MomentImages, RulaObserver, RulaRow
from cardbox_tracker.applications.ergonomics.report import PageContent
from cardbox_tracker.applications.ergonomics.rula import RulaConfig
from cardbox_tracker.commands.arguments import (
    add_force,
    add_options,
    add_settings,
    check_outputs,
    print_remarks,
    settings_from,
)
from cardbox_tracker.commands.request import TrackingOptions
from cardbox_tracker.commands.tracking import track
from cardbox_tracker.commands.tracking_request import tracking_request
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import write_file
from cardbox_tracker.person.proportions import USUAL_STATURE_M
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from cardbox_tracker.recordings.track import TrackSummary
from cardbox_tracker.tracking.estimate import Estimate
from cardbox_tracker.tracking.tracker import Tracker

HIDDEN_HEAD, _, NO_IMAGES = IMAGES = ("hidden-head", "shown", "none")

_SIZES_FROM = {"measured": "reference postures", "proportions": "proportions of people"}
# Stamps before 2001 count from a start of their own, as those of films do.
_LEAST_CLOCK_S = 1e9


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``cardbox rula``."""
    hands = "with --detector mediapipe: also measure the wrists, which are declared otherwise"
    add_options(parser, TrackingOptions, hands={"help": hands})
    add_score_outputs(parser)
    parser.add_argument(
        "--images",
        choices=IMAGES,
        default=IMAGES[0],
        help="images of the worst moments in --html: with the head of the tracked person made "
        "unrecognizable, as they are, or none",
    )
    add_force(parser)
    add_settings(parser, RulaConfig, "what no image shows")


def run(options: argparse.Namespace) -> None:
    """Track the person, score every image, and print times, part scores and declared inputs."""
    if options.html is None and (options.title is not None or options.images != IMAGES[0]):
        raise CardboxError("--images and --title change the page of --html; give --html OUT.html")
    asked = TrackingOptions.of(options)
    request = tracking_request(asked)
    check_outputs(outputs_of(options), options.force, inputs=request.inputs)
    config = settings_from(options, RulaConfig)
    images = None
    if options.html is not None and options.images != NO_IMAGES:
        images = MomentImages(is_head_hidden=options.images == HIDDEN_HEAD)
    observer = RulaObserver(config, asked.seed, images)
    if asked.people is not None and asked.person is None:
        print_remarks(["of several people, person 1 is scored; --person K gives another"])

    def observe(frame: RecordedFrame, estimate: Estimate, tracker: Tracker) -> None:
        if estimate.person in (None, asked.number):
            observer(frame, estimate, tracker)

    summary = track(request, observers=(observe,))
    content = _content(asked, options.title, config, observer.rows, summary, images)
    write_scores(options, content)


def add_score_outputs(parser: argparse.ArgumentParser) -> None:
    """Add the options of the files that both methods write."""
    for flag, name, text in (
        ("--csv", "OUT.csv", "table to write, one row per image: its score, the chance of each"),
        ("--plot", "OUT.png", "draw the scores over time"),
        ("--html", "OUT.html", "write a page that prints: scores, shares of time, worst moments"),
    ):
        parser.add_argument(flag, type=Path, metavar=name, help=text)
    parser.add_argument("--title", metavar="TEXT", help="heading of --html, such as the task")


def outputs_of(options: argparse.Namespace) -> tuple[Path | None, ...]:
    """Return the files of :func:`add_score_outputs`; None for each that is not wanted."""
    return options.csv, options.plot, options.html


def write_scores(options: argparse.Namespace, content: PageContent) -> None:
    """Print times, part scores and declared inputs, and write the files."""
    rows, config, method = content.rows, content.config, content.method
    shares = recording.score_shares(rows, config, method)
    for line in report.report_lines(recording.summarize(rows, method), shares, config, method):
        print(line)
    if options.csv is not None:
        recording.write_csv(rows, options.csv, method)
    if options.plot is not None:
        write_file(options.plot, report.score_plot(rows, (), method))
    if options.html is not None:
        report.write_page(content, options.html)
    for path in outputs_of(options):
        if path is not None:
            print(f"wrote {path}")


def _content(
    asked: TrackingOptions,
    title: str | None,
    config: RulaConfig,
    rows: Sequence[RulaRow],
    summary: TrackSummary,
    images: MomentImages | None,
) -> PageContent:
    name = asked.recording.resolve().name
    statures_m = asked.statures_m or (USUAL_STATURE_M,)
    stature_m = statures_m[min(asked.number, len(statures_m)) - 1]
    person = f"stature {stature_m} m" if asked.model is None else asked.model.name
    if asked.people is not None:
        person = f"person {asked.number}, {person}"
    if summary.body is not None:
        person += f"; sizes from {_SIZES_FROM[summary.body.source]}"
    span = f"{rows[0].time_s:.1f} to {rows[-1].time_s:.1f} s, {len(rows)} images"
    facts = {"Recording": f"{name}, {span}", "Person": person}
    facts["Assumed"] = "; ".join(summary.assumptions)
    begin_s = rows[0].stamp_ns / 1e9
    if begin_s > _LEAST_CLOCK_S:
        facts["Begin"] = f"{datetime.fromtimestamp(begin_s, UTC):%Y-%m-%d %H:%M:%S} UTC"
    points = asked.detector or asked.detector_class or "none, so the neck is declared"
    facts["Points of a detector"] = str(points)
    facts["Tracker"] = f"cardbox_tracker {__version__}, preset {asked.preset}"
    facts["Random seed"] = str(asked.seed)
    return PageContent(
        title or f"RULA of {name}",
        facts,
        config,
        rows,
        None if images is None else images.by_stamp(),
        images is None or images.is_head_hidden,
    )
