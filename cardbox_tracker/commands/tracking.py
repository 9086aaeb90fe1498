"""Tracking of one recording, for the subcommands that track."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from cardbox_tracker.commands.arguments import body_of_person, print_remarks

if TYPE_CHECKING:
    from cardbox_tracker.camera.camera import Camera
    from cardbox_tracker.commands.request import RecordingRequest, TrackingRequest
    from cardbox_tracker.person.model import BodyModel
    from cardbox_tracker.recordings.recording import Recording
    from cardbox_tracker.recordings.silhouettes import RecordedFrame, TimeSpan
    from cardbox_tracker.recordings.track import Observer, TrackSummary
    from cardbox_tracker.tracking.estimate import Estimate
    from cardbox_tracker.tracking.tracker import Tracker

_STANDING_S = 1.0
"""Time for which a person of a given stature stands upright at the start, seconds."""
_COMES_WITHIN_S = 30.0
"""Time after the start within which a person of a given stature is sought, seconds."""


def track(
    request: TrackingRequest,
    observers: tuple[Observer, ...] = (),
    show: Callable[[float], None] | None = None,
) -> TrackSummary:
    """Track a recording, print remarks and return the summary.

    Args:
        request: what is tracked, and the results to write.
        observers: called after each image.
        show: receives the finished fraction, 0 to 1; if None, there are a progress bar and lines
            that say what was assumed, and how good the results are.

    Raises:
        CardboxError: the recording cannot be read, or a result cannot be written.
    """
    from cardbox_tracker.common.progress import progress_bar
    from cardbox_tracker.person.model_file import save_body_model
    from cardbox_tracker.recordings.quality import Quality
    from cardbox_tracker.recordings.silhouettes import TimeSpan
    from cardbox_tracker.recordings.track import Crowd, track_recording

    qualities: dict[int, Quality] = {}
    recording, person = request.recording, request.person
    bodies = [person.body, *person.others]
    start_s = person.start_s
    if person.model is not None and person.body.doubt:
        print(f"{person.model}: {person.body.doubt}")
    if not person.is_pitch_given:
        standing = TimeSpan(start_s, start_s + _STANDING_S)
        # The person may come later.
        pitch_rad, recording = placed(recording, standing, start_s + _COMES_WITHIN_S)
        bodies = [body.with_values(camera_pitch_rad=pitch_rad) for body in bodies]
    crowd = None
    if person.people is not None:
        crowd = Crowd(tuple(bodies), person.people or None)
        observers = tuple(partial(_of_person, person.number, observe) for observe in observers)

    def judge(frame: RecordedFrame, estimate: Estimate, tracker: Tracker) -> None:
        qualities.setdefault(estimate.person or 0, Quality())(frame, estimate, tracker)

    with recording.open() as source:
        total_s = max(1e-9, min(source.first.duration_s, person.end_s) - start_s)
        with ExitStack() as stack:
            observers = (*_writers(request, source, stack), *observers)
            advance = show or stack.enter_context(progress_bar("track"))
            summary = track_recording(
                source,
                bodies[0],
                request.config,
                request.seed,
                start_s,
                request.files.table,
                (
                    *observers,
                    judge,
                    lambda frame, *_: advance((frame.time_s - start_s) / total_s),
                ),
                person.end_s,
                crowd,
            )
        remarks, accounts = source.first.remarks, tuple(one.account for one in source.sources)
        assumptions = tuple(_assumptions(request, source.first.camera, summary.body or bodies[0]))
    summary = replace(summary, accounts=accounts, assumptions=assumptions)
    if show is None and not summary.people:
        print(f"tracked {summary.frames_tracked} of {summary.frames} images")
    print_remarks(remarks, summary.remarks)
    if show is None:
        print(f"assumed: {', '.join(summary.assumptions)}")
        for number, quality in sorted(qualities.items()):
            if number:
                one = summary.people[number]
                print(f"person {number}: tracked {one.frames_tracked} of {one.frames} images")
            print(*quality.lines(), sep="\n")
        if summary.used_text:
            print(summary.used_text)
    for number, one in (summary.people or {1: summary}).items():
        if request.files.body is not None and one.body is not None:
            save_body_model(one.body, body_of_person(request.files.body, number))
    if person.people is None:
        return summary
    one = summary.people.get(person.number, summary)
    return replace(one, accounts=accounts, assumptions=assumptions)


def _of_person(
    number: int, observe: Observer, frame: RecordedFrame, estimate: Estimate, tracker: Tracker
) -> None:
    """Pass on the results of one of several people."""
    if estimate.person == number:
        observe(frame, estimate, tracker)


def _assumptions(request: TrackingRequest, camera: Camera, body: BodyModel) -> Iterator[str]:
    """Yield camera, place and stature with where they are from; ``body`` is that of the end."""
    person, given = request.person, request.recording.camera
    lens = "from the recording" if given.calibration is None else f"from {given.calibration.name}"
    fov_deg = math.degrees(2 * math.atan(camera.width / 2 / camera.fx))
    yield f"field of view {fov_deg:.0f} degrees ({'given' if given.fov_deg else lens})"
    source = "given" if person.model is None else f"from {person.model.name}"
    pitch_rad = body.camera_pose.pitch_rad
    pitch = source if person.is_pitch_given else "found" if pitch_rad else "not found, taken as 0"
    yield f"camera pitch {math.degrees(pitch_rad):.0f} degrees down ({pitch})"
    distance = "found" if "distance_m" in person.body.unknown else source
    yield f"distance {body.placement.distance_m:.2f} m ({distance})"
    if person.stature_m is not None:
        yield f"stature {person.stature_m:.2f} m (given), sizes from proportions"
    else:
        yield f"sizes {source}"


def _writers(request: TrackingRequest, source: Recording, stack: ExitStack) -> Iterator[Observer]:
    """Yield what writes bag and video; they appear when ``stack`` is closed without an error."""
    from cardbox_tracker.applications.drawing.overlay import draw_sharp_overlay
    from cardbox_tracker.applications.drawing.video import overlay_video
    from cardbox_tracker.recordings.result_bag import result_bag

    bag, video = request.files.bag, request.files.video
    if video is not None:
        yield stack.enter_context(overlay_video(video, source))
    if bag is not None:
        frame_id = source.first.frame_id
        yield stack.enter_context(result_bag(bag, frame_id, request.force, draw_sharp_overlay))


def placed(
    recording: RecordingRequest, span: TimeSpan, until_s: float = 0.0
) -> tuple[float, RecordingRequest]:
    """Return the camera's pitch, rad, and the recording with the camera's roll, unless it is given.

    Both are found from the person who stands upright in ``span``, or later up to ``until_s``, if
    the recording is read with a detector; else the pitch is 0. A remark says what was found.

    Raises:
        CardboxError: the recording cannot be read, or the detector cannot be loaded.
    """
    from cardbox_tracker.recordings.standing import camera_of_standing

    detector, camera = recording.detector, recording.camera
    if detector is None:
        return 0.0, recording
    name = recording.cameras[0] if recording.cameras else None
    standing = camera_of_standing(recording.path, detector, span, camera, name, until_s)
    advice = "give --camera-pitch-deg if it is known"
    if standing is None:
        end_s = max(span.end_s, until_s)
        print_remarks(
            [
                f"nobody stands upright between the seconds {span.start_s:g} and {end_s:g}, so the "
                f"camera's pitch is taken as 0; {advice}"
            ]
        )
        return 0.0, recording
    found, span = standing
    degrees = math.degrees(found.pitch_rad)
    remarks = [
        f"camera pitch {abs(degrees):.0f} degrees {'down' if degrees >= 0 else 'up'} (standard "
        f"deviation {math.degrees(found.pitch_stddev_rad):.0f}), found from the person standing "
        f"upright between the seconds {span.start_s:g} and {span.end_s:g}; {advice}"
        if found.is_pitch_found
        else f"the camera's pitch does not show without the feet and is taken as 0; {advice}"
    ]
    if found.roll_rad and camera.roll_rad is None and len(recording.cameras) < 2:
        remarks.append(
            f"camera roll {math.degrees(found.roll_rad):.1f} degrees, found in the same way: the "
            "images are turned back; give --camera-roll-deg 0 to leave them as they are"
        )
        recording = replace(recording, camera=replace(camera, roll_rad=found.roll_rad))
    print_remarks(remarks)
    return found.pitch_rad, recording
