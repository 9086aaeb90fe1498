"""The silhouette's term: pixels in which model and silhouette differ (paper, equation (2)).

    W(d, I_t) = sum over x, y of h(x, y, d) XOR f(x, y, I_t)

Only the rows above the hips count: a model of the upper body has no legs. The middle of
the hips never moves up or down, so the first row below it is a constant of body and camera.

:class:`SilhouetteTerm` is what all its implementations share. The tracker uses the compiled one in
:mod:`cardbox_tracker.estimation.cost.compiled`; ``experiments/reference.py`` does just what the
equation says.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

import cv2
import numpy as np

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.cost.terms import Frame, Image, Silhouette, TermObservation
from cardbox_tracker.vision.camera import Camera


class SilhouetteObservation(TermObservation):
    """One silhouette.

    Torsos are rated by the patches of torso, waist and head, drawn together with the given arms;
    arms with the trunk and that one arm drawn; whole postures with all patches.
    """

    frame: Frame

    @abstractmethod
    def overlap(self, posture: FloatArray) -> tuple[int, float]:
        """Return equation (2), px, and the IoU of one posture (12,) with all patches drawn."""


class SilhouetteTerm(ABC):
    """Base of all implementations of the silhouette's term."""

    def __init__(self, body: BodyModel, camera: Camera) -> None:
        """Prepare for one body before one camera, pitched as it stands."""
        self.body, self.camera = body, camera
        self.rows = rows_above_hips(body, camera)

    def frame(self, silhouette: Silhouette, image: Image | None = None) -> Frame:
        """Return a frame for this and all other terms.

        Args:
            silhouette: (H, W), 0 or 255.
            image: (H, W) grey or (H, W, 3) bgr of the same moment, or None.

        Raises:
            ValueError: ``silhouette`` or ``image`` has not the camera's size.
        """
        for name, pixels in (("silhouette", silhouette), ("image", image)):
            size = (self.camera.height, self.camera.width)
            if pixels is not None and (
                pixels.shape[:2] != size or pixels.ndim > (2 if name == "silhouette" else 3)
            ):
                raise ValueError(f"{name} has shape {pixels.shape}; the camera's is {size}")
        upper = np.ascontiguousarray(silhouette[: self.rows])
        return Frame(silhouette, self.rows, cv2.countNonZero(upper), image)

    @abstractmethod
    def observe(self, frame: Frame) -> SilhouetteObservation:
        """See :class:`~cardbox_tracker.estimation.cost.terms.Term`."""

    def look(self, silhouette: Silhouette) -> SilhouetteObservation:
        """Observe a silhouette (H, W) by itself.

        Raises:
            ValueError: it has not the camera's size.
        """
        return self.observe(self.frame(silhouette))


def rows_above_hips(body: BodyModel, camera: Camera) -> int:
    """Return the number of rows of the image, from its top, above the hips.

    The hips' row is taken where the torso stands; at the image's edges a pitched camera would see
    the same height in the same row as well, since it turns about the rows' direction only.
    """
    placement = body.placement
    hip = camera.reference_to_optical(
        np.array([-placement.distance_m, 0.0, placement.hip_height_m])
    )
    if hip[2] <= 0:
        return camera.height
    return int(np.clip(np.ceil(camera.project(hip)[1]), 1, camera.height))
