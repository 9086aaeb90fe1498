"""``cardbox rula``: computes the RULA score of a recording, with its uncertainty."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from cardbox_tracker import __version__
from cardbox_tracker.applications.ergonomics import recording, report
from cardbox_tracker.applications.ergonomics.recording import MomentImages, RulaObserver, RulaRow
from cardbox_tracker.applications.ergonomics.report import PageContent
from cardbox_tracker.applications.ergonomics.rula import RulaConfig
from cardbox_tracker.commands.arguments import (
    Written,
    check_outputs,
    choice,
    option,
    print_remarks,
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


@dataclass(frozen=True, kw_only=True)
class ScoreFiles(Written):
    """The files that both methods write.

    Attributes:
        csv: table to write, one row per image: its score, the chance of each
        plot: draw the scores over time
        html: write a page that prints: scores, shares of time, worst moments
        title: heading of --html, such as the task
    """

    csv: Path | None = option("OUT.csv")
    plot: Path | None = option("OUT.png")
    html: Path | None = option("OUT.html")
    title: str | None = option("TEXT")

    @property
    def outputs(self) -> tuple[Path | None, ...]:
        """The files; None for each that is not wanted."""
        return self.csv, self.plot, self.html


@dataclass(frozen=True)
class Arguments(ScoreFiles, TrackingOptions, RulaConfig):
    """A recording, and what no image shows.

    Attributes:
        hands: with --detector mediapipe: also measure the wrists, which are declared otherwise
        images: images of the worst moments in --html: with the head of the tracked person made
            unrecognizable, as they are, or none
    """

    group = "what no image shows"
    images: str = choice(IMAGES, default=HIDDEN_HEAD)


def run(asked: Arguments) -> None:
    """Track the person, score every image, and print times, part scores and declared inputs."""
    if asked.html is None and (asked.title is not None or asked.images != IMAGES[0]):
        raise CardboxError("--images and --title change the page of --html; give --html OUT.html")
    request = tracking_request(asked)
    check_outputs(asked.outputs, asked.force, inputs=request.inputs)
    images = None
    if asked.html is not None and asked.images != NO_IMAGES:
        images = MomentImages(is_head_hidden=asked.images == HIDDEN_HEAD)
    observer = RulaObserver(asked, asked.seed, images)
    if asked.people is not None and asked.person is None:
        print_remarks(["of several people, person 1 is scored; --person K gives another"])

    def observe(frame: RecordedFrame, estimate: Estimate, tracker: Tracker) -> None:
        if estimate.person in (None, asked.number):
            observer(frame, estimate, tracker)

    summary = track(request, observers=(observe,))
    write_scores(asked, _content(asked, observer.rows, summary, images))


def write_scores(files: ScoreFiles, content: PageContent) -> None:
    """Print times, part scores and declared inputs, and write the files."""
    rows, config, method = content.rows, content.config, content.method
    shares = recording.score_shares(rows, config, method)
    for line in report.report_lines(recording.summarize(rows, method), shares, config, method):
        print(line)
    if files.csv is not None:
        recording.write_csv(rows, files.csv, method)
    if files.plot is not None:
        write_file(files.plot, report.score_plot(rows, (), method))
    if files.html is not None:
        report.write_page(content, files.html)
    for path in files.outputs:
        if path is not None:
            print(f"wrote {path}")


def _content(
    asked: Arguments,
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
        asked.title or f"RULA of {name}",
        facts,
        asked,
        rows,
        None if images is None else images.by_stamp(),
        images is None or images.is_head_hidden,
    )
