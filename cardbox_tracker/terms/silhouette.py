"""The silhouette's term: pixels in which model and silhouette differ (paper, equation (2)).

    W(d, I_t) = sum over x, y of h(x, y, d) XOR f(x, y, I_t)

Only the rows above the hips count, because the model has no legs. Mid-hip has a constant height, so
the first row below it depends only on body and camera.

:class:`SilhouetteTerm` is the base of all implementations. The tracker uses the compiled one,
:mod:`cardbox_tracker.terms.compiled`; ``lab/experiments/reference.py`` implements the
equation literally.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

import cv2
import numpy as np

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.given_arrays import image_from, silhouette_from
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.terms.term import ArmCosts, Frame, Image, Silhouette, TorsoCosts


class SilhouetteObservation(ABC):
    """One silhouette, as the paper's hierarchical filter rates it: torsos, then arms beside one.

    The first call of the first two methods computes what all particles share.
    """

    frame: Frame

    @abstractmethod
    def torsos_beside(self, arms: FloatArray | None) -> TorsoCosts:
        """Return what rates torsos d1..d4; arms of ``arms`` (12,), if any, stay."""

    @abstractmethod
    def arms_beside(self, torso: FloatArray) -> ArmCosts:
        """Return the function that rates arms beside the torso (4,): trunk and arm are drawn."""

    @abstractmethod
    def postures(self, postures: FloatArray) -> FloatArray:
        """Return the costs (N,) of postures (N, 12) with all patches drawn, px."""

    @abstractmethod
    def overlap(self, posture: FloatArray) -> tuple[int, float]:
        """Return equation (2), px, and the IoU of one posture (12,) with all patches drawn."""


class SilhouetteTerm(ABC):
    """Base of all implementations of the silhouette's term."""

    def __init__(self, body: BodyModel, camera: Camera) -> None:
        """Prepare for one body and one camera, which gets the pitch of the body model."""
        self.body, self.camera = body, camera
        self.rows = rows_above_hips(body, camera)

    def frame(self, silhouette: Silhouette, image: Image | None = None) -> Frame:
        """Return a frame of a silhouette (H, W), 0 or 255, and image, or raise ValueError."""
        size = self.camera.height, self.camera.width
        silhouette = silhouette_from(silhouette, size=size)
        if image is not None:
            image = image_from(image, size=size)
        upper = np.ascontiguousarray(silhouette[: self.rows])
        channels = {"silhouette": silhouette} | ({} if image is None else {"image": image})
        return Frame(self.camera, channels, self.rows, cv2.countNonZero(upper))

    @abstractmethod
    def observe(self, frame: Frame) -> SilhouetteObservation:
        """See :class:`~cardbox_tracker.terms.term.Term`."""

    def look(self, silhouette: Silhouette) -> SilhouetteObservation:
        """Observe a silhouette (H, W) without further data; ValueError for another size."""
        return self.observe(self.frame(silhouette))


def rows_above_hips(body: BodyModel, camera: Camera) -> int:
    """Return the number of image rows above the hips.

    Points of one height and level depth lie in one row also for a pitched camera, because the pitch
    is a rotation about the direction of the rows.
    """
    placement = body.placement
    hip = camera.reference_to_optical(
        np.array([-placement.distance_m, 0.0, placement.hip_height_m])
    )
    if hip[2] <= 0:
        return camera.height
    return int(np.clip(np.ceil(camera.project(hip)[1]), 1, camera.height))
