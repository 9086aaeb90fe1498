"""Tracking of one recording, for the subcommands that track."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from cardbox_tracker.commands.arguments import body_of_person, print_remarks

if TYPE_CHECKING:
    from cardbox_tracker.camera.camera import Camera
    from cardbox_tracker.commands.request import PersonRequest, RecordingRequest, TrackingRequest
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
# A given pitch contradicts the one found from this many standard deviations on, and from this
# difference on, degrees.
_SURE_STDDEVS, _LEAST_DEG = 2.5, 6.0


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
    from cardbox_tracker.detectors.hand_network import HandNetwork
    from cardbox_tracker.measuring.standing_camera import PITCH_PRIOR, USUAL_PITCH
    from cardbox_tracker.person.model import PLACEMENT
    from cardbox_tracker.person.model_file import save_body_model
    from cardbox_tracker.person.proportions import USUAL_STATURE_M, USUAL_STDDEV_M
    from cardbox_tracker.recordings.quality import Quality
    from cardbox_tracker.recordings.silhouettes import TimeSpan
    from cardbox_tracker.recordings.track import Crowd, track_recording

    qualities: dict[int, Quality] = {}
    recording, person = request.recording, request.person
    bodies = [person.body, *person.others]
    start_s = person.start_s
    if person.model is not None and person.body.doubt:
        print(f"{person.model}: {person.body.doubt}")
    if person.model is None:
        standing = TimeSpan(start_s, start_s + _STANDING_S)
        # The person may come later.
        found = placed(recording, standing, start_s + _COMES_WITHIN_S, person)
        recording = found.recording
        if not person.is_pitch_given:
            if recording.detector is None:
                found = found._replace(stddev_rad=math.hypot(USUAL_PITCH, PITCH_PRIOR))
                print_remarks(
                    [
                        "nothing tells the camera's pitch without a detector: a level camera is "
                        "assumed, so every posture is at best uncertain; give --camera-pitch-deg "
                        "(0 for a level camera)"
                    ]
                )
            tilt = {"camera_pitch_rad": found.pitch_rad, "pitch_stddev_rad": found.stddev_rad}
            bodies = [body.with_values(**tilt) for body in bodies]
        if found.distance is not None and "distance_m" in person.body.unknown:
            stature_m = person.stature_m or USUAL_STATURE_M
            lowest_m, highest_m, *_ = PLACEMENT["distance_m"]
            distance_m = min(max(found.distance * stature_m, lowest_m), highest_m)
            bodies = [body.with_values(distance_m=distance_m) for body in bodies]
        if person.stature_m is None:
            unsure = USUAL_STDDEV_M / USUAL_STATURE_M
            bodies = [body.with_values(stature_stddev=unsure) for body in bodies]
            print_remarks(
                [
                    f"the stature is taken as that of most adults, {USUAL_STATURE_M:g} m (standard "
                    f"deviation {USUAL_STDDEV_M:g}), so sizes and distances may be wrong by a "
                    "tenth; give --stature M"
                ]
            )
    crowd = None
    if person.people is not None:
        crowd = Crowd(tuple(bodies), person.people or None)
        observers = tuple(partial(_of_person, person.number, observe) for observe in observers)

    def judge(frame: RecordedFrame, estimate: Estimate, tracker: Tracker) -> None:
        qualities.setdefault(estimate.person or 0, Quality())(frame, estimate, tracker)

    with recording.open() as source:
        early = source.first.remarks
        print_remarks(early)
        total_s = max(1e-9, min(source.first.duration_s, person.end_s) - start_s)
        with ExitStack() as stack:
            observers = (*_writers(request, source, stack), *observers)
            if show is None:
                observers = (*observers, judge)
            advance = show or stack.enter_context(progress_bar("track"))
            summary = track_recording(
                source,
                bodies[0],
                request.config,
                request.seed,
                start_s,
                request.files.table,
                (*observers, lambda frame, *_: advance((frame.time_s - start_s) / total_s)),
                person.end_s,
                crowd,
                None if request.hands is None else HandNetwork(request.hands),
            )
        remarks = [remark for remark in source.first.remarks if remark not in early]
        accounts = tuple(one.account for one in source.sources)
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
    from cardbox_tracker.person.proportions import USUAL_STATURE_M
    from cardbox_tracker.recordings.given_camera import GUESSED_STDDEV

    person, given = request.person, request.recording.camera
    lens = "guessed" if camera.focal_stddev >= GUESSED_STDDEV else "from the recording"
    if given.is_calibrated:
        lens = "given" if given.calibration is None else f"from {given.calibration.name}"
    fov_deg = math.degrees(2 * math.atan(camera.width / 2 / camera.fx))
    yield f"field of view {fov_deg:.0f} degrees ({lens})"
    source = "given" if person.model is None else f"from {person.model.name}"
    tilt = body.camera_pose
    deviation = f"standard deviation {math.degrees(tilt.pitch_stddev_rad):.0f}"
    pitch = "assumed" if request.recording.detector is None else f"found, {deviation}"
    pitch_deg = math.degrees(tilt.pitch_rad)
    yield (
        f"camera pitch {abs(pitch_deg):.0f} degrees {'down' if pitch_deg >= 0 else 'up'} "
        f"({source if person.is_pitch_given else pitch})"
    )
    distance = "found" if "distance_m" in person.body.unknown else source
    yield f"distance {body.placement.distance_m:.2f} m ({distance})"
    if person.stature_m is not None:
        yield f"stature {person.stature_m:.2f} m (given), sizes from proportions"
    elif person.model is None:
        yield f"stature {USUAL_STATURE_M:.2f} m (the mean of adults), sizes from proportions"
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


class Placement(NamedTuple):
    """The camera of a recording.

    Attributes:
        pitch_rad: downward pitch, as it is given or found.
        recording: the recording with the camera's roll, unless it is given.
        stddev_rad: standard deviation of a pitch that was found.
        distance: of the person who stands upright, statures; None without one.
    """

    pitch_rad: float
    recording: RecordingRequest
    stddev_rad: float = math.radians(2.0)
    distance: float | None = None


def placed(
    recording: RecordingRequest,
    span: TimeSpan,
    until_s: float = 0.0,
    person: PersonRequest | None = None,
) -> Placement:
    """Return the camera's pitch and roll, and say what was found, or contradicts what is given.

    They are found from the edges of the room, and from the person who stands upright in ``span`` or
    later up to ``until_s``, if the recording is read with a detector; else the pitch is 0.

    Args:
        recording: the recording.
        span: when the person stands upright.
        until_s: until when the person is sought, seconds from the start.
        person: what is given of the person and of the pitch; None for nothing.

    Raises:
        CardboxError: the recording cannot be read, or the detector cannot be loaded.
    """
    from cardbox_tracker.recordings.standing import placed_camera

    detector, camera = recording.detector, recording.camera
    given_rad = None
    if person is not None and person.is_pitch_given:
        given_rad = person.body.camera_pose.pitch_rad
    if detector is None:
        return Placement(given_rad or 0.0, recording)
    name = recording.cameras[0] if recording.cameras else None
    found = placed_camera(recording.path, detector, span, camera, name, until_s, given_rad)
    tilt = found.tilt
    pitch, deviation = math.degrees(tilt.pitch_rad), math.degrees(tilt.pitch_stddev_rad)
    sources = ["the vertical edges of the room"] if tilt.has_edges else []
    if found.span is not None:
        first_s, last_s = found.span.start_s, found.span.end_s
        sources.append(
            f"the person standing upright between the seconds {first_s:g} and {last_s:g}"
        )
    number = f"{abs(pitch):.0f} degrees {'down' if pitch >= 0 else 'up'}"
    number += f" (standard deviation {deviation:.0f})"
    remarks = []
    if given_rad is not None:
        given = math.degrees(given_rad)
        if abs(given - pitch) > max(_LEAST_DEG, _SURE_STDDEVS * deviation):
            shown_by = " and ".join(sources) or "most cameras"
            remarks.append(
                f"--camera-pitch-deg {given:g} is used, but {shown_by} show {number}; "
                "leave the option out to use that"
            )
    elif sources:
        remarks.append(
            f"camera pitch {number}, found from {' and '.join(sources)}; give --camera-pitch-deg "
            "if it is known"
        )
    else:
        end_s = max(span.end_s, until_s)
        remarks.append(
            f"nobody stands upright between the seconds {span.start_s:g} and {end_s:g} and no "
            "edges of the room are vertical, so the camera's pitch is taken as that of most "
            f"cameras, {number}; give --camera-pitch-deg if it is known"
        )
    if tilt.roll_rad and camera.roll_rad is None and len(recording.cameras) < 2:
        remarks.append(
            f"camera roll {math.degrees(tilt.roll_rad):.1f} degrees, found in the same way: the "
            "images are turned back; give --camera-roll-deg 0 to leave them as they are"
        )
        recording = replace(recording, camera=replace(camera, roll_rad=tilt.roll_rad))
    print_remarks(remarks)
    distance = None if found.standing is None else found.standing.distance
    if given_rad is not None:
        return Placement(given_rad, recording, distance=distance)
    return Placement(tilt.pitch_rad, recording, tilt.pitch_stddev_rad, distance)
