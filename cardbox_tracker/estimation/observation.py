"""What one camera saw at one time: the input of the tracker."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from cardbox_tracker.estimation.cost.terms import DepthImage, Image, Silhouette


@dataclass(frozen=True, eq=False)
class Observation:
    """What one camera saw at one time; 2D keypoints of a detector belong here, too.

    An observation without a silhouette is one of a camera that is silent.

    Attributes:
        silhouette: (H, W), 0 or 255, of the camera's size; None where the camera has none.
        image: (H, W) grey or (H, W, 3) bgr of the same time, for terms that use it.
        depth_m: (H, W), metres along the optical axis, for the term ``Depth``; not finite or 0
            where it is not known. Only that of the first camera counts.
        stamp_ns: when it was taken, ns; None where that is not known.
    """

    silhouette: Silhouette | None = None
    image: Image | None = None
    depth_m: DepthImage | None = None
    stamp_ns: int | None = None


Observations = Sequence[Observation | None]
"""Of the first camera, then of the further ones; None of a camera that is silent."""


def stamp_of(observations: Observations) -> int | None:
    """Return the stamp of what the cameras saw together, ns; None where none is known.

    It is the first camera's; without that, the earliest of the others.
    """
    first, *others = (None if one is None else one.stamp_ns for one in observations)
    if first is not None:
        return first
    return min((stamp_ns for stamp_ns in others if stamp_ns is not None), default=None)
