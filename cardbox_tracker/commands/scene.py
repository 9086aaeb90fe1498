"""The scene of a recording as it is given and found, for the subcommands that need it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from itertools import zip_longest
from statistics import median
from typing import NamedTuple

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.commands.arguments import print_remarks
from cardbox_tracker.commands.tracking_request import PersonRequest, TrackingRequest
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.detectors.person_choice import Chosen, PersonChoice
from cardbox_tracker.measuring.people_camera import (
    PITCH_PRIOR,
    USUAL_PITCH,
    Distances,
    Sightings,
    people_camera,
)
from cardbox_tracker.measuring.scene import FOUND, GIVEN, USUAL, Scene, SceneCamera, Value
from cardbox_tracker.measuring.scene_camera import (
    Background,
    FoundCamera,
    camera_moves,
    degrees_of,
    in_scene,
    lens_of,
    other_lens,
    scene_camera,
)
from cardbox_tracker.person.model import FOUND_STDDEV, PLACE, BodyModel
from cardbox_tracker.person.parts import body_parts
from cardbox_tracker.person.proportions import USUAL_STATURE_M, USUAL_STDDEV_M, stature_of
from cardbox_tracker.recordings.measured_scene import (
    Watched,
    lens_in,
    seen_people,
    seen_person,
    turns_in,
    watch,
)
from cardbox_tracker.recordings.recording import Recording, RecordingRequest
from cardbox_tracker.recordings.silhouettes import TimeSpan
from cardbox_tracker.tracking.place import distance_of_points, shoulders_m

# Relative difference of the distances of a person who stands where the scene has them, seconds in
# which they stand there, and deviations beyond which people contradict a scene.
_SAME_PLACE, _SAME_S, _CONTRADICTS = 0.15, 1.5, 3.0
# Deviations of the camera's height by the floor that decide between a lens and a place.
_SURE = 2.0


class MeasuredScene(NamedTuple):
    """An open recording and its scene."""

    source: Recording
    scene: Scene
    chosen: Chosen | None  #: who is chosen of several people, if there is a choice
    remarks: Sequence[str] = ()  #: what was found, or contradicts what is given


@contextmanager
def measured_scene(request: TrackingRequest) -> Iterator[MeasuredScene]:
    """Open a recording whose scene is measured, in all of it, before it is tracked.

    A roll that is found turns the images back, unless one is given. Raises CardboxError if the
    recording cannot be read, the detector cannot be loaded, or nobody can be chosen.
    """
    recording, person = request.recording, request.person
    with ExitStack() as stack:

        def opened(asked: RecordingRequest) -> Recording:
            stack.close()
            return stack.enter_context(asked.open())

        if person.scene is not None:
            yield _again(opened(recording), request, person.scene)
        elif person.model is not None and not person.body.unknown:
            standing = recording.camera.standing(person.body.camera_pose.roll_rad)
            recording = replace(recording, camera=standing)
            yield _known(opened(recording), recording, person)
        else:
            yield _found(opened, request)


def _known(source: Recording, recording: RecordingRequest, person: PersonRequest) -> MeasuredScene:
    """Return the scene of a body model that has its place."""
    chosen, tilt = None, person.body.camera_pose
    pitch = Value(tilt.pitch_rad, tilt.pitch_stddev_rad, GIVEN)
    roll = Value(recording.camera.stands_rad, 0.0, GIVEN)
    camera = SceneCamera(lens_of(source.first.camera), pitch, roll)
    if person.choice is not None:
        chosen = _checked(watch(source, person.start_s, person.end_s, person.choice).chosen)
    return MeasuredScene(source, _scene(camera, source, _standing(recording, person)), chosen)


def _found(
    opened: Callable[[RecordingRequest], Recording], request: TrackingRequest
) -> MeasuredScene:
    """Return the scene that people and the room show, of a recording opened as these show it."""
    recording, person = request.recording, request.person
    span, choice, remarks = (person.start_s, person.end_s), person.choice, list[str]()
    source = opened(recording)
    watched, background, lens = watch(source, *span, choice), None, None
    if recording.shows_turns:
        camera = source.first.camera
        moves = camera_moves(watched.people, watched.pictures, camera)
        if moves and lens_of(camera).origin == USUAL:
            lens = lens_in(source, *span)
        if lens is not None:
            recording = replace(recording, camera=recording.camera.seeing(lens.mean, lens.stddev))
            source = opened(recording)
            remarks.append(_found_lens(lens))
        turns = turns_in(source, watched, *span) if moves else None
        background = Background(moves)
        if turns is not None:
            recording = replace(recording, turned=turns[0])
            source = opened(recording)
            choice = choice and turns[0].placed(choice)
            watched, background = watch(source, *span, choice), Background(edges=turns[1])
            remarks.append(turns[0].remark)
    found = found_camera(recording, person, watched, source.first.camera, background)
    if lens is not None:
        # Turned images are wider than those in which it was found.
        shown = found.camera.fov_rad._replace(origin=lens.origin, by=lens.by)
        found = found._replace(camera=found.camera._replace(fov_rad=shown))
    better = _corrected(recording, found.camera)
    if better is not recording:
        source = opened(better)
        watched = watch(source, *span, choice)
    longest, stature_m = _longest(found), person.stature_m or USUAL_STATURE_M
    far = longest and longest._replace(distances=longest.distances * stature_m)
    guesses = [*_bodies(_standing(better, person), person, found)]
    bodies = _seen(source, watched, guesses, request, far)
    scene = _scene(found.camera, source, bodies)
    return MeasuredScene(source, scene, watched.chosen, [*remarks, *found.remarks])


def _seen(
    source: Recording,
    watched: Watched,
    guesses: Sequence[BodyModel],
    request: TrackingRequest,
    far: Distances | None = None,
) -> list[BodyModel]:
    """Return the bodies of those who were watched, or of who is chosen of them."""
    person, chosen = request.person, _checked(watched.chosen)
    most, only = (person.people, None) if chosen is None else (0, chosen.number)
    if most is None:
        known = source.first.camera, request.config, request.seed
        return [seen_person(watched, guesses[0], *known, far)]
    given = request.config, most, request.seed, person.start_s, person.end_s
    return seen_people(source, guesses, *given, only)


def _checked(chosen: Chosen | None) -> Chosen | None:
    """Return who is chosen; raise CardboxError if nobody is seen."""
    if chosen is not None and chosen.number is None:
        raise CardboxError(
            "the detector finds nobody to choose with --person; give @T a second at which the "
            "person is in view, or leave --person out"
        )
    return chosen


def _scene(camera: SceneCamera, source: Recording, bodies: Sequence[BodyModel]) -> Scene:
    """Return the scene of a camera, with what tells its field of view."""
    by = camera.fov_rad.by or source.first.calibration.told_by
    return Scene(camera._replace(fov_rad=camera.fov_rad._replace(by=by)), tuple(bodies))


def _standing(recording: RecordingRequest, person: PersonRequest) -> list[BodyModel]:
    """Return the bodies before a camera that is rolled as the recording's is."""
    roll_rad = recording.camera.stands_rad
    return [body.with_values(camera_roll_rad=roll_rad) for body in (person.body, *person.others)]


