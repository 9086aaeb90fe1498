"""The scene of a recording as it is given and found, for the subcommands that need it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.commands.arguments import print_remarks
from cardbox_tracker.commands.tracking_request import PersonRequest
from cardbox_tracker.measuring.people_camera import PITCH_PRIOR, USUAL_PITCH
from cardbox_tracker.measuring.scene import FOUND, GIVEN, USUAL, Scene, SceneCamera, Value
from cardbox_tracker.measuring.scene_camera import (
    Background,
    FoundCamera,
    camera_moves,
    degrees_of,
    in_scene,
    lens_of,
    scene_camera,
)
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.proportions import USUAL_STATURE_M, USUAL_STDDEV_M
from cardbox_tracker.recordings.measured_scene import (
    Watched,
    seen_people,
    seen_person,
    turns_in,
    watch,
)
from cardbox_tracker.recordings.recording import Recording, RecordingRequest
from cardbox_tracker.recordings.silhouettes import TimeSpan
from cardbox_tracker.search.config import TrackerConfig


@contextmanager
def measured_scene(
    recording: RecordingRequest, person: PersonRequest, config: TrackerConfig, seed: int
) -> Iterator[tuple[Recording, Scene]]:
    """Open a recording whose scene is measured, in all of it, before it is tracked.

    A roll that is found turns the images back, unless one is given. Raises CardboxError if the
    recording cannot be read, or the detector cannot be loaded.
    """
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
        background = None
        if recording.shows_turns:
            moves = camera_moves(watched.people, watched.pictures, first.camera)
            turns = turns_in(source, watched, *span) if moves else None
            background = Background(moves)
            if turns is not None:
                stack.close()
                recording = recording.turned_back(turns[0])
                source = stack.enter_context(recording.open())
                watched, first = watch(source, *span), source.first
                background = Background(edges=turns[1])
                print_remarks([turns[0].remark])
        found = found_camera(recording, person, watched, first.camera, background)
        better = _corrected(recording, found.camera)
        if better is not recording:
            stack.close()
            source = stack.enter_context(better.open())
            watched, first = watch(source, *span), source.first
        stands = {"camera_roll_rad": better.camera.stands_rad}
        bodies = [body.with_values(**stands) for body in _bodies(bodies, person, found)]
        if person.people is None:
            shown = [one for one in found.distances if one is not None]
            # One person whom the detector lost is several; the longest is surely who is tracked.
            longest = max(shown, key=lambda one: len(one.times_s), default=None)
            stature_m = person.stature_m or USUAL_STATURE_M
            far = longest and longest._replace(distances=longest.distances * stature_m)
            bodies = [seen_person(watched, bodies[0], first.camera, config, seed, far)]
        else:
            bodies = seen_people(source, bodies, config, person.people, seed, *span)
        yield source, Scene(found.camera, tuple(bodies))


def _bodies(
    bodies: Sequence[BodyModel], person: PersonRequest, found: FoundCamera
) -> Iterator[BodyModel]:
    """Yield the bodies with what was found of the camera and of the first person's distance."""
    far = found.distances[0] if found.distances and person.people is None else None
    for body in bodies:
        body = in_scene(body, found.camera, far, person.stature_m or USUAL_STATURE_M)
        if person.stature_m is None and person.model is None:
            body = body.with_values(stature_stddev=USUAL_STDDEV_M / USUAL_STATURE_M)
        yield body


def _corrected(recording: RecordingRequest, found: SceneCamera) -> RecordingRequest:
    """Return the recording with roll and field of view that were found and are not given."""
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
    recording: RecordingRequest,
    person: PersonRequest,
    watched: Watched,
    camera: Camera,
    background: Background | None = None,
) -> FoundCamera:
    """Return the camera of a recording, and say what was found, or contradicts what is given.

    ``background`` is that of :func:`.scene_camera`.
    """
    people = watched.people
    statures_m = [*person.statures_m, *[person.stature_m] * len(people)][: len(people)]
    tilt = person.body.camera_pose
    given = (tilt.pitch_rad, tilt.pitch_stddev_rad) if person.is_pitch_given else None
    if recording.detector is None and recording.points is None:
        pitch = Value(0.0, math.hypot(USUAL_PITCH, PITCH_PRIOR), USUAL)
        if given is None:
            level = (
                "nothing tells the camera's pitch without a detector: a level camera is assumed, "
                "so leans are uncertain; give --camera-pitch-deg (0 for a level camera)"
            )
            print_remarks([level])
        else:
            pitch = Value(*given, GIVEN)
        return FoundCamera(SceneCamera(lens_of(camera), pitch, Value(0.0, 0.0, USUAL)))
    # Images are turned back by a roll that is given.
    roll_rad = None if recording.camera.roll_rad is None else 0.0
    seen = people, watched.pictures, camera, statures_m, given, roll_rad
    found = scene_camera(*seen, background)
    number, shown_by = degrees_of(found.camera.pitch_rad), " and ".join(found.sources)
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
    with recording.open() as source:
        person = PersonRequest(BodyModel(), None, span.start_s, is_pitch_given=False)
        camera = source.first.camera
        found = found_camera(recording, person, watch(source, *span), camera).camera
    return found.pitch_rad.mean, _corrected(recording, found)
