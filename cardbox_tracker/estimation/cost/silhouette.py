"""The cost of a posture: pixels in which model and silhouette differ (paper, equation (2)).

    W(d, I_t) = sum over x, y of h(x, y, d) XOR f(x, y, I_t)

Only the rows above the hips count: a model of the upper body says nothing about legs. The middle of
the hips never moves up or down, so the first row below it is a constant of body and camera.

:class:`SilhouetteCost` is the interface; :class:`ReferenceCost` does just what the equation says.
The trackers use the compiled one in :mod:`cardbox_tracker.estimation.cost.compiled`.
"""

from __future__ import annotations

from typing import Protocol

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
from cardbox_tracker.body.posture import LEFT_ARM, N_JOINTS, RIGHT_ARM, TORSO
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.rasterisation import render

CostArray = NDArray[np.int64]
Silhouette = NDArray[np.uint8]

ARMS = {"left": LEFT_ARM, "right": RIGHT_ARM}
_ARM_PATCHES = {"left": LEFT_ARM_PATCHES, "right": RIGHT_ARM_PATCHES}


class SilhouetteCost(Protocol):
    """Costs of many postures against one silhouette at a time; every cost is in pixels."""

    rows: int
    """Rows of the silhouette that count, from the top: those above the hips."""

    silhouette_px: int
    """Foreground pixels of the observed silhouette in those rows."""

    def observe(self, silhouette: Silhouette) -> None:
        """Take a new silhouette (H, W), 0 or 255, of the camera's size; no arms are fixed."""

    def fix_arms(self, posture: FloatArray | None) -> None:
        """Draw the arms of ``posture`` (12,) beside every torso that follows; None draws none.

        They stay where they are in the image while the torsos move.
        """

    def torso(self, torso_postures: FloatArray) -> CostArray:
        """Costs (N,) of torso, waist and head beside the fixed arms, for d1..d4, shape (N, 4)."""

    def fix_torso(self, torso_posture: FloatArray) -> None:
        """Keep the trunk at ``torso_posture`` (4,) for the arms that follow."""

    def arm(self, side: str, arm_postures: FloatArray) -> CostArray:
        """Costs (N,) with the fixed trunk and one arm, shape (N, 4), drawn; safe in threads."""

    def full(self, postures: FloatArray) -> CostArray:
        """Costs (N,) with all 15 patches drawn, for postures of shape (N, 12)."""

    def overlap(self, posture: FloatArray) -> tuple[int, float]:
        """Cost in pixels and IoU of one posture (12,) with all 15 patches drawn."""


def rows_above_hips(body: BodyModel, camera: Camera) -> int:
    """Return how many rows of the image, from its top, show what is above the hips.

    The hips' row is taken where the torso stands; at the image's edges a pitched camera would see
    the same height in the same row as well, since it turns about the rows' direction only.
    """
    hip = camera.reference_to_optical(
        np.array([-body.placement.distance_m, 0.0, body.placement.hip_height_m])
    )
    if hip[2] <= 0:
        return camera.height
    return int(np.clip(np.ceil(camera.project(hip)[1]), 1, camera.height))


def check_silhouette(silhouette: Silhouette, camera: Camera) -> None:
    """Raise ValueError unless ``silhouette`` has the camera's size."""
    if silhouette.shape != (camera.height, camera.width):
        raise ValueError(
            f"silhouette has shape {silhouette.shape}; the camera's is "
            f"({camera.height}, {camera.width})"
        )


class ReferenceCost:
    """Equation (2) as it reads: draw the model, XOR with the silhouette, count."""

    def __init__(self, body: BodyModel, camera: Camera) -> None:
        """Prepare for one body before one camera."""
        self.body, self.camera = body, camera
        self.rows = rows_above_hips(body, camera)
        self.silhouette_px = 0
        self._silhouette = np.zeros((self.rows, camera.width), np.uint8)
        self._torso = np.zeros(4)
        self._fixed_arms = np.zeros((0, 4, 3))

    def observe(self, silhouette: Silhouette) -> None:
        """See :class:`SilhouetteCost`."""
        check_silhouette(silhouette, self.camera)
        self._silhouette = np.ascontiguousarray(silhouette[: self.rows])
        self.silhouette_px = cv2.countNonZero(self._silhouette)
        self.fix_arms(None)

    def fix_arms(self, posture: FloatArray | None) -> None:
        """See :class:`SilhouetteCost`."""
        arms = slice(LEFT_ARM_PATCHES.start, RIGHT_ARM_PATCHES.stop)
        patches = cardbox_patches(self.body, np.zeros(N_JOINTS) if posture is None else posture)
        self._fixed_arms = patches[arms if posture is not None else slice(0, 0)]

    def torso(self, torso_postures: FloatArray) -> CostArray:
        """See :class:`SilhouetteCost`."""
        postures = np.zeros((len(torso_postures), N_JOINTS))
        postures[:, TORSO] = torso_postures
        return self._costs(postures, (TORSO_PATCHES,), self._fixed_arms)

    def fix_torso(self, torso_posture: FloatArray) -> None:
        """See :class:`SilhouetteCost`."""
        self._torso = np.array(torso_posture, dtype=np.float64)

    def arm(self, side: str, arm_postures: FloatArray) -> CostArray:
        """See :class:`SilhouetteCost`."""
        postures = np.zeros((len(arm_postures), N_JOINTS))
        postures[:, TORSO] = self._torso
        postures[:, ARMS[side]] = arm_postures
        return self._costs(postures, (TORSO_PATCHES, _ARM_PATCHES[side]))

    def full(self, postures: FloatArray) -> CostArray:
        """See :class:`SilhouetteCost`."""
        return self._costs(np.asarray(postures), (slice(None),))

    def overlap(self, posture: FloatArray) -> tuple[int, float]:
        """See :class:`SilhouetteCost`."""
        drawn = self.draw(posture)
        cost = cv2.countNonZero(cv2.bitwise_xor(drawn, self._silhouette))
        union = cv2.countNonZero(cv2.bitwise_or(drawn, self._silhouette))
        return cost, (union - cost) / union if union else 0.0

    def draw(self, posture: FloatArray) -> NDArray[np.uint8]:
        """Return the model (rows, W) in ``posture`` (12,) as the camera sees it, 0 or 255."""
        return render(cardbox_patches(self.body, posture), self.camera, self.rows)

    def _costs(
        self, postures: FloatArray, parts: tuple[slice, ...], beside: FloatArray | None = None
    ) -> CostArray:
        fixed = np.zeros((0, 4, 3)) if beside is None else beside
        costs = np.empty(len(postures), np.int64)
        for i, patches in enumerate(cardbox_patches(self.body, postures)):
            drawn = np.concatenate([fixed, *(patches[part] for part in parts)])
            model = render(drawn, self.camera, self.rows)
            costs[i] = cv2.countNonZero(cv2.bitwise_xor(model, self._silhouette))
        return costs