def _again(source: Recording, request: TrackingRequest, scene: Scene) -> MeasuredScene:
    """Return a given scene with people where they stand; nobody is sure if they contradict it."""
    person, camera = request.person, source.first.camera
    watched = watch(source, person.start_s, person.end_s, person.choice)
    bodies, remarks = _standing(request.recording, person), list[str]()
    if wrong := _contradiction(watched, bodies, scene.camera, camera):
        remarks.append(f"{person.model}: {wrong}")
        bodies = _doubted(bodies, scene)
    guesses = [body.with_values(unknown=tuple({*PLACE, *body.unknown})) for body in bodies]
    placed, chosen = _seen(source, watched, guesses, request), watched.chosen
    if chosen is not None and chosen.number is not None:
        bodies = [bodies[min(chosen.number, len(bodies)) - 1]]
    # The tracker begins at the place of the scene, and goes on from there.
    kept = [
        body if body is not None and _is_near(body, there) else there
        for body, there in zip_longest(bodies[: len(placed)], placed)
    ]
    # Who is who is not known, and one whom the detector lost is several people.
    longest = max(map(len, watched.people), default=0)
    people = [sights for sights in watched.people if len(sights) > longest / 2] or [[]]
    aways = list[float]()
    for body, there in zip(bodies, placed, strict=False):
        if not body.unknown:
            shown = ([_away(body, there), *_by_points(one, body, camera)] for one in people)
            aways.append(min(map(median, shown), key=abs))
    away = max(aways, key=abs, default=0.0)
    if not wrong and abs(away) >= _SAME_PLACE:
        seen = watched.people, _statures_m(watched, bodies), camera
        by_floor = other_lens(*seen, scene.camera, away)
        words = f"somebody is {math.exp(away):.2f} times as far away as in the scene"
        if by_floor > _SURE:
            remarks.append(
                f"{person.model}: {words}, and by the floor it is of another lens or person, so "
                "every posture is at best uncertain; leave --scene out"
            )
            kept = _doubted(kept, scene)
        elif by_floor > -_SURE:
            remarks.append(
                f"{person.model}: {words}: they stand elsewhere, or it is of another lens or "
                "person, so places are uncertain; give --fov and --stature in place of --scene"
            )
            unsure = math.hypot(camera.focal_stddev, away)
            source.first.camera = replace(camera, focal_stddev=unsure)
    return MeasuredScene(source, Scene(scene.camera, tuple(kept)), chosen, remarks)


