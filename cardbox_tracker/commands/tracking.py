"""Tracking of one recording, for the subcommands that track."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from cardbox_tracker.commands.arguments import print_remarks
from cardbox_tracker.common.files import body_of_person

if TYPE_CHECKING:
    from cardbox_tracker.camera.camera import Camera
    from cardbox_tracker.commands.request import PersonRequest, RecordingRequest, TrackingRequest
    from cardbox_tracker.measuring.scene import Scene, SceneCamera
    from cardbox_tracker.measuring.scene_camera import FoundCamera
    from cardbox_tracker.person.model import BodyModel
    from cardbox_tracker.recordings.measured_scene import Watched
    from cardbox_tracker.recordings.recording import Recording
    from cardbox_tracker.recordings.silhouettes import RecordedFrame, TimeSpan
    from cardbox_tracker.recordings.track import Observer, TrackSummary
    from cardbox_tracker.search.config import TrackerConfig
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
    from cardbox_tracker.measuring.scene import save_scene
    from cardbox_tracker.person.model_file import save_body_model
    from cardbox_tracker.recordings.quality import Quality
    from cardbox_tracker.recordings.track import track_recording

    qualities: dict[int, Quality] = {}
    recording, person = request.recording, request.person
    start_s = person.start_s
    if person.model is not None and person.body.doubt:
        print(f"{person.model}: {person.body.doubt}")
    if person.people is not None:
        observers = tuple(partial(_of_person, person.number, observe) for observe in observers)

    def judge(frame: RecordedFrame, estimate: Estimate, tracker: Tracker) -> None:
        qualities.setdefault(estimate.person or 0, Quality())(frame, estimate, tracker)

    with measured_scene(recording, person, request.config, request.seed) as (source, scene):
        early = source.first.remarks
        print_remarks(_with_unknown(early, person))
        total_s = max(1e-9, min(source.first.duration_s, person.end_s) - start_s)
        with ExitStack() as stack:
            observers = (*_writers(request, source, stack), *observers)
            if show is None:
                observers = (*observers, judge)
            advance = show or stack.enter_context(progress_bar("track"))
            summary = track_recording(
                source,
                scene.people,
                request.config,
                request.seed,
                start_s,
                request.files.table,
                (*observers, lambda frame, *_: advance((frame.time_s - start_s) / total_s)),
                person.end_s,
                person.people,
                None if request.hands is None else HandNetwork(request.hands),
            )
        remarks = [remark for remark in source.first.remarks if remark not in early]
        accounts = tuple(one.account for one in source.sources)
        assumptions = tuple(_assumptions(request, scene))
    summary = replace(summary, accounts=accounts, assumptions=assumptions, scene=scene.numbers())
    if show is None and not summary.people:
        print(f"tracked {summary.frames_tracked} of {summary.frames} images")
    print_remarks(remarks, summary.remarks)
    if show is None:
        print(f"assumed: {', '.join(summary.assumptions)}")
        unseen = 0
        for number, quality in sorted(qualities.items()):
            if number and not summary.people[number].frames_tracked:
                unseen += 1
                continue
            if number:
                one = summary.people[number]
                print(f"person {number}: tracked {one.frames_tracked} of {one.frames} images")
            print(*quality.lines(), sep="\n")
        if unseen:
            print(f"{unseen} more, of {len(summary.people)} people, in no image")
        if summary.used_text:
            print(summary.used_text)
    for number, one in (summary.people or {1: summary}).items():
        if request.files.body is not None and one.body is not None:
            save_body_model(one.body, body_of_person(request.files.body, number))
    if request.files.scene is not None:
        save_scene(scene, request.files.scene)
    one = summary.people.get(person.number, summary)
    names = "remarks", "accounts", "assumptions", "scene", "people"
    return replace(one, **{name: getattr(summary, name) for name in names})


def _with_unknown(remarks: Sequence[str], person: PersonRequest) -> list[str]:
    """Return remarks with one on an unknown stature, which also tells of an unknown lens."""
    from cardbox_tracker.person.proportions import USUAL_STATURE_M
    from cardbox_tracker.recordings.given_camera import FOV_HINT, UNKNOWN_LENS

    if person.stature_m is not None or person.model is not None:
        return [*remarks]
    others = [remark for remark in remarks if not remark.startswith(UNKNOWN_LENS)]
    if len(others) == len(remarks):
        return [
            f"the stature is taken as that of most adults, {USUAL_STATURE_M:g} m, so sizes and "
            "distances may be wrong by a tenth; give --stature M",
            *others,
        ]
    return [
        f"stature and field of view are unknown ({USUAL_STATURE_M:g} m and those of most cameras "
        "are assumed), so distances may be wrong by half, and sizes by a tenth; give --stature M "
        f"and --fov DEG ({FOV_HINT}); times, and mostly angles, are right all the same",
        *others,
    ]


def _of_person(
    number: int, observe: Observer, frame: RecordedFrame, estimate: Estimate, tracker: Tracker
) -> None:
    """Pass on the results of one of several people."""
    if estimate.person == number:
        observe(frame, estimate, tracker)


def _assumptions(request: TrackingRequest, scene: Scene) -> Iterator[str]:
    """Yield camera, place and stature with where they are from."""
    from cardbox_tracker.person.proportions import USUAL_STATURE_M

    person = request.person
    yield from scene.words()
    source = "given" if person.model is None else f"from {person.model.name}"
    distance = "found" if "distance_m" in person.body.unknown else source
    for number, body in enumerate(scene.people, 1):
        whose = "" if person.people is None else f" of person {number}"
        yield f"distance{whose} {body.placement.distance_m:.2f} m ({distance})"
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


@contextmanager
def measured_scene(
    recording: RecordingRequest, person: PersonRequest, config: TrackerConfig, seed: int
) -> Iterator[tuple[Recording, Scene]]:
    """Open a recording whose scene is measured, in all of it, before it is tracked.

    A roll that is found turns the images back, unless one is given.

    Args:
        recording: what is read.
        person: who is tracked, and what is given of them and of the camera.
        config: settings of the tracker.
        seed: random seed of the fits.

    Raises:
        CardboxError: the recording cannot be read, or the detector cannot be loaded.
    """
    from cardbox_tracker.measuring.scene import GIVEN, Scene, SceneCamera, Value
    from cardbox_tracker.measuring.scene_camera import lens_of
    from cardbox_tracker.recordings.measured_scene import seen_people, seen_person, watch

    if person.model is not None and not person.body.unknown:
        roll_rad = person.body.camera_pose.roll_rad
        recording = replace(recording, camera=recording.camera.standing(roll_rad))
    with ExitStack() as stack:
        source = stack.enter_context(recording.open())
        span = person.start_s, person.end_s
        bodies, first = [person.body, *person.others], source.first
        tilt = person.body.camera_pose
        if person.model is not None and not person.body.unknown:
            pitch = Value(tilt.pitch_rad, tilt.pitch_stddev_rad, GIVEN)
            roll_rad = recording.camera.stands_rad
            camera = SceneCamera(lens_of(first.camera), pitch, Value(roll_rad, 0.0, GIVEN))
            bodies = [body.with_values(camera_roll_rad=roll_rad) for body in bodies]
            yield source, Scene(camera, tuple(bodies))
            return
        watched = watch(source, *span)
        found = found_camera(recording, person, watched, first.camera)
        better = _corrected(recording, found.camera)
        if better is not recording:
            stack.close()
            source = stack.enter_context(better.open())
            watched, first = watch(source, *span), source.first
        stands = {"camera_roll_rad": better.camera.stands_rad}
        bodies = [body.with_values(**stands) for body in _bodies(bodies, person, found)]
        if person.people is None:
            bodies = [seen_person(watched, bodies[0], first.camera, config, seed)]
        else:
            bodies = seen_people(source, bodies, config, person.people, seed, *span)
        yield source, Scene(found.camera, tuple(bodies))


def _bodies(
    bodies: Sequence[BodyModel], person: PersonRequest, found: FoundCamera
) -> Iterator[BodyModel]:
    """Yield the bodies with what was found of the camera and of the first person's distance."""
    from cardbox_tracker.person.model import PLACEMENT
    from cardbox_tracker.person.proportions import USUAL_STATURE_M, USUAL_STDDEV_M

    pitch = found.camera.pitch_rad
    for body in bodies:
        body = body.with_values(camera_pitch_rad=pitch.mean, pitch_stddev_rad=pitch.stddev)
        if (height := found.camera.height_m) is not None:
            above = {"camera_height_m": height.mean, "height_stddev_m": height.stddev}
            body = body.with_values(**above)
        distance = found.distances[0] if found.distances else math.nan
        is_alone = person.people is None and math.isfinite(distance)
        if is_alone and "distance_m" in body.unknown:
            lowest_m, highest_m, *_ = PLACEMENT["distance_m"]
            distance_m = distance * (person.stature_m or USUAL_STATURE_M)
            body = body.with_values(distance_m=min(max(distance_m, lowest_m), highest_m))
        if person.stature_m is None and person.model is None:
            body = body.with_values(stature_stddev=USUAL_STDDEV_M / USUAL_STATURE_M)
        yield body


