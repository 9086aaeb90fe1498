"""``cardbox rula``: computes the RULA score of a recording, with its uncertainty."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, fields
from datetime import UTC, datetime
from pathlib import Path
from typing import TypeVar

from cardbox_tracker import __version__
from cardbox_tracker.applications.ergonomics import recording, report
from cardbox_tracker.applications.ergonomics.recording import (
    MomentImages,
    RulaRow,
    ScoreObserver,
    score_rula,
)
from cardbox_tracker.applications.ergonomics.report import PageContent
from cardbox_tracker.applications.ergonomics.rula import RULA, ErgonomicConfig, Method, RulaConfig
from cardbox_tracker.commands.arguments import (
    TrackedResults,
    Written,
    check_outputs,
    choice,
    option,
    print_remarks,
)
from cardbox_tracker.commands.request import TABLES, TrackingOptions
from cardbox_tracker.commands.tracking import track
from cardbox_tracker.commands.tracking_request import tracking_request
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import scene_beside, write_file
from cardbox_tracker.measuring.scene import load_scene
from cardbox_tracker.person.proportions import USUAL_STATURE_M
from cardbox_tracker.recordings.bag_reader import CAMERA_INFO_TYPE, BagReader
from cardbox_tracker.recordings.open_images import is_bag
from cardbox_tracker.recordings.result_reader import MODEL, Results
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from cardbox_tracker.recordings.track import TrackSummary
from cardbox_tracker.tracking.estimate import Estimate
from cardbox_tracker.tracking.tracker import Tracker

HIDDEN_HEAD, _, NO_IMAGES = IMAGES = ("hidden-head", "shown", "none")

_SIZES_FROM = {"measured": "reference postures", "proportions": "proportions of people"}
# Stamps before 2001 count from a start of their own, as those of films do.
_LEAST_CLOCK_S = 1e9

C = TypeVar("C", bound=ErgonomicConfig)


@dataclass(frozen=True)
class Scored(Written, TrackingOptions):
    """A recording or its results, and the files of both methods.

    Attributes:
        recording: rosbag2 folder or file, video, or folder of images, which is tracked as by
            'cardbox track'; or the table, or bag, that it has written
        hands: with --detector mediapipe: also measure the wrists, which are declared otherwise
        csv: table to write, one row per image: its score, the chance of each
        plot: draw the scores over time
        html: write a page that prints: scores, shares of time, worst moments
        title: heading of --html, such as the task
        images: images of the worst moments in --html, not of results: with the head of the tracked
            person, and faces that the detector shows, made unrecognizable, as they are, or none
    """

    recording: Path = option("RECORDING|RESULTS", default=MISSING)
    csv: Path | None = option("OUT.csv")
    plot: Path | None = option("OUT.png")
    html: Path | None = option("OUT.html")
    title: str | None = option("TEXT")
    images: str = choice(IMAGES, default=HIDDEN_HEAD)

    @property
    def outputs(self) -> tuple[Path | None, ...]:
        """The files; None for each that is not wanted."""
        return self.csv, self.plot, self.html


@dataclass(frozen=True)
class Arguments(Scored, RulaConfig):
    """A recording or its results, and what no image shows."""

    group = "what no image shows"


def run(asked: Arguments) -> None:
    """Score every image, and print times, part scores and declared inputs."""
    score(asked, asked, RULA, score_rula)


def score(
    asked: Scored, config: C, method: Method, score_by: Callable[[Results, C, int], list[RulaRow]]
) -> None:
    """Track the recording, if it is none of results, score it, and write what was asked for."""
    if asked.html is None and (asked.title is not None or asked.images != IMAGES[0]):
        raise CardboxError("--images and --title change the page of --html; give --html OUT.html")
    images = None

    def by(results: Results) -> list[RulaRow]:
        return score_by(results, config, asked.seed)

    if is_results(asked.recording):
        check_outputs(asked.outputs, asked.force, inputs=(asked.recording,))
        results = _read(asked)
        rows, about = by(results), _about_results(asked, results)
    else:
        request = tracking_request(asked)
        check_outputs(asked.outputs, asked.force, inputs=request.inputs)
        if asked.html is not None and asked.images != NO_IMAGES:
            images = MomentImages(is_head_hidden=asked.images == HIDDEN_HEAD)
        observer = ScoreObserver(asked.recording, by, images)
        if asked.people is not None and asked.person is None:
            print_remarks(["of several people, person 1 is scored; --person K gives another"])

        def observe(frame: RecordedFrame, estimate: Estimate, tracker: Tracker) -> None:
            if estimate.person in (None, asked.number):
                observer(frame, estimate, tracker)

        summary = track(request, observers=(observe,))
        rows, about = observer.rows, _about_tracking(asked, summary)
    if not rows:
        raise CardboxError(f"{asked.recording} shows no person {asked.number} to score")
    name = asked.recording.resolve().name
    span = f"{rows[0].time_s:.1f} to {rows[-1].time_s:.1f} s, {len(rows)} images"
    facts = {"Recording": f"{name}, {span}", **about}
    begin_s = rows[0].stamp_ns / 1e9
    if begin_s > _LEAST_CLOCK_S:
        facts["Begin"] = f"{datetime.fromtimestamp(begin_s, UTC):%Y-%m-%d %H:%M:%S} UTC"
    facts["Random seed"] = str(asked.seed)
    content = PageContent(
        asked.title or f"{method.name} of {name}",
        facts,
        config,
        rows,
        None if images is None else images.by_stamp(),
        images is None or images.is_head_hidden,
        method,
    )
    _write(asked, content)


def _write(files: Scored, content: PageContent) -> None:
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


def is_results(path: Path) -> bool:
    """Return whether a path is that of results, and not of images with or without these."""
    if path.suffix.removeprefix(".") in TABLES:
        return True
    if not path.exists() or not is_bag(path):
        return False
    with BagReader(path) as bag:
        is_tracked = any(topic.endswith(MODEL) for topic in bag.topics)
        kinds = (kind for name, kind in bag.topics.items() if not name.startswith("/silhouette"))
        return is_tracked and CAMERA_INFO_TYPE not in kinds


def _read(asked: Scored) -> Results:
    """Return the results; CardboxError names options that matter to tracking only."""
    kept = "recording", "person", "seed"
    options = {one.name: getattr(asked, one.name) for one in fields(TrackingOptions)}
    without = TrackingOptions(**{**options, "person": None, "seed": 0}).given().keys() - {*kept}
    wrong = [*sorted(without), *(["--images"] if asked.images != IMAGES[0] else [])]
    person = asked.person if isinstance(asked.person, int) else None
    if asked.person != person:
        wrong.append("--person, but for a number,")
    if wrong:
        raise CardboxError(
            f"{wrong[0]} has no effect on {asked.recording}, which is tracked already; leave it "
            "out, or give the recording"
        )
    return TrackedResults(results=asked.recording, person=person).read()


def _about_results(asked: Scored, results: Results) -> Mapping[str, str]:
    """Return what is known of person and camera, by name."""
    facts, body, beside = {}, results.body, scene_beside(asked.recording)
    sizes = "" if body is None else f"sizes from {_SIZES_FROM[body.source]}"
    if results.has_others:
        sizes = f"person {asked.number}; {sizes}"
    facts["Person"] = sizes or "not known"
    if beside.is_file():
        facts["Assumed"] = "; ".join(load_scene(beside).words())
    return facts | {"Program": f"cardbox_tracker {__version__}"}


def _about_tracking(asked: Scored, summary: TrackSummary) -> Mapping[str, str]:
    """Return how the recording was tracked, and what was assumed, by name."""
    statures_m = asked.statures_m or (USUAL_STATURE_M,)
    stature_m = statures_m[min(asked.number, len(statures_m)) - 1]
    person = f"stature {stature_m} m" if asked.model is None else asked.model.name
    if asked.people is not None:
        person = f"person {asked.number}, {person}"
    if summary.body is not None:
        person += f"; sizes from {_SIZES_FROM[summary.body.source]}"
    points = asked.detector or asked.detector_class or "none, so neck and legs are declared"
    return {
        "Person": person,
        "Assumed": "; ".join(summary.assumptions),
        "Points of a detector": str(points),
        "Tracker": f"cardbox_tracker {__version__}, preset {asked.preset}",
    }