def _doubted(bodies: Sequence[BodyModel], scene: Scene) -> list[BodyModel]:
    """Return bodies of whom nothing is sure."""
    doubt = {"camera_contradiction": "people contradict the given scene"}
    unsure = math.hypot(scene.camera.pitch_rad.stddev, FOUND_STDDEV)
    return [body.with_values(pitch_stddev_rad=unsure, **doubt) for body in bodies]


def _away(body: BodyModel, there: BodyModel) -> float:
    """Return the logarithm of how much farther a body is seen; 0 if that is not known."""
    if body.unknown or "distance_m" in there.unknown:
        return 0.0
    return math.log(there.placement.distance_m / body.placement.distance_m)


def _by_points(sights: Sightings, body: BodyModel, camera: Camera) -> Iterator[float]:
    """Yield the logarithms of how much farther points show a body: of levels, and in space.

    An outline of broad parts hardly shows a body whose bones have the wrong length.
    """
    stature_m, pitch_rad = stature_of(body_parts(body.sizes)), body.camera_pose.pitch_rad
    shown = people_camera([sights], [stature_m], camera, (pitch_rad, 1e-3), (0.0, 1e-3))
    if shown is not None and (far := shown.distances[0]) is not None:
        early = far.distances[far.times_s <= far.times_s[0] + _SAME_S]
        yield math.log(median(early) * stature_m / body.placement.distance_m)
    seen = (points for time_s, points in sights if time_s <= sights[0][0] + _SAME_S)
    found_m = (distance_of_points(points, body, camera) for points in seen)
    if known_m := [one for one in found_m if one is not None and one > 0.0]:
        yield math.log(median(known_m) / shoulders_m(body, pitch_rad))


def _is_near(body: BodyModel, there: BodyModel) -> bool:
    """Return whether a body that is wholly known is where it is seen, or is not seen."""
    return not body.unknown and abs(_away(body, there)) < _SAME_PLACE


def _statures_m(watched: Watched, bodies: Sequence[BodyModel]) -> list[float]:
    """Return the stature of each person who was watched; further ones have that of the last."""
    statures_m = [stature_of(body_parts(body.sizes)) for body in bodies]
    people = len(watched.people)
    return [*statures_m, *statures_m[-1:] * people][:people]


def _contradiction(
    watched: Watched, bodies: Sequence[BodyModel], given: SceneCamera, camera: Camera
) -> str:
    """Return what people and edges of the room show of the camera if it is not the given one."""
    if not watched.people:
        return ""
    statures_m = _statures_m(watched, bodies)
    found = scene_camera(watched.people, watched.pictures, camera, statures_m, None, 0.0).camera
    shown, lens, more = [(given.pitch_rad, found.pitch_rad)], lens_of(camera), ""
    if lens.origin == GIVEN:
        shown.append((given.fov_rad, lens))
        fovs_deg = (math.degrees(one.mean) for one in (lens, given.fov_rad))
        more = ", a field of view of {:.0f} degrees, not {:.0f}".format(*fovs_deg)
    if given.height_m is not None and found.height_m is not None:
        shown.append((given.height_m, found.height_m))
        more += f" and a height of {found.height_m.mean:.2f} m, not {given.height_m.mean:.2f}"
    # Independent sources; what nothing shows contradicts nothing.
    apart = [
        (one.mean - other.mean) / math.hypot(one.stddev, other.stddev)
        for one, other in shown
        if other.origin != USUAL
    ]
    if math.hypot(*apart) <= _CONTRADICTS:
        return ""
    return (
        f"the scene has a camera pitch of {degrees_of(given.pitch_rad)}, and people and the room "
        f"show {degrees_of(found.pitch_rad)}{more}: it is of another camera, lens or person, "
        "so every posture is at best uncertain; leave --scene out"
    )


