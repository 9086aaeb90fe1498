"""The last step of a frame: the result is fitted to the silhouette's outline.

The filter counts pixels, and hair, clothes and fingers, which the model lacks, count as much as a
torso that is too far away. Distances between outlines with robust weights tell them apart
(:mod:`cardbox_tracker.estimation.cost.outline_fit_kernels`). Postures that look alike stay what
they are: the state moves by little. What a correction has in common with the last ones counts, the
rest is noise, so corrections are smoothed.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.cost.outline_distances import ABOVE_HIPS_PX, STATE_STEP, comparing
from cardbox_tracker.estimation.cost.outline_fit_kernels import fit_outline
from cardbox_tracker.estimation.cost.terms import Frame, Silhouette
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost
from cardbox_tracker.estimation.filtering.arms import STATE_LIMITS
from cardbox_tracker.vision.camera import Camera

# How far a state may go: roll, pitch, yaw, arms in rad, places in m.
_STDDEV = 0.7 * np.array([0.1, 0.1, 0.1, 0.2, *[0.2] * 8, 0.1, 0.1])
# Share of the last correction in the next one. Without it the error of the acceleration grows by a
# third.
_KEPT = 0.6
# Around the silhouette, more than the distance beyond which all are alike.
_MARGIN_PX = 12


class OutlineFit:
    """Fits states of one body before one camera."""

    def __init__(self, cost: WholeBodyCost, camera: Camera, steps: int) -> None:
        """Prepare for the body of ``cost`` before ``camera``; ``steps`` of 0 change nothing."""
        self._cost, self._steps, self._small = cost, steps, comparing(camera)
        small = self._small
        self._lens = np.array([small.fx, small.fy, small.cx, small.cy])
        self.forget()

    def forget(self) -> None:
        """Begin anew: the next state is of somebody else, or of another place."""
        self._correction: FloatArray | None = None

    def __call__(self, frame: Frame, state: FloatArray) -> FloatArray:
        """Return a state (14,) that fits the outline of the frame's silhouette better.

        Other cameras and depth images say more of the distance than one outline; with them the
        state stays.
        """
        if self._steps == 0 or frame.others or frame.depth_m is not None:
            return state.copy()
        correction = self._fitted(frame.silhouette, state) - state
        if self._correction is None:
            self._correction = correction
        else:
            self._correction = _KEPT * self._correction + (1.0 - _KEPT) * correction
        return np.clip(state + self._correction, *STATE_LIMITS.T)

    def _fitted(self, silhouette: Silhouette, state: FloatArray) -> FloatArray:
        """Return the state (14,) that fits this silhouette alone."""
        fitted = state.copy()
        camera = self._small
        if silhouette.shape != (camera.height, camera.width):
            size = camera.width, camera.height
            silhouette = np.asarray(
                cv2.resize(silhouette, size, interpolation=cv2.INTER_AREA), np.uint8
            )
        row = self._cost.hip_row(state, camera) - ABOVE_HIPS_PX
        left, top, field = signed_distances(silhouette, row)
        if field.size == 0:
            return fitted
        fit_outline(
            fitted,
            *self._cost.figure,
            self._lens - np.array([0.0, 0.0, left, top]),
            field,
            row - top,
            _STDDEV,
            STATE_STEP,
            self._steps,
        )
        return fitted


def signed_distances(
    silhouette: Silhouette, end_row: float
) -> tuple[int, int, NDArray[np.float32]]:
    """Return the distances of pixels from the outline of a silhouette (H, W), negative inside.

    Returns:
        The first column and row of the window around what is foreground above ``end_row``, and
        there the distances, px; empty if nothing is.
    """
    rows = silhouette[: int(np.clip(end_row + _MARGIN_PX, 0, len(silhouette)))]
    if not rows.size:
        return 0, 0, np.zeros((0, 0), np.float32)
    left, top, width, height = cv2.boundingRect(rows)
    left, right = max(left - _MARGIN_PX, 0), left + width + _MARGIN_PX
    top, bottom = max(top - _MARGIN_PX, 0), top + height + _MARGIN_PX
    if not width:
        return 0, 0, np.zeros((0, 0), np.float32)
    _, inside = cv2.threshold(rows[top:bottom, left:right], 127, 1, cv2.THRESH_BINARY)
    away = cv2.distanceTransform(1 - inside, cv2.DIST_L2, 3)
    within = cv2.distanceTransform(inside, cv2.DIST_L2, 3)
    return left, top, np.asarray(away - within, np.float32)
