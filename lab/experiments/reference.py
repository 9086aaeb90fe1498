"""The silhouette's term as equation (2) reads, for comparison with the compiled one."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.person.cardbox import (
    LEFT_ARM_PATCHES,
    RIGHT_ARM_PATCHES,
    TORSO_PATCHES,
    cardbox_patches,
)
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import N_JOINTS, TORSO
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.terms.silhouette import SilhouetteObservation, SilhouetteTerm
from cardbox_tracker.terms.term import ARMS, ArmCosts, Frame, Silhouette, TorsoCosts

_ARM_PATCHES = {"left": LEFT_ARM_PATCHES, "right": RIGHT_ARM_PATCHES}
_BOTH_ARMS = slice(LEFT_ARM_PATCHES.start, RIGHT_ARM_PATCHES.stop)


class ReferenceSilhouette(SilhouetteTerm):
    """Equation (2) as it reads: draw the model, XOR with the silhouette, count."""

    def observe(self, frame: Frame) -> ReferenceObservation:
        """See :class:`SilhouetteTerm`."""
        return ReferenceObservation(frame, self.body, self.camera)

    def draw(self, posture: FloatArray) -> NDArray[np.uint8]:
        """Return the model (rows, W) in ``posture`` (12,) as the camera sees it, 0 or 255."""
        return render(cardbox_patches(self.body, posture), self.camera, self.rows)


@dataclass(frozen=True)
class ReferenceObservation(SilhouetteObservation):
    """One silhouette, compared with drawn models pixel by pixel."""

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