def _bodies(
    bodies: Sequence[BodyModel], person: PersonRequest, found: FoundCamera
) -> Iterator[BodyModel]:
    """Yield the bodies with what was found of the camera and of the first person's distance."""
    far = _longest(found) if person.people is None else None
    for body in bodies:
        stature_m = person.stature_m or USUAL_STATURE_M
        body = in_scene(body, found.camera, far, stature_m, found.moves)
        if person.stature_m is None and person.model is None:
            body = body.with_values(stature_stddev=USUAL_STDDEV_M / USUAL_STATURE_M)
        yield body


def _longest(found: FoundCamera) -> Distances | None:
    """Return the distances of who is tracked: one whom the detector lost is several people."""
    shown = [one for one in found.distances if one is not None]
    return max(shown, key=lambda one: len(one.times_s), default=None)


def _corrected(recording: RecordingRequest, found: SceneCamera) -> RecordingRequest:
    """Return the recording with roll and field of view that were found and are not given."""
    given = recording.camera
    if len(recording.cameras) > 1 or recording.films:
        return recording
    if given.roll_rad is None and found.roll_rad.mean:
        given = replace(given, roll_rad=found.roll_rad.mean)
    fov = found.fov_rad
    if not given.is_calibrated and fov.origin == FOUND:
        given = given.seeing(fov.mean, fov.stddev)
    return recording if given == recording.camera else replace(recording, camera=given)


def found_camera(
    recording: RecordingRequest,
    person: PersonRequest,
    watched: Watched,
    camera: Camera,
    background: Background | None = None,
) -> FoundCamera:
    """Return the camera of a recording; ``background`` is that of :func:`.scene_camera`."""
    people = watched.people
    statures_m = [*person.statures_m, *[person.stature_m] * len(people)][: len(people)]
    tilt = person.body.camera_pose
    given = (tilt.pitch_rad, tilt.pitch_stddev_rad) if person.is_pitch_given else None
    if recording.detector is None and recording.points is None:
        level = (
            "nothing tells the camera's pitch without a detector: a level camera is assumed, "
            "so leans are uncertain; give --camera-pitch-deg (0 for a level camera)"
        )
        usual = Value(0.0, math.hypot(USUAL_PITCH, PITCH_PRIOR), USUAL)
        pitch = Value(*given, GIVEN) if given else usual
        assumed = SceneCamera(lens_of(camera), pitch, Value(0.0, 0.0, USUAL))
        return FoundCamera(assumed, remarks=() if given else (level,))
    # Images are turned back by a roll that is given.
    roll_rad = None if recording.camera.roll_rad is None else 0.0
    distance_m = None
    if "distance_m" not in person.body.unknown and person.model is None:
        distance_m = person.body.placement.distance_m
    seen = people, watched.pictures, camera, statures_m, given, roll_rad, distance_m
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
    better.camera.check()
    if better.camera.roll_rad != recording.camera.roll_rad:
        remarks.append(
            f"camera roll {math.degrees(found.camera.roll_rad.mean):.1f} degrees, found in the "
            "same way: the images are turned back; give --camera-roll-deg 0 to leave them as they "
            "are"
        )
    if better.camera.fov_deg != recording.camera.fov_deg:
        remarks.append(_found_lens(found.camera.fov_rad))
    return found._replace(remarks=tuple(remarks))


def _found_lens(fov_rad: Value) -> str:
    return (
        f"field of view {math.degrees(fov_rad.mean):.0f} degrees across the image, found from "
        f"{fov_rad.by}; give --fov if it is known"
    )


def tilt_in(
    recording: RecordingRequest, span: TimeSpan, choice: PersonChoice | None = None
) -> tuple[float, RecordingRequest]:
    """Return the pitch, rad, by the images of a span, and the recording with the roll by them."""
    with recording.open() as source:
        person = PersonRequest(BodyModel(), None, span.start_s, is_pitch_given=False)
        camera = source.first.camera
        found = found_camera(recording, person, watch(source, *span, choice), camera)
    print_remarks(found.remarks)
    return found.camera.pitch_rad.mean, _corrected(recording, found.camera)