def _corrected(recording: RecordingRequest, found: SceneCamera) -> RecordingRequest:
    """Return the recording with roll and field of view that were found and are not given."""
    from cardbox_tracker.measuring.scene import FOUND

    given = recording.camera
    if len(recording.cameras) > 1:
        return recording
    if given.roll_rad is None and found.roll_rad.mean:
        given = replace(given, roll_rad=found.roll_rad.mean)
    fov = found.fov_rad
    if not given.is_calibrated and fov.origin == FOUND:
        focal_stddev = fov.stddev / math.sin(fov.mean)
        given = replace(given, fov_deg=math.degrees(fov.mean), focal_stddev=focal_stddev)
    return recording if given == recording.camera else replace(recording, camera=given)


def found_camera(
    recording: RecordingRequest, person: PersonRequest, watched: Watched, camera: Camera
) -> FoundCamera:
    """Return the camera of a recording, and say what was found, or contradicts what is given."""
    from cardbox_tracker.measuring.people_camera import PITCH_PRIOR, USUAL_PITCH
    from cardbox_tracker.measuring.scene import GIVEN, USUAL, SceneCamera, Value
    from cardbox_tracker.measuring.scene_camera import FoundCamera, lens_of, scene_camera

    people = watched.people
    statures_m = [*person.statures_m, *[person.stature_m] * len(people)][: len(people)]
    tilt = person.body.camera_pose
    given = (tilt.pitch_rad, tilt.pitch_stddev_rad) if person.is_pitch_given else None
    if recording.detector is None and recording.points is None:
        pitch = Value(0.0, math.hypot(USUAL_PITCH, PITCH_PRIOR), USUAL)
        if given is None:
            print_remarks(
                [
                    "nothing tells the camera's pitch without a detector: a level camera is "
                    "assumed, so every posture is at best uncertain; give --camera-pitch-deg "
                    "(0 for a level camera)"
                ]
            )
        else:
            pitch = Value(*given, GIVEN)
        return FoundCamera(SceneCamera(lens_of(camera), pitch, Value(0.0, 0.0, USUAL)))
    # Images are turned back by a roll that is given.
    roll_rad = None if recording.camera.roll_rad is None else 0.0
    found = scene_camera(people, watched.pictures, camera, statures_m, given, roll_rad)
    pitch, shown_by = found.camera.pitch_rad, " and ".join(found.sources)
    degrees, deviation = math.degrees(pitch.mean), math.degrees(pitch.stddev)
    number = f"{abs(degrees):.0f} degrees {'down' if degrees >= 0 else 'up'}"
    number += f" (standard deviation {deviation:.0f})"
    remarks = list(found.remarks)
    if given is None and found.sources:
        remarks.append(
            f"camera pitch {number}, found from {shown_by}; give --camera-pitch-deg if it is known"
        )
    elif given is None:
        remarks.append(
            "neither people nor edges of the room show the camera's pitch surely, so it is mostly "
            f"that of most cameras, {number}; give --camera-pitch-deg (0 for a level camera)"
        )
    better = _corrected(recording, found.camera)
    if better.camera.roll_rad != recording.camera.roll_rad:
        remarks.append(
            f"camera roll {math.degrees(found.camera.roll_rad.mean):.1f} degrees, found in the "
            "same way: the images are turned back; give --camera-roll-deg 0 to leave them as they "
            "are"
        )
    if better.camera.fov_deg != recording.camera.fov_deg:
        remarks.append(
            f"field of view {better.camera.fov_deg:.0f} degrees across the image, found from "
            "people who walk; give --fov if it is known"
        )
    print_remarks(remarks)
    return found


def tilt_in(recording: RecordingRequest, span: TimeSpan) -> tuple[float, RecordingRequest]:
    """Return the pitch, rad, by the images of a span, and the recording with the roll by them."""
    from cardbox_tracker.commands.request import PersonRequest
    from cardbox_tracker.person.model import BodyModel
    from cardbox_tracker.recordings.measured_scene import watch

    with recording.open() as source:
        person = PersonRequest(BodyModel(), None, span.start_s, is_pitch_given=False)
        camera = source.first.camera
        found = found_camera(recording, person, watch(source, *span), camera).camera
    return found.pitch_rad.mean, _corrected(recording, found)
