"""The scene of a recording, measured in all of it before its first image is tracked."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.view import OtherCamera
from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.detectors.person_choice import Chosen, PersonChoice
from cardbox_tracker.measuring.camera_turns import follow_turns, turning_lens
from cardbox_tracker.measuring.first_sight import upper_body
from cardbox_tracker.measuring.people_camera import Distances
from cardbox_tracker.measuring.room_edges import edge_likelihoods
from cardbox_tracker.measuring.scene import FOUND, Value
from cardbox_tracker.measuring.scene_camera import Picture, lens_of
from cardbox_tracker.measuring.scene_watch import MOST_PICTURES, Spread
from cardbox_tracker.measuring.seen_body import MOST_SIGHTS, SeenBody
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.recordings.films import Person, assign
from cardbox_tracker.recordings.recording import FrameSet, Recording, observation_of
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from cardbox_tracker.recordings.turned_back import Turned
from cardbox_tracker.search.config import TrackerConfig
from cardbox_tracker.tracking.session import Session

# Most images by which the lens of a camera that turns is found.
_MOST_TURNED = 40


class Watched(NamedTuple):
    """What the first camera of a recording shows in all of it, or in the longest shot of a film."""

    frames: Sequence[RecordedFrame]  #: some with a whole upper body, for the sizes of one person
    pictures: Sequence[Picture]  #: times, s, and some images as they were recorded, undistorted
    #: times, s, and points of each person whom a detector finds, or of the one who is chosen.
    people: Sequence[Sequence[tuple[float, ImagePoints]]]
    chosen: Chosen | None = None  #: who is chosen; None without a choice


def watch(
    recording: Recording,
    start_s: float = 0.0,
    end_s: float = math.inf,
    choice: PersonChoice | None = None,
) -> Watched:
    """Read a recording from ``start_s`` to ``end_s``, seconds from its start.

    From then on, its frames have small images alone. ``choice`` is of one of several people.
    """
    for source in recording.sources:
        source.keep_images()
    session = told_apart(recording.first.camera, recording.others)
    chosen = None if choice is None else Chosen(choice.scaled(*recording.first.scale))
    shot = longest = _Shot()
    for taken in recording.frames(start_s, end_s):
        frame = taken.first
        if frame.is_cut:
            shot = _Shot()
        shot.images += 1
        if shot.images > longest.images:
            longest = shot
        if taken.frames[0] is not None:
            # Further cameras may be the only ones that have an image.
            shot.frames.add(partial(_whole, frame))
            shot.pictures.add(partial(_picture, taken))
        if chosen is None:
            assign(shot.people, frame, taken.time_s)
            continue
        session.track(taken.observations)
        shown = session.shown()
        chosen.see(taken.time_s, {number: one.pixels for number, one in shown.items()})
        for number, one in shown.items():
            if one.points is not None:
                shot.numbered[number].append((taken.time_s, one.points))
    for source in recording.sources:
        source.has_pictures = False
    people = [one.seen for one in longest.people]
    if chosen is not None and chosen.number in longest.numbered:
        people = [longest.numbered[chosen.number]]
    return Watched(longest.frames.items, longest.pictures.items, people, chosen)


def told_apart(camera: Camera, others: Sequence[OtherCamera] = ()) -> Session:
    """Return a session that tells people apart whom a detector finds, and tracks nobody."""
    return Session([BodyModel()], camera, others=others, people=0, only_measures=True)


def frames_of(
    choice: PersonChoice, frames: Sequence[RecordedFrame], camera: Camera
) -> list[RecordedFrame]:
    """Return the frames that show who is chosen, px of frames, with their silhouette alone."""
    session, chosen = told_apart(camera), Chosen(choice)
    own: list[dict[int, RecordedFrame]] = []
    for frame in frames:
        session.track(observation_of(frame))
        shown = session.shown()
        chosen.see(frame.time_s, {number: one.pixels for number, one in shown.items()})
        seen = ((number, session.silhouette_of(number)) for number in shown)
        own.append({n: frame._replace(silhouette=one) for n, one in seen if one is not None})
    return [one[chosen.number] for one in own if chosen.number in one]


@dataclass
class _Shot:
    """What a film shows between two cuts."""

    images: int = 0
    frames: Spread[RecordedFrame] = field(default_factory=lambda: Spread(MOST_SIGHTS))
    pictures: Spread[Picture] = field(default_factory=lambda: Spread(MOST_PICTURES))
    people: list[Person] = field(default_factory=list)
    numbered: dict[int, list[tuple[float, ImagePoints]]] = field(
        default_factory=lambda: defaultdict(list)
    )


def lens_in(recording: Recording, start_s: float = 0.0, end_s: float = math.inf) -> Value | None:
    """Return the field of view, rad, by how the camera of a recording turns, if that shows it."""
    frames = Spread[tuple[NDArray[np.uint8], NDArray[np.uint8]]](_MOST_TURNED)
    for taken in recording.frames(start_s, end_s):
        frames.add(partial(_shown, taken.first))
    found = turning_lens(frames.items, recording.first.camera)
    if found is None:
        return None
    return lens_of(recording.first.camera, Value(*found, FOUND, "the turns of the camera"))


def turns_in(
    recording: Recording, watched: Watched, start_s: float = 0.0, end_s: float = math.inf
) -> tuple[Turned, FloatArray] | None:
    """Return how the camera of a recording that was watched turns; None if it is not known.

    Beside it are the :func:`.edge_likelihoods` of its first image, by the pictures of all.
    """
    camera, lens = recording.first.camera, recording.first.calibration
    stamps_ns = dict[float, int]()

    def seen() -> Iterator[tuple[int, NDArray[np.uint8], NDArray[np.uint8]]]:
        for taken in recording.frames(start_s, end_s):
            stamp_ns, time_s, image, silhouette, *_ = taken.first
            stamps_ns[time_s] = stamp_ns
            yield stamp_ns, image, silhouette

    found = follow_turns(seen(), camera)
    if found is None:
        return None
    turns = [(found.rotations.get(stamps_ns[time_s]), one) for time_s, one in watched.pictures]
    known = [(turn, one) for turn, one in turns if turn is not None]
    edges = edge_likelihoods([one for _, one in known], camera, [turn for turn, _ in known])
    return Turned(found, (camera.width, camera.height), lens), edges


def _shown(frame: RecordedFrame) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    return frame.image, frame.silhouette


def _whole(frame: RecordedFrame) -> RecordedFrame | None:
    is_detected = frame.points is not None and frame.points.are_certain
    seen = upper_body(frame.silhouette, is_detected, frame.covered)
    return None if seen is None else frame._replace(recorded=None)


def _picture(taken: FrameSet) -> Picture:
    assert taken.picture is not None
    return taken.time_s, taken.picture()


def seen_person(
    watched: Watched,
    guess: BodyModel,
    camera: Camera,
    config: TrackerConfig,
    seed: int,
    far: Distances | None = None,
) -> BodyModel:
    """Return the body of the person who was watched by the working ``camera`` of the frames.

    A ``guess`` without ``unknown`` values is returned; ``seed`` is that of the fits. The distances
    ``far``, in metres here, correct the scale of the body.
    """
    if not guess.unknown:
        return guess
    camera = camera.with_pitch(guess.camera_pose.pitch_rad)
    seen = SeenBody(guess, camera, config, np.random.default_rng(seed), pause_s=0.0)
    for frame in watched.frames:
        seen.see(frame.silhouette, frame.image, frame.time_s, frame.points)
    return seen.in_film(far)


def seen_people(
    recording: Recording,
    guesses: Sequence[BodyModel],
    config: TrackerConfig,
    most: int,
    seed: int,
    start_s: float = 0.0,
    end_s: float = math.inf,
    only: int | None = None,
) -> list[BodyModel]:
    """Return the bodies of several people; who are not detected are tracked to tell them apart.

    ``guesses`` are those of a :class:`~cardbox_tracker.tracking.session.Session`, and ``most`` is
    the number of people, 0 for all who come. They are tracked from ``start_s`` to ``end_s``,
    seconds from the start of the recording. ``only`` is the number of one whose body is returned.
    """
    rng = np.random.default_rng(seed)
    given = guesses, recording.first.camera, config, rng, recording.others, most
    # One camera's points tell who is who, but regions and other cameras need postures.
    is_enough = recording.first.has_points and not recording.others
    session = Session(*given, only_measures=is_enough, only=only)
    for taken in recording.frames(start_s, end_s):
        session.track(taken.observations)
    bodies = [replace(tracker.body, version=0, stamp_ns=0) for tracker in session.trackers]
    return bodies or list(guesses)
