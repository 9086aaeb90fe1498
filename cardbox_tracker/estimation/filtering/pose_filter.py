"""What a tracker asks of the filter that follows a posture."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import numpy as np

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.config import TrackerConfig
from cardbox_tracker.estimation.cost.silhouette import SilhouetteTerm
from cardbox_tracker.estimation.cost.terms import Frame, Term
from cardbox_tracker.estimation.cost.view import View
from cardbox_tracker.estimation.filtering.particles import Particles


class Presence(Enum):
    """Whether a silhouette can be a person, by its size."""

    NOBODY = "too few foreground pixels"
    PERSON = "a person"
    TOO_MUCH = "more foreground than a person can be"


def presence_of(share: float, smallest: float, largest: float) -> Presence:
    """Return what a silhouette is whose pixels are this share of the model's from the front."""
    if share < smallest:
        return Presence.NOBODY
    return Presence.TOO_MUCH if share > largest else Presence.PERSON


@dataclass(frozen=True)
class Fit:
    """What a filter has found in a frame.

    Attributes:
        posture: d1..d12, (12,), rad and metres.
        posture_stddev: standard deviations, (12,).
        keypoints_m: shoulder, elbow, hand of the left, then the right arm, (6, 3), metres in the
            optical frame.
        cost_px: pixels in which the drawn posture and the silhouette differ.
        iou: their intersection over union.
        is_uncertain: the posture may be wrong.
        is_poor: it does not fit; several such frames in a row mean that the person was lost.
        seen: what explains the image best, before the learned correction: (14,), or (12,) without
            an offset.
        seen_iou: as ``iou``, of that.
        offset_m: ``torso_x`` and ``torso_z``, (2,), or None.
        offset_stddev_m: their standard deviations, (2,), or None.
        particles: of whole states, or None from a filter that has none.
    """

    posture: FloatArray
    posture_stddev: FloatArray
    keypoints_m: FloatArray
    cost_px: int
    iou: float
    is_uncertain: bool
    is_poor: bool
    seen: FloatArray
    seen_iou: float
    offset_m: FloatArray | None = None
    offset_stddev_m: FloatArray | None = None
    particles: Particles | None = None

    @property
    def is_finite(self) -> bool:
        """False if any of the values is not a finite number."""
        values = (self.posture, self.posture_stddev, self.keypoints_m, self.iou)
        return all(
            value is None or bool(np.isfinite(value).all())
            for value in (*values, self.offset_m, self.offset_stddev_m)
        )


class PoseFilter(Protocol):
    """Follows one person from frame to frame."""

    def look(self, frames: Sequence[Frame]) -> Presence:
        """Take the frames of all cameras of one time; say whether they can show a person."""

    def follow(self, frames: Sequence[Frame], terms: Sequence[Sequence[Term]]) -> Fit:
        """Find the posture in the frames looked at last.

        Without a person before, it starts around the front reference posture.

        Args:
            frames: of the first camera, then of the further ones.
            terms: of each camera's cost, beside that of the silhouette.
        """

    def ious(self) -> list[float | None]:
        """Return how well the last result covers each camera's silhouette of that frame.

        Intersection over union; None of a camera that saw nobody, or before the first result.
        """

    def forget(self) -> None:
        """Start again with the next frame that is followed: the person has left."""

    def recover(self) -> None:
        """Search widely from the next frame on: the person is there, but nothing fits."""

    def configure(self, config: TrackerConfig) -> None:
        """Use other settings, of which none restarts."""


MakeFilter = Callable[
    [TrackerConfig, SilhouetteTerm, np.random.Generator, Sequence[View]], PoseFilter
]
"""Takes settings, the silhouette's term, which has body and first camera, the source of random
numbers, and how the further cameras see the body; returns a new filter."""
