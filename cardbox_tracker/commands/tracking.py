"""Tracking of one recording, for the subcommands that track."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial

import numpy as np

from cardbox_tracker.applications.drawing.overlay import draw_sharp_overlay
from cardbox_tracker.applications.drawing.video import overlay_video
from cardbox_tracker.commands.arguments import print_remarks
from cardbox_tracker.commands.scene import measured_scene
from cardbox_tracker.commands.tracking_request import PersonRequest, TrackingRequest
from cardbox_tracker.common.files import body_of_person
from cardbox_tracker.common.progress import progress_bar
from cardbox_tracker.detectors.hand_network import HandNetwork
from cardbox_tracker.measuring.scene import Scene, save_scene
from cardbox_tracker.person.model_file import save_body_model
from cardbox_tracker.person.proportions import USUAL_STATURE_M
from cardbox_tracker.recordings.given_camera import FOV_HINT, UNKNOWN_LENS
from cardbox_tracker.recordings.recording import Recording
from cardbox_tracker.recordings.result_bag import result_bag
from cardbox_tracker.recordings.result_table import result_table
from cardbox_tracker.recordings.silhouettes import TimeSpan
from cardbox_tracker.recordings.track import Observer, TrackSummary, track_recording
from cardbox_tracker.tracking.session import Session


def track(
    request: TrackingRequest,
    observers: tuple[Observer, ...] = (),
    show: Callable[[float], None] | None = None,
) -> TrackSummary:
    """Track a recording, print remarks, write the files and return the summary.

    ``observers`` are called after each image. ``show`` receives the finished fraction, 0 to 1;
    without it, there are a progress bar and lines on assumptions and quality. Raises CardboxError
    if the recording cannot be read, or a result cannot be written.
    """
    person, files = request.person, request.files
    if person.model is not None and person.body.doubt:
        print(f"{person.model}: {person.body.doubt}")
    with measured_scene(request) as measured:
        source, scene, chosen, found = measured
        # Hands and the overlay are seen at the resolution of the recording.
        source.first.has_pictures = request.hands is not None or files.video is not None
        early, known = source.first.remarks, (source.names[0], source.first.duration_s)
        of_films = (film.remarks(*known) for film in source.films)
        print_remarks(found, *of_films, _with_unknown(early, person))
        number = None if chosen is None else chosen.number
        summary = _tracked(request, source, scene, observers, show, number)
        print_remarks(one for one in source.first.remarks if one not in early)
        accounts = tuple(one.account for one in source.sources)
        who = () if chosen is None else (str(chosen),)
        assumptions = (*who, *_assumptions(request, scene, source))
        poses = [other.extrinsics for other in source.others]
        cameras = dict(zip(source.names[1:], poses, strict=True))
    summary = replace(
        summary, accounts=accounts, assumptions=assumptions, scene=scene, cameras=cameras
    )
    print_remarks(summary.remarks)
    if show is None:
        print(*_lines(summary), sep="\n")
    for number, one in (summary.people or {1: summary}).items():
        if files.body is not None and one.body is not None:
            save_body_model(one.body, body_of_person(files.body, number))
    if files.scene is not None:
        save_scene(scene, files.scene)
    one = summary.people.get(person.number, summary)
    names = "remarks", "accounts", "assumptions", "scene", "cameras", "people"
    return replace(one, **{name: getattr(summary, name) for name in names})


def _tracked(
    request: TrackingRequest,
    source: Recording,
    scene: Scene,
    observers: tuple[Observer, ...],
    show: Callable[[float], None] | None,
    only: int | None,
) -> TrackSummary:
    person, camera, config = request.person, source.first.camera, request.config
    span, people = TimeSpan(person.start_s, person.end_s), person.people if only is None else 0
    look = None if request.hands is None else HandNetwork(request.hands)
    given = config, np.random.default_rng(request.seed), source.others, people, look
    session = Session(scene.people, camera, *given, only=only)
    total_s = max(1e-9, min(source.first.duration_s, span.end_s) - span.start_s)
    with ExitStack() as stack:
        observers = (*_writers(request, source, stack), *observers)
        advance = show or stack.enter_context(progress_bar("track"))
        told = (*observers, lambda frame, *_: advance((frame.time_s - span.start_s) / total_s))
        return track_recording(source, session, span, told, request.smoothing)


def _lines(summary: TrackSummary) -> Iterator[str]:
    """Yield what was tracked, on what it rests, and how sure it is."""
    if not summary.people:
        yield f"tracked {summary.frames_tracked} of {summary.frames} images"
    yield f"assumed: {', '.join(summary.assumptions)}"
    yield from () if summary.people else summary.quality
    seen = {number: one for number, one in summary.people.items() if one.frames_tracked}
    for number, one in seen.items():
        yield f"person {number}: tracked {one.frames_tracked} of {one.frames} images"
        yield from one.quality
    if unseen := len(summary.people) - len(seen):
        yield f"{unseen} more, of {len(summary.people)} people, in no image"
    if summary.used_text:
        yield summary.used_text


def _with_unknown(remarks: Sequence[str], person: PersonRequest) -> list[str]:
    """Return remarks with one on an unknown stature, which also tells of an unknown lens."""
    if person.stature_m is not None or person.model is not None:
        return [*remarks]
    others = [remark for remark in remarks if not remark.startswith(UNKNOWN_LENS)]
    unknown = (
        f"the stature is taken as that of most adults, {USUAL_STATURE_M:g} m, so sizes and "
        "distances may be wrong by a tenth; give --stature M"
    )
    if len(others) < len(remarks):
        unknown = (
            f"stature and field of view are unknown ({USUAL_STATURE_M:g} m and those of most "
            "cameras are assumed), so distances may be wrong by half, and sizes by a tenth; give "
            f"--stature M and --fov DEG ({FOV_HINT}); times, and mostly angles, are right all the "
            "same"
        )
    return [unknown, *others]


def _assumptions(request: TrackingRequest, scene: Scene, source: Recording) -> Iterator[str]:
    """Yield camera, place and stature with where they are from."""
    person = request.person
    yield from scene.words()
    yield from (f"{film.name} {film.camera}" for film in source.films)
    origin = "given" if person.model is None else f"from {person.model.name}"
    is_given = "distance_m" not in person.body.unknown
    for number, body in enumerate(scene.people, 1):
        whose = "" if person.people is None else f" of person {number}"
        shown = "usual: nobody shows it" if "distance_m" in body.unknown else "found"
        distance = origin if is_given else shown
        yield f"distance{whose} {body.placement.distance_m:.2f} m ({distance})"
    if person.stature_m is not None:
        each = " and ".join(f"{one:.2f}" for one in person.statures_m)
        yield f"stature {each} m (given), sizes from proportions"
    elif person.model is None:
        yield f"stature {USUAL_STATURE_M:.2f} m (the mean of adults), sizes from proportions"
    else:
        yield f"sizes {origin}"


def _writers(request: TrackingRequest, source: Recording, stack: ExitStack) -> Iterator[Observer]:
    """Yield what writes the files; they appear when ``stack`` is closed without an error."""
    table, bag, video = request.files.table, request.files.bag, request.files.video
    if video is not None:
        yield stack.enter_context(overlay_video(video, source, request.files.hides_heads))
    if bag is not None:
        frame_id = source.first.frame_id
        draw = partial(draw_sharp_overlay, hides_heads=request.files.hides_heads)
        yield stack.enter_context(result_bag(bag, frame_id, request.force, draw))
    if table is not None:
        add_row = stack.enter_context(result_table(table, **request.has))
        yield lambda frame, estimate, tracker: add_row(
            frame, estimate.as_camera_stands(tracker.body.camera_pose.roll_rad)
        )
