"""Fit of states to the silhouette's outline.

The filter counts pixels, so hair, clothes and fingers, which the model lacks, have the same weight
as an error of the torso's distance. Distances between outlines with robust weights separate both
(:mod:`cardbox_tracker.estimation.cost.outline_fit_kernels`). The fit only moves the state slightly,
so that it does not change to another posture with a similar outline. Corrections are smoothed over
time.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.posture import ARM_ANGLES, N_STATE
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.cost.distance_field import (
    FAR,
    padded_width,
    signed_distances_of,
)
from cardbox_tracker.estimation.cost.outline_distances import ABOVE_HIPS_PX, comparing
from cardbox_tracker.estimation.cost.outline_fit_kernels import (
    SHARES,
    add_equations,
    costs_along,
    smoothed,
    solve_equations,
    step,
)
from cardbox_tracker.estimation.cost.outline_points import POINTS
from cardbox_tracker.estimation.cost.terms import Frame, Silhouette
from cardbox_tracker.estimation.cost.view import View
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost
from cardbox_tracker.estimation.filtering.rated_states import RatedStates
from cardbox_tracker.vision.camera import Camera

# Standard deviations of the prior around the filter's state: angles in rad, places in m.
_STDDEV = 0.7 * np.array([0.1, 0.1, 0.1, 0.2, *[0.2] * (2 * ARM_ANGLES), 0.1, 0.1])
# Fit of several states: number of states, number of similar states, least distance of the others,
# m; Gauss-Newton steps.
_DIFFERENT, _STEPS_OF_DIFFERENT = (3, 1, 0.1), 2
# Weight of the last correction in the next one, against jitter.
_KEPT = 0.6
# Margin around the silhouette, larger than the limit of the distances.
_MARGIN_PX = 12
# Border of the window, or of the image, where no point of the outline counts.
_BORDER_PX = 3


class _Lens:
    """One camera, the transform of states to its frame, and its present silhouette."""

    def __init__(
        self, cost: WholeBodyCost, camera: Camera, turned: FloatArray, moved: FloatArray
    ) -> None:
        self._cost, self._small = cost, comparing(camera)
        self._turned, self._moved = turned, moved
        small = self._small
        self._lens = np.array([small.fx, small.fy, small.cx, small.cy])
        self._points = np.empty((POINTS, 2), np.int64), np.empty((POINTS, 2))

    def look(self, silhouette: Silhouette, state: FloatArray) -> bool:
        """Set the silhouette of a person near ``state`` (14,); return False if it is empty."""
        camera = self._small
        if silhouette.shape != (camera.height, camera.width):
            size = camera.width, camera.height
            silhouette = np.asarray(
                cv2.resize(silhouette, size, interpolation=cv2.INTER_AREA), np.uint8
            )
        there = state @ self._turned + self._moved
        row = self._cost.hip_row(there, camera) - ABOVE_HIPS_PX
        left, top, field, within = signed_distances(silhouette, row)
        lens = self._lens - np.array([0.0, 0.0, left, top])
        self._seen = self._turned, self._moved, lens, field, within
        return bool(field.size)

    def add_equations(
        self, state: FloatArray, matrix: FloatArray, right: FloatArray, costs: FloatArray
    ) -> None:
        equations = matrix, right, costs
        count = add_equations(state, self._seen, self._cost.body, equations, self._points)
        edges, points = self._points
        self._outline = edges[:count], points[:count]

    def add_costs(self, state: FloatArray, change: FloatArray, costs: FloatArray) -> None:
        costs_along(state, change, self._seen, self._cost.body, self._outline, costs)


class OutlineFit:
    """Fits states of one body before one camera or several.

    Attributes:
        seeing: indices of the cameras that are used; the first camera is 0.
    """

    def __init__(
        self,
        cost: WholeBodyCost,
        camera: Camera,
        steps: int,
        others: Sequence[tuple[WholeBodyCost, View]] = (),
    ) -> None:
        """Prepare for the body of ``cost`` before ``camera``.

        Args:
            cost: cost of the first camera.
            camera: the first camera.
            steps: number of Gauss-Newton steps; with 0 the fit returns the state unchanged.
            others: costs of the further cameras, and their views of the body.
        """
        self._low, self._high = cost.limits.T.copy()
        self._steps, self.seeing = steps, tuple(range(1 + len(others)))
        self._lenses = [_Lens(cost, camera, np.eye(N_STATE), np.zeros(N_STATE))]
        self._lenses += [_Lens(there, v.camera, v.turned, v.moved) for there, v in others]
        self.forget()

    def forget(self) -> None:
        """Forget the last correction, before a state of another person or place."""
        self._correction: FloatArray | None = None
        self._frames: Sequence[Frame] | None = None
        self._looking: list[_Lens] = []

    def __call__(self, frames: Sequence[Frame], state: FloatArray) -> FloatArray:
        """Return the state (14,) after a fit to the outlines of the cameras' silhouettes.

        With a depth image, which determines the distance better, the state is not changed.
        """
        if self._steps == 0 or frames[0].depth_m is not None:
            return state.copy()
        fitted = self.fitted(frames, state, self._steps)
        if self._correction is None:
            self._correction = fitted - state
        limits = self._low, self._high
        clipped: FloatArray = smoothed(state, fitted, self._correction, _KEPT, *limits)
        return clipped

    def different(self, frames: Sequence[Frame], rated: RatedStates) -> FloatArray:
        """Return fits (N, 14) of the best different states."""
        chosen = rated.different(*_DIFFERENT)
        fitted = [self.fitted(frames, state, _STEPS_OF_DIFFERENT) for state in chosen]
        clipped: FloatArray = np.clip(np.array(fitted), self._low, self._high)
        return clipped

    def fitted(self, frames: Sequence[Frame], state: FloatArray, steps: int) -> FloatArray:
        """Return the state (14,) that fits the silhouettes of these frames, without smoothing."""
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
            matrix[:], change[:], costs[:] = 0.0, 0.0, 0.0
            for lens in self._looking:
                lens.add_equations(fitted, matrix, change, costs)
            solve_equations(fitted, state, _STDDEV, matrix, change, costs)
            for lens in self._looking:
                lens.add_costs(fitted, change, costs)
            step(fitted, change, costs)
        return fitted


def signed_distances(
    silhouette: Silhouette, end_row: float
) -> tuple[int, int, NDArray[np.float32], FloatArray]:
    """Return the distances of pixels from the outline of a silhouette (H, W), negative inside.

    They are limited to -``FAR_PX``..``FAR_PX``.

    Returns:
        The first column and row of the window around the foreground above ``end_row``, and the
        distances there, px; empty without foreground, or with a single row above ``end_row``. Then
        first and last column, first and end row of the window's part that counts, (4,), px.
    """
    rows = silhouette[: int(min(max(end_row + _MARGIN_PX, 0), len(silhouette)))]
    # The interpolation between pixels needs two rows.
    box = cv2.boundingRect(rows) if len(rows) > 1 else (0, 0, 0, 0)
    left, top, width, height = box
    if not width:
        return 0, 0, np.zeros((0, 0), np.float32), np.zeros(4)
    first = max(left - _MARGIN_PX, 0) + _BORDER_PX
    last = min(left + width + _MARGIN_PX, rows.shape[1]) - 1 - _BORDER_PX
    top, bottom = max(top - _MARGIN_PX, 0), top + height + _MARGIN_PX
    # The kernel continues the mask beside its border, which is background where there is some.
    beside = _MARGIN_PX - FAR
    left, right = max(left - beside, 0), left + width + beside
    _, inside = cv2.threshold(rows[top:bottom, left:right], 127, 1, cv2.THRESH_BINARY)
    distances = np.empty((len(inside), padded_width(inside.shape[1])), np.float32)
    signed_distances_of(np.asarray(inside, np.uint8), distances)
    left -= FAR
    end = min(end_row - top, len(inside) - _BORDER_PX)
    within = np.array([first - left, last - left, _BORDER_PX, end], np.float64)
    return left, top, distances, within
