"""The observation of one camera at one time: the input of the tracker."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from cardbox_tracker.detection.image_points import ImagePoints
from cardbox_tracker.estimation.cost.terms import DepthImage, Image, Silhouette


@dataclass(frozen=True, eq=False)
class Observation:
    """The data of one camera at one time.

    An observation without a silhouette stands for a camera without data at this time.

    The tracker converts arrays of other types, or refuses them with a ValueError; see
    :mod:`cardbox_tracker.vision.given_arrays`.

    Attributes:
        silhouette: (H, W), 0 or 255, of the camera's size, or a mask of another numeric type; None
            if there is none.
        image: (H, W) grey or (H, W, 3) bgr of the same time, for terms that use it.
        depth_m: (H, W), metres along the optical axis, for the term ``Depth``; unknown depths are
            not above 0 or not finite. Only the depth image of the first camera is used.
        stamp_ns: time of the data, ns; None if it is unknown.
        points: the person's joints in the image, from a detector; None without one.
    """

    silhouette: Silhouette | None = None
    image: Image | None = None
    depth_m: DepthImage | None = None
    stamp_ns: int | None = None
    points: ImagePoints | None = None


Observations = Sequence[Observation | None]
"""One observation for each camera, the first camera first; None for a camera without data."""


def stamp_of(observations: Observations) -> int | None:
    """Return the common stamp of the observations, ns; None if no stamp is known.

    This is the stamp of the first camera, or else the earliest stamp of the further cameras.
    """
    first, *others = (None if one is None else one.stamp_ns for one in observations)
    if first is not None:
        return first
    return min((stamp_ns for stamp_ns in others if stamp_ns is not None), default=None)
