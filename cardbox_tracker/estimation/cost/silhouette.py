"""The silhouette's term: pixels in which model and silhouette differ (paper, equation (2)).

    W(d, I_t) = sum over x, y of h(x, y, d) XOR f(x, y, I_t)

Only the rows above the hips count, because the model has no legs. Mid-hip has a constant height, so
the first row below it depends only on body and camera.

:class:`SilhouetteTerm` is the base of all implementations. :class:`ReferenceSilhouette` implements
the equation literally. The tracker uses the compiled implementation,
:mod:`cardbox_tracker.estimation.cost.compiled`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.cardbox import (
    LEFT_ARM_PATCHES,
    RIGHT_ARM_PATCHES,
    TORSO_PATCHES,
    cardbox_patches,
)
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import N_JOINTS, TORSO
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.cost.terms import (
    ARMS,
    ArmCosts,
    Frame,
    Image,
    Silhouette,
    TermObservation,
    TorsoCosts,
)
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.rasterisation import render

_ARM_PATCHES = {"left": LEFT_ARM_PATCHES, "right": RIGHT_ARM_PATCHES}
_BOTH_ARMS = slice(LEFT_ARM_PATCHES.start, RIGHT_ARM_PATCHES.stop)


class SilhouetteObservation(TermObservation):
    """One silhouette.

    For torsos, the patches of torso, waist and head are drawn together with the given arms; for
    arms, the trunk and this arm are drawn; for whole postures, all patches are drawn.
    """

    frame: Frame

    @abstractmethod
    def overlap(self, posture: FloatArray) -> tuple[int, float]:
        """Return equation (2), px, and the IoU of one posture (12,) with all patches drawn."""


class SilhouetteTerm(ABC):
    """Base of all implementations of the silhouette's term."""

    def __init__(self, body: BodyModel, camera: Camera) -> None:
        """Prepare for one body and one camera, which gets the pitch of the body model."""
        self.body, self.camera = body, camera
        self.rows = rows_above_hips(body, camera)

    def frame(
        self,
        silhouette: Silhouette,
        image: Image | None = None,
        posture: FloatArray | None = None,
    ) -> Frame:
        """Return a frame for this and all other terms.

        Args:
            silhouette: (H, W), 0 or 255.
            image: (H, W) grey or (H, W, 3) bgr of the same time, or None.
            posture: state of the previous frame, or None.

        Raises:
            ValueError: the size of ``silhouette`` or ``image`` is not the camera's.
        """
        for name, pixels in (("silhouette", silhouette), ("image", image)):
            size = (self.camera.height, self.camera.width)
            if pixels is not None and (
                pixels.shape[:2] != size or pixels.ndim > (2 if name == "silhouette" else 3)
            ):
                raise ValueError(f"{name} has shape {pixels.shape}; the camera's is {size}")
        upper = np.ascontiguousarray(silhouette[: self.rows])
        return Frame(silhouette, self.rows, cv2.countNonZero(upper), image, posture)

    @abstractmethod
    def observe(self, frame: Frame) -> SilhouetteObservation:
        """See :class:`~cardbox_tracker.estimation.cost.terms.Term`."""

    def look(self, silhouette: Silhouette) -> SilhouetteObservation:
        """Observe a silhouette (H, W) without further data.

        Raises:
            ValueError: its size is not the camera's.
        """
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


class ReferenceSilhouette(SilhouetteTerm):
    """Literal implementation of equation (2): draw the model, XOR with the silhouette, count."""

    def observe(self, frame: Frame) -> ReferenceObservation:
        """See :class:`SilhouetteTerm`."""
        return ReferenceObservation(frame, self.body, self.camera)

    def draw(self, posture: FloatArray) -> NDArray[np.uint8]:
        """Return the drawn model (rows, W) in ``posture`` (12,), 0 or 255."""
        return render(cardbox_patches(self.body, posture), self.camera, self.rows)


@dataclass(frozen=True)
class ReferenceObservation(SilhouetteObservation):
    """One silhouette, which is compared with drawn models pixel by pixel."""

    frame: Frame
    body: BodyModel
    camera: Camera

    def torsos_beside(self, arms: FloatArray | None) -> TorsoCosts:
        """See :class:`SilhouetteObservation`."""
        fixed = np.zeros((0, 4, 3))
        if arms is not None:
            fixed = cardbox_patches(self.body, arms)[_BOTH_ARMS]

        def costs(torsos: FloatArray) -> FloatArray:
            postures = np.zeros((len(torsos), N_JOINTS))
            postures[:, TORSO] = torsos
            return self._costs(postures, (TORSO_PATCHES,), fixed)

        return costs

    def arms_beside(self, torso: FloatArray) -> ArmCosts:
        """See :class:`SilhouetteObservation`."""

        def costs(side: str, arms: FloatArray) -> FloatArray:
            postures = np.zeros((len(arms), N_JOINTS))
            postures[:, TORSO] = torso
            postures[:, ARMS[side]] = arms
            return self._costs(postures, (TORSO_PATCHES, _ARM_PATCHES[side]))

        return costs

    def postures(self, postures: FloatArray) -> FloatArray:
        """See :class:`SilhouetteObservation`."""
        return self._costs(np.asarray(postures), (slice(None),))

    def overlap(self, posture: FloatArray) -> tuple[int, float]:
        """See :class:`SilhouetteObservation`."""
        drawn = render(cardbox_patches(self.body, posture), self.camera, self.frame.rows)
        cost = cv2.countNonZero(cv2.bitwise_xor(drawn, self._upper))
        union = cv2.countNonZero(cv2.bitwise_or(drawn, self._upper))
        return cost, (union - cost) / union if union else 0.0

    @property
    def _upper(self) -> Silhouette:
        return np.ascontiguousarray(self.frame.silhouette[: self.frame.rows])

    def _costs(
        self, postures: FloatArray, parts: tuple[slice, ...], beside: FloatArray | None = None
    ) -> FloatArray:
        fixed = np.zeros((0, 4, 3)) if beside is None else beside
        costs = np.empty(len(postures))
        upper = self._upper
        for i, patches in enumerate(cardbox_patches(self.body, postures)):
            drawn = np.concatenate([fixed, *(patches[part] for part in parts)])
            model = render(drawn, self.camera, self.frame.rows)
            costs[i] = cv2.countNonZero(cv2.bitwise_xor(model, upper))
        return costs
