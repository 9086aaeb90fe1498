"""Interface between the tracker and its particle filter."""

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
from cardbox_tracker.search.doubt import Judgement
from cardbox_tracker.search.particles import Particles
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
        """Estimate the posture in the frames of the last :meth:`look`, by the cameras' terms.

        A new search starts around the front reference posture.
        """

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
