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
    from cardbox_tracker.recordings.silhouettes import RecordedFrame
    from cardbox_tracker.recordings.track import Observer, TrackSummary
    from cardbox_tracker.tracking.estimate import Estimate
    from cardbox_tracker.tracking.tracker import Tracker


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
    from cardbox_tracker.measuring.people_camera import PITCH_PRIOR, USUAL_PITCH
    from cardbox_tracker.person.model import PLACEMENT
    from cardbox_tracker.person.model_file import save_body_model
    from cardbox_tracker.person.proportions import USUAL_STATURE_M, USUAL_STDDEV_M
    from cardbox_tracker.recordings.measured_scene import seen_people, seen_person
    from cardbox_tracker.recordings.quality import Quality
    from cardbox_tracker.recordings.track import Crowd, track_recording

    qualities: dict[int, Quality] = {}
    recording, person = request.recording, request.person
    bodies = [person.body, *person.others]
    start_s = person.start_s
    if person.model is not None and person.body.doubt:
        print(f"{person.model}: {person.body.doubt}")
    if person.model is None:
        found = placed(recording, start_s, person.end_s, person)
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
    if person.people is not None:
        observers = tuple(partial(_of_person, person.number, observe) for observe in observers)

    def judge(frame: RecordedFrame, estimate: Estimate, tracker: Tracker) -> None:
        qualities.setdefault(estimate.person or 0, Quality())(frame, estimate, tracker)

    with recording.open() as source:
        early = source.first.remarks
        print_remarks(early)
        crowd, span = None, (start_s, person.end_s)
        if person.people is not None:
            several = source, bodies, request.config, person.people or None
            bodies = seen_people(*several, request.seed, *span)
            crowd = Crowd(tuple(bodies), person.people or None)
        else:
            bodies = [seen_person(source, bodies[0], request.config, request.seed, *span)]
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
                request.legs,
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
        distance: of the person at first, statures; None if it is not known.
    """

    pitch_rad: float
    recording: RecordingRequest
    stddev_rad: float = math.radians(2.0)
    distance: float | None = None


def placed(
    recording: RecordingRequest,
    start_s: float = 0.0,
    end_s: float = math.inf,
    person: PersonRequest | None = None,
) -> Placement:
    """Return the camera's pitch and roll, and say what was found, or contradicts what is given.

    They are found from a person and the edges of the room in the whole span, if the recording is
    read with a detector; else the pitch is 0.

    Args:
        recording: the recording.
        start_s: seconds from the start of the recording.
        end_s: the same.
        person: what is given of the person and of the pitch; None for nothing.

    Raises:
        CardboxError: the recording cannot be read, or the detector cannot be loaded.
    """
    from cardbox_tracker.recordings.standing import recorded_camera

    detector, camera = recording.detector, recording.camera
    given_rad = None
    if person is not None and person.is_pitch_given:
        given_rad = person.body.camera_pose.pitch_rad
    if detector is None:
        return Placement(given_rad or 0.0, recording)
    name = recording.cameras[0] if recording.cameras else None
    stature_m = None if person is None else person.stature_m
    shown = recorded_camera(
        recording.path, detector, camera, name, stature_m, given_rad, start_s, end_s
    )
    tilt, roll_rad = shown.camera.pitch_rad, shown.camera.roll_rad.mean
    pitch, deviation = math.degrees(tilt.mean), math.degrees(tilt.stddev)
    number = f"{abs(pitch):.0f} degrees {'down' if pitch >= 0 else 'up'}"
    number += f" (standard deviation {deviation:.0f})"
    remarks = []
    if given_rad is None and shown.sources:
        remarks.append(
            f"camera pitch {number}, found from {' and '.join(shown.sources)}; give "
            "--camera-pitch-deg if it is known"
        )
    elif given_rad is None:
        remarks.append(
            "nobody stands upright and no edges of the room are upright, so the camera's pitch is "
            f"taken as that of most cameras, {number}; give --camera-pitch-deg if it is known"
        )
    remarks += shown.remarks
    if roll_rad and camera.roll_rad is None and len(recording.cameras) < 2:
        remarks.append(
            f"camera roll {math.degrees(roll_rad):.1f} degrees, found in the same way: the "
            "images are turned back; give --camera-roll-deg 0 to leave them as they are"
        )
        recording = replace(recording, camera=replace(camera, roll_rad=roll_rad))
    print_remarks(remarks)
    distance = None if math.isnan(shown.distances[0]) else shown.distances[0]
    if given_rad is not None:
        return Placement(given_rad, recording, distance=distance)
    return Placement(tilt.mean, recording, tilt.stddev, distance)
