"""The scene of a recording, measured in all of it before its first image is tracked."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from cardbox_tracker.measuring.first_sight import upper_body
from cardbox_tracker.measuring.seen_body import MOST_SIGHTS, SeenBody
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.recordings.recording import Recording
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from cardbox_tracker.search.config import TrackerConfig
from cardbox_tracker.tracking.people import People


class SpreadFrames:
    """A few frames spread evenly over however many there are.

    Attributes:
        frames: at least half of the number asked for, if there were so many.
    """

    def __init__(self, most: int) -> None:
        """Keep up to ``most`` frames."""
        self._most, self._every, self._seen = most, 1, 0
        self.frames: list[RecordedFrame] = []

    def add(self, frame: RecordedFrame) -> None:
        """Take the next frame."""
        if self._seen % self._every == 0:
            self.frames.append(frame)
        self._seen += 1
        if len(self.frames) > self._most:
            del self.frames[1::2]
            self._every *= 2


def seen_person(
    recording: Recording,
    guess: BodyModel,
    config: TrackerConfig,
    seed: int,
    start_s: float = 0.0,
    end_s: float = math.inf,
) -> BodyModel:
    """Return the body of the person whom the first camera sees.

    Args:
        recording: an open recording.
        guess: body with ``unknown`` values; without any it is returned.
        config: settings of the tracker.
        seed: random seed of the fits.
        start_s: seconds from the start of the recording from which on the person is tracked.
        end_s: the same until when.
    """
    if not guess.unknown:
        return guess
    spread = SpreadFrames(MOST_SIGHTS)
    for taken in recording.frames(start_s, end_s):
        frame = taken.first
        if upper_body(frame.silhouette, _is_detected(frame)) is not None:
            spread.add(frame._replace(recorded=None))
    camera = recording.first.camera.with_pitch(guess.camera_pose.pitch_rad)
    seen = SeenBody(guess, camera, config, np.random.default_rng(seed), pause_s=0.0)
    for frame in spread.frames:
        seen.see(frame.silhouette, frame.image, frame.time_s, _is_detected(frame))
    return seen.body


def _is_detected(frame: RecordedFrame) -> bool:
    return frame.points is not None and frame.points.are_certain


def seen_people(
    recording: Recording,
    guesses: Sequence[BodyModel],
    config: TrackerConfig,
    most: int | None,
    seed: int,
    start_s: float = 0.0,
    end_s: float = math.inf,
) -> list[BodyModel]:
    """Return the bodies of several people, who are tracked once to tell them apart.

    Args:
        recording: an open recording.
        guesses: see :class:`~cardbox_tracker.tracking.people.People`.
        config: settings of the trackers.
        most: number of people; None for all who come.
        seed: random seed.
        start_s: seconds from the start of the recording from which on they are tracked.
        end_s: the same until when.
    """
    rng = np.random.default_rng(seed)
    people = People(guesses, recording.first.camera, config, rng, most)
    for taken in recording.frames(start_s, end_s):
        people.track(taken.observations[0], taken.people)
    return [tracker.body for tracker in people.trackers] or list(guesses)
