"""Interface between the tracker and its particle filter, and a person's presence in images."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from math import isfinite
from typing import Protocol

import numpy as np

from cardbox_tracker.camera.view import View
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.search.config import TrackerConfig
from cardbox_tracker.search.doubt import SETTLED_FRAMES, Judgement
from cardbox_tracker.search.particles import Particles
from cardbox_tracker.search.whole_body_config import WholeBodyConfig
from cardbox_tracker.terms.multi_view import MultiViewCost
from cardbox_tracker.terms.silhouette import SilhouetteTerm
from cardbox_tracker.terms.term import Frame, Term


class Presence(Enum):
    """Whether a silhouette can be a person, by its size."""

    NOBODY = "too few foreground pixels"
    PERSON = "a person"
    TOO_MUCH = "more foreground than a person can be"


@dataclass(frozen=True)
class Fit:
    """The result of a filter in a frame."""

    posture: FloatArray  #: d1..d12, (12,), rad and metres
    posture_stddev: FloatArray  #: standard deviations, (12,)
    #: shoulder, elbow, hand of the left, then the right arm, (6, 3), metres in the optical frame.
    keypoints_m: FloatArray
    cost_px: int  #: pixels in which the drawn posture and the silhouette differ
    iou: float  #: intersection over union of drawn posture and silhouette
    #: whether it does not fit; several such frames in a row mean that the person is lost.
    is_poor: bool
    offset_m: FloatArray | None = None  #: ``torso_x`` and ``torso_z``, (2,), or None
    offset_stddev_m: FloatArray | None = None  #: standard deviations of ``offset_m``, (2,), or None
    particles: Particles | None = None  #: particles of whole states; None if the filter has none
    judged: Judgement | None = None  #: the doubt about the result; None if the filter has none

    @property
    def is_finite(self) -> bool:
        """Whether all values are finite."""
        values = self.posture, self.posture_stddev, self.keypoints_m.ravel()
        chances = None if self.judged is None else self.judged.chances
        others = self.offset_m, self.offset_stddev_m, chances
        # A sum is only finite if all summands are; for few numbers, Python adds them fastest.
        total = self.iou
        for value in (*values, *others):
            total += 0.0 if value is None else sum(value.tolist())
        return isfinite(total)


class PoseFilter(Protocol):
    """A filter that tracks one person over frames."""

    def look(self, frames: Sequence[Frame]) -> Presence:
        """Set the frames of all cameras; return whether they can show a person."""

    def follow(self, frames: Sequence[Frame], terms: Sequence[Sequence[Term]]) -> Fit:
        """Estimate the posture in the frames of the last :meth:`look`, anew around the front."""

    def ious(self) -> list[float | None]:
        """Return the IoU of the last result in each camera; None where there was none."""

    def forget(self) -> None:
        """Start a new search with the next frame, because the person has left."""

    def recover(self) -> None:
        """Widen the search from the next frame on, because the person is lost."""

    def configure(self, config: TrackerConfig) -> None:
        """Use other settings; settings that restart tracking are the same."""


MakeFilter = Callable[
    [TrackerConfig, SilhouetteTerm, np.random.Generator, Sequence[View]], PoseFilter
]
"""Takes settings, the silhouette's term with body and first camera, the source of random numbers,
and the views of the further cameras; returns a new filter."""


FULL = 0.8
"""Share of the image above the hips, or of what the arms reach, that no person fills."""
# Factor on the foreground by which it decreases only if the person is elsewhere.
_SUDDEN = 4


class PersonPresence:
    """The presence of the person in the images of all cameras."""

    def __init__(self, cost: MultiViewCost, config: WholeBodyConfig) -> None:
        """Prepare for the cameras of ``cost``."""
        self._cost = cost
        self._limits = config.smallest_person, config.largest_person
        self.forget()

    def forget(self) -> None:
        """Forget the last frames."""
        self._too_much = self._foreground_px = 0
        self._is_sudden = False

    @property
    def is_elsewhere(self) -> bool:
        """Whether the person must be sought anew.

        There has been too much foreground for so long that it is a near person, or most of the
        foreground of somebody who seemed near, such as noise in the whole image, is gone.
        """
        return self._is_too_long_too_much or self._is_sudden

    @property
    def _is_too_long_too_much(self) -> bool:
        # The background model would have learned another light by then.
        return self._too_much > SETTLED_FRAMES

    def see(self, frames: Sequence[Frame], near: FloatArray) -> tuple[Presence, list[int]]:
        """Return the presence, and the indices of the cameras that show the person.

        The cost has the silhouettes of ``frames``; ``near`` (14,) is the state of the last frame.
        """
        found, (smallest, largest) = list[Presence](), self._limits
        # The area where the model is largest, and where it is smallest, as shares of its own.
        for (low, high), frame in zip(self._cost.shares(near), frames, strict=True):
            is_detected = frame.points is not None and frame.points.are_certain
            # Others may hide nearly all of a person whose joints are seen.
            is_hidden = is_detected and frame["covered"] is not None
            # Whom a detector finds may be smaller, and a spoilt silhouette does no harm.
            if high < smallest and not (is_detected and high > 0.0) and not is_hidden:
                found.append(Presence.NOBODY)
            else:
                is_more = low > largest and not is_detected
                found.append(Presence.TOO_MUCH if is_more else Presence.PERSON)
        self._too_much = self._too_much + 1 if Presence.TOO_MUCH in found else 0
        if self._is_too_long_too_much:
            found = [
                Presence.PERSON if one is Presence.TOO_MUCH and not _is_full(frame) else one
                for one, frame in zip(found, frames, strict=True)
            ]
        seeing = [number for number, one in enumerate(found) if one is Presence.PERSON]
        if seeing:
            now_px, before_px = sum(f.foreground_px for f in frames), self._foreground_px
            is_covered = any(frame["covered"] is not None for frame in frames)
            self._is_sudden = before_px > _SUDDEN * now_px and not is_covered
            self._foreground_px = now_px
            return Presence.PERSON, seeing
        return (Presence.TOO_MUCH if Presence.TOO_MUCH in found else Presence.NOBODY), seeing


def _is_full(frame: Frame) -> bool:
    return frame.foreground_px > FULL * frame.rows * frame.camera.width
