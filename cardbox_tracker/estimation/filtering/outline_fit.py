"""States are fitted to the silhouette's outline.

The filter counts pixels, and hair, clothes and fingers, which the model lacks, count as much as a
torso that is too far away. Distances between outlines with robust weights tell them apart
(:mod:`cardbox_tracker.estimation.cost.outline_fit_kernels`). Postures that look alike stay what
they are: the state moves by little. What a correction has in common with the last ones counts, the
rest is noise, so corrections are smoothed.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.cost.distance_field import signed_distances_of
from cardbox_tracker.estimation.cost.outline_distances import ABOVE_HIPS_PX, STATE_STEP, comparing
from cardbox_tracker.estimation.cost.outline_fit_kernels import (
    SHARES,
    add_equations,
    costs_along,
    solve_equations,
)
from cardbox_tracker.estimation.cost.outline_points import POINTS
from cardbox_tracker.estimation.cost.terms import Frame, Silhouette
from cardbox_tracker.estimation.cost.view import View
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost
from cardbox_tracker.estimation.cost.whole_body_kernels import N_STATE
from cardbox_tracker.estimation.filtering.arms import STATE_LIMITS
from cardbox_tracker.vision.camera import Camera

# How far a state may go: roll, pitch, yaw, arms in rad, places in m.
_STDDEV = 0.7 * np.array([0.1, 0.1, 0.1, 0.2, *[0.2] * 8, 0.1, 0.1])
# Share of the last correction in the next one. Without it the error of the acceleration grows by a
# third.
_KEPT = 0.6
# Around the silhouette, more than the distance beyond which all are alike.
_MARGIN_PX = 12


class _Lens:
    """One camera: how it sees states of the first one, and what it says in this frame."""

    def __init__(
        self, cost: WholeBodyCost, camera: Camera, turned: FloatArray, moved: FloatArray
    ) -> None:
        self._cost, self._small = cost, comparing(camera)
        self._turned, self._moved = turned, moved
        small = self._small
        self._lens = np.array([small.fx, small.fy, small.cx, small.cy])

    def look(self, silhouette: Silhouette, state: FloatArray) -> bool:
        """Take a silhouette of a person about where ``state`` (14,) is; False if it is empty."""
        camera = self._small
        if silhouette.shape != (camera.height, camera.width):
            size = camera.width, camera.height
            silhouette = np.asarray(
                cv2.resize(silhouette, size, interpolation=cv2.INTER_AREA), np.uint8
            )
        there = state @ self._turned + self._moved
        row = self._cost.hip_row(there, camera) - ABOVE_HIPS_PX
        left, top, self._field = signed_distances(silhouette, row)
        self._end_row = row - top
        self._lens_now = self._lens - np.array([0.0, 0.0, left, top])
        return bool(self._field.size)

    def add_equations(self, state: FloatArray, matrix: FloatArray, right: FloatArray) -> None:
        edges, points = np.empty((POINTS, 2), np.int64), np.empty((POINTS, 2))
        count = add_equations(
            state,
            self._turned,
            self._moved,
            *self._cost.figure,
            self._lens_now,
            self._field,
            self._end_row,
            STATE_STEP,
            matrix,
            right,
            edges,
            points,
        )
        self._edges, self._points = edges[:count], points[:count]

    def add_costs(self, state: FloatArray, change: FloatArray, costs: FloatArray) -> None:
        costs_along(
            state,
            change,
            self._turned,
            self._moved,
            *self._cost.figure,
            self._lens_now,
            self._field,
            self._edges,
            self._points,
            costs,
        )


class OutlineFit:
    """Fits states of one body before one camera or several.

    Attributes:
        seeing: cameras that count, by their number; the first one is 0.
    """

    def __init__(
        self,
        cost: WholeBodyCost,
        camera: Camera,
        steps: int,
        others: Sequence[tuple[WholeBodyCost, View]] = (),
    ) -> None:
        """Prepare for the body of ``cost`` before ``camera``; ``steps`` of 0 change nothing.

        Args:
            cost: of the first camera.
            camera: the first one.
            steps: how many.
            others: what the further cameras rate by, and how they see the body.
        """
        self._steps, self.seeing = steps, tuple(range(1 + len(others)))
        self._lenses = [_Lens(cost, camera, np.eye(N_STATE), np.zeros(N_STATE))]
        self._lenses += [_Lens(there, v.camera, v.turned, v.moved) for there, v in others]
        self.forget()

    def forget(self) -> None:
        """Begin anew: the next state is of somebody else, or of another place."""
        self._correction: FloatArray | None = None
        self._frames: Sequence[Frame] | None = None
        self._looking: list[_Lens] = []

    def __call__(self, frames: Sequence[Frame], state: FloatArray) -> FloatArray:
        """Return a state (14,) that fits the outlines of the cameras' silhouettes better.

        Depth images say more of the distance than an outline; with them the state stays.
        """
        if self._steps == 0 or frames[0].depth_m is not None:
            return state.copy()
        correction = self.fitted(frames, state, self._steps) - state
        before = correction if self._correction is None else self._correction
        self._correction = _KEPT * before + (1.0 - _KEPT) * correction
        return np.clip(state + self._correction, *STATE_LIMITS.T)

    def fitted(self, frames: Sequence[Frame], state: FloatArray, steps: int) -> FloatArray:
        """Return the state (14,) that fits the silhouettes of these frames alone."""
        if frames is not self._frames:
            self._looking = [
                self._lenses[number]
                for number in self.seeing
                if self._lenses[number].look(frames[number].silhouette, state)
            ]
            self._frames = frames
        fitted = state.copy()
        if not self._looking:
            return fitted
        matrix, change = np.empty((N_STATE, N_STATE)), np.empty(N_STATE)
        costs = np.empty(len(SHARES))
        for _ in range(steps):
            matrix[:], change[:] = 0.0, 0.0
            for lens in self._looking:
                lens.add_equations(fitted, matrix, change)
            solve_equations(fitted, state, _STDDEV, matrix, change, costs)
            for lens in self._looking:
                lens.add_costs(fitted, change, costs)
            fitted += SHARES[int(np.argmin(costs))] * change
        return fitted


def signed_distances(
    silhouette: Silhouette, end_row: float
) -> tuple[int, int, NDArray[np.float32]]:
    """Return the distances of pixels from the outline of a silhouette (H, W), negative inside.

    At most ``FAR_PX`` either way.

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
    distances = np.empty(inside.shape, np.float32)
    signed_distances_of(np.asarray(inside, np.uint8), distances)
    return left, top, distances
