"""The scene of a recording, measured in all of it before its first image is tracked."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.detectors.figure import Figure, figure_of_points
from cardbox_tracker.detectors.identity import (
    GONE_NS,
    cheapest,
    colours_in,
    learned,
    unlike,
)
from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.measuring.camera_turns import follow_turns
from cardbox_tracker.measuring.first_sight import upper_body
from cardbox_tracker.measuring.people_camera import Distances
from cardbox_tracker.measuring.room_edges import edge_likelihoods
from cardbox_tracker.measuring.scene_camera import Picture
from cardbox_tracker.measuring.scene_watch import MOST_PICTURES, Spread
from cardbox_tracker.measuring.seen_body import MOST_SIGHTS, SeenBody
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.recordings.recording import FrameSet, Recording
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from cardbox_tracker.recordings.turned_back import Turned
from cardbox_tracker.search.config import TrackerConfig
from cardbox_tracker.tracking.session import Session


class Watched(NamedTuple):
    """What the first camera of a recording shows in all of it."""

    frames: Sequence[RecordedFrame]  #: some with a whole upper body, for the sizes of one person
    pictures: Sequence[Picture]  #: times, s, and some images as they were recorded, undistorted
    #: times, s, and points of each person whom a detector finds.
    people: Sequence[Sequence[tuple[float, ImagePoints]]]


def watch(recording: Recording, start_s: float = 0.0, end_s: float = math.inf) -> Watched:
    """Read a recording from ``start_s`` to ``end_s``, seconds from its start.

    From then on, its frames have small images alone.
    """
    for source in recording.sources:
        source.keep_images()
    frames, pictures = Spread[RecordedFrame](MOST_SIGHTS), Spread[Picture](MOST_PICTURES)
    people: list[_Person] = []
    for taken in recording.frames(start_s, end_s):
        frame = taken.first
        frames.add(partial(_whole, frame))
        pictures.add(partial(_picture, taken))
        _assign(people, frame, taken.time_s)
    for source in recording.sources:
        source.has_pictures = False
    return Watched(frames.items, pictures.items, [one.seen for one in people])


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


def _whole(frame: RecordedFrame) -> RecordedFrame | None:
    seen = upper_body(frame.silhouette, _is_detected(frame))
    return None if seen is None else frame._replace(recorded=None)


def _picture(taken: FrameSet) -> Picture:
    assert taken.picture is not None
    return taken.time_s, taken.picture()


@dataclass
class _Person:
    """Somebody whom a detector sees in a recording: points so far, last figure, colours."""

    figure: Figure | None = None
    colours: FloatArray | None = None
    seen: list[tuple[float, ImagePoints]] = field(default_factory=list)


def _assign(people: list[_Person], frame: RecordedFrame, time_s: float) -> None:
    """Add the points in a frame to the people who they are by place and colours, or to new ones."""
    shown = list[tuple[ImagePoints, Figure, FloatArray | None]]()
    for points in frame.people if frame.people is not None else (frame.points,):
        if points is not None:
            figure = figure_of_points(points)
            trunk = figure.trunk(frame.silhouette.shape) & frame.silhouette
            shown.append((points, figure, colours_in(frame.image, trunk)))
    # Who was away for longer may be somebody else with the same clothes.
    known = [(one, round(1e9 * (time_s - one.seen[-1][0]))) for one in people]
    known = [(one, away_ns) for one, away_ns in known if 0 < away_ns <= GONE_NS]
    costs = [
        [unlike(one.figure, one.colours, figure, their, ns) for _, figure, their in shown]
        for one, ns in known
    ]
    found = {column: known[row][0] for row, column in cheapest(costs).items()}
    for column, (points, figure, colours) in enumerate(shown):
        if column not in found:
            people.append(_Person())
        person = found.get(column, people[-1])
        person.seen.append((time_s, points))
        person.figure = figure
        if colours is not None:
            person.colours = learned(person.colours, colours)


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
        seen.see(frame.silhouette, frame.image, frame.time_s, _is_detected(frame))
    return seen.in_film(far)


def _is_detected(frame: RecordedFrame) -> bool:
    return frame.points is not None and frame.points.are_certain


def seen_people(
    recording: Recording,
    guesses: Sequence[BodyModel],
    config: TrackerConfig,
    most: int,
    seed: int,
    start_s: float = 0.0,
    end_s: float = math.inf,
) -> list[BodyModel]:
    """Return the bodies of several people; who are not detected are tracked to tell them apart.

    ``guesses`` are those of a :class:`~cardbox_tracker.tracking.session.Session`, and ``most`` is
    the number of people, 0 for all who come. They are tracked from ``start_s`` to ``end_s``,
    seconds from the start of the recording.
    """
    rng = np.random.default_rng(seed)
    given = guesses, recording.first.camera, config, rng, recording.others, most
    # One camera's points tell who is who, but regions and other cameras need postures.
    is_enough = recording.first.has_points and not recording.others
    session = Session(*given, only_measures=is_enough)
    for taken in recording.frames(start_s, end_s):
        session.track(taken.observations)
    bodies = [replace(tracker.body, version=0, stamp_ns=0) for tracker in session.trackers]
    return bodies or list(guesses)
