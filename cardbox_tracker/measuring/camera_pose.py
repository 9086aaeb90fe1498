"""Bundle adjustment of a further camera's pose and the postures of a person seen by two cameras.

The unknowns are the pose of the further camera, equal in all frames, and the person's state in each
frame, which starts at the tracked state. The residuals are the distances between the outlines of
body and silhouettes in both cameras (:mod:`cardbox_tracker.terms.outline_distances`).
A Gauss-Newton step solves the normal equations, from which the Schur complement eliminates the
states (Triggs et al., "Bundle Adjustment -- A Modern Synthesis", 2000). Geman-McClure weights limit
the influence of hair and clothes, which the model lacks.

A change of the pose is six numbers: a rotation vector about the camera's axes, rad, and a
translation along them, metres.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import cv2
import numpy as np

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.extrinsics import Extrinsics
from cardbox_tracker.camera.view import OtherCamera, View
from cardbox_tracker.measuring.silhouette_tangents import TopTangents
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import N_STATE
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.terms.outline_distances import (
    HALF_PX,
    STATE_STEP,
    SeenOutline,
    comparing,
)
from cardbox_tracker.terms.term import Silhouette
from cardbox_tracker.terms.whole_body import WholeBodyCost
from cardbox_tracker.terms.whole_body_config import WholeBodyCostConfig

N_POSE = 6
STEPS = 6
"""Steps (:meth:`PoseProblem.step`) to a pose."""
ROTATION = (0, 1, 2)
"""Indices of a change that rotate the camera."""

WITHOUT_ROLL = (0, 1, 3, 4, 5)
"""All indices of a change except the roll, which outlines hardly constrain."""

# Standard deviation of a distance, px.
_POINT_PX = 4.0
# Standard deviations of the tracked state.
STATE_STDDEV = np.array([0.3, 0.3, 0.3, 0.5, *[0.5] * 8, 0.3, 0.3])
# Steps of the central differences by the pose.
_POSE_STEP = np.array([0.015, 0.015, 0.015, 0.03, 0.03, 0.03])
# Differences over whole pixels overestimate derivatives, so plain steps would be too short.
_RELAXATION = 1.6
_MOST_STATE_CHANGE, _MOST_POSE_CHANGE = 0.25, 0.1
# Step lengths of the line search for a state.
_STEP_LENGTHS = (1.0, 0.5, 0.2, 0.0)


class Sighting(NamedTuple):
    """The person at one time."""

    state: FloatArray  #: state for the first camera, (14,): d1..d12, ``torso_x``, ``torso_z``
    first: Silhouette  #: silhouette of the first camera, (H, W), 0 or 255
    other: Silhouette  #: silhouette of the further camera
    stddev: FloatArray = STATE_STDDEV  #: standard deviations of the state, (14,)


_Drawer = Callable[[FloatArray], FloatArray]
"""Takes a state (14,); returns the patches (13, 4, 3), m in the camera's optical frame."""


class _Equations(NamedTuple):
    """Reduced normal equations of a sighting: ``matrix`` (6, 6) @ change = -``right`` (6,).

    The change of the state (14,) is -(``alone`` + ``by_pose`` @ change).
    """

    matrix: FloatArray
    right: FloatArray
    alone: FloatArray
    by_pose: FloatArray
    cost: float


class PoseProblem:
    """The bundle adjustment of a further camera; ``states`` (14,) are those of each sighting."""

    def __init__(
        self,
        body: BodyModel,
        first: Camera,
        other: Camera,
        extrinsics: Extrinsics,
        sightings: Sequence[Sighting],
        tangents: TopTangents | None = None,
    ) -> None:
        """Begin at the states of ``sightings``; those with an empty silhouette are ignored.

        ``body`` is the person as measured by the first camera, whose distance is kept. The
        ``other`` camera lacks its pitch, and has the initial pose ``extrinsics``. ``tangents`` of
        both cameras also constrain the roll. Raises CameraError if the person is not in front of
        the further camera.
        """
        self._body, self._tangents = body, tangents
        self._first = comparing(first.with_pitch(body.camera_pose.pitch_rad))
        self._other = comparing(other.with_pitch(0.0))
        self._cost = WholeBodyCost(body, self._first, WholeBodyCostConfig())
        self.states: list[FloatArray] = []
        self._seen: list[tuple[SeenOutline, SeenOutline]] = []
        self._stddevs: list[FloatArray] = []
        for state, seen, seen_there, stddev in sightings:
            hips_m = np.array(self._cost.hips(state))
            there_m = extrinsics.rotation @ hips_m + extrinsics.translation_m
            pair = (
                SeenOutline(seen, self._first, hips_m),
                SeenOutline(seen_there, self._other, there_m),
            )
            if not (pair[0].is_empty or pair[1].is_empty):
                self.states.append(state.copy())
                self._stddevs.append(stddev)
                self._seen.append(pair)
        self._tracked = [state.copy() for state in self.states]

    def step(
        self, extrinsics: Extrinsics, free: Sequence[int] | None = None
    ) -> tuple[Extrinsics, float]:
        """Return the pose after one Gauss-Newton step, which also updates the states.

        The number is the mean of the sightings' weighted squared distances before the step.
        ``free`` are indices of the change that are estimated; by default all, or all except the
        roll without tangents. Raises CameraError if the person is not in front of the further
        camera.
        """
        if free is None:
            free = WITHOUT_ROLL if self._tangents is None else range(N_POSE)
        here, poses = self._drawer(extrinsics), {}
        for i in free:
            step = np.zeros(N_POSE)
            step[i] = _POSE_STEP[i]
            poses[i] = moved_by(extrinsics, step), moved_by(extrinsics, -step)
        beside = {i: (self._drawer(more), self._drawer(less)) for i, (more, less) in poses.items()}
        equations = [self._equations(number, here, beside) for number in range(len(self.states))]
        index = np.array(list(free))
        square = np.ix_(index, index)
        matrix = np.sum([one.matrix for one in equations], axis=0)[square]
        right = np.sum([one.right for one in equations], axis=0)[index]
        if self._tangents is not None:
            steps = [(*poses[i], 2.0 * float(_POSE_STEP[i])) for i in free]
            more, more_right = self._tangents.equations(extrinsics, steps)
            matrix = matrix + more
            # The derivatives of the tangents need no relaxation.
            right = right + more_right / _RELAXATION
        inverse = np.linalg.inv(matrix)
        change = np.zeros(N_POSE)
        change[index] = -_RELAXATION * inverse @ right
        change *= min(1.0, _MOST_POSE_CHANGE / max(float(np.abs(change).max()), 1e-9))
        better = moved_by(extrinsics, change)
        there = self._drawer(better)
        for number, one in enumerate(equations):
            moved = np.clip(
                one.alone + one.by_pose @ change, -_MOST_STATE_CHANGE, _MOST_STATE_CHANGE
            )
            tried = [self.states[number] - length * moved for length in _STEP_LENGTHS]
            costs = [self._robust_cost(number, state, there) for state in tried]
            self.states[number] = tried[int(np.argmin(costs))]
        return better, float(np.mean([one.cost for one in equations]))

    def _equations(
        self, number: int, here: _Drawer, beside: dict[int, tuple[_Drawer, _Drawer]]
    ) -> _Equations:
        state, tracked = self.states[number], self._tracked[number]
        first, other = self._seen[number]
        residual = self._residual(number, state, here)
        count = len(first.distances)
        jacobian = np.zeros((len(residual), N_STATE + N_POSE))
        for i, step in enumerate(STATE_STEP.tolist()):
            more, less = state.copy(), state.copy()
            more[i] += step
            less[i] -= step
            change = self._residual(number, more, here) - self._residual(number, less, here)
            jacobian[:, i] = change / (2.0 * step)
        for i, (more_there, less_there) in beside.items():
            change = other.drawn(more_there(state)) - other.drawn(less_there(state))
            jacobian[count:, N_STATE + i] = change / (2.0 * _POSE_STEP[i])
        weights = 1.0 / (_POINT_PX * (1.0 + (residual / HALF_PX) ** 2)) ** 2
        weighted = jacobian * weights[:, None]
        matrix, right = jacobian.T @ weighted, weighted.T @ residual
        own = np.arange(N_STATE)
        matrix[own, own] += 1.0 / self._stddevs[number] ** 2
        right[own] += (state - tracked) / self._stddevs[number] ** 2
        across = matrix[:N_STATE, N_STATE:]
        columns = np.column_stack([across, right[:N_STATE]])
        solved = np.asarray(np.linalg.solve(matrix[:N_STATE, :N_STATE], columns), np.float64)
        by_pose: FloatArray = solved[:, :-1]
        alone: FloatArray = solved[:, -1]
        return _Equations(
            matrix[N_STATE:, N_STATE:] - across.T @ by_pose,
            right[N_STATE:] - across.T @ alone,
            alone,
            by_pose,
            float(weights @ residual**2),
        )

    def _residual(self, number: int, state: FloatArray, drawer: _Drawer) -> FloatArray:
        first, other = self._seen[number]
        return np.concatenate(
            [
                first.drawn(self._cost.corners(state)) - first.distances,
                other.drawn(drawer(state)) - other.distances,
            ]
        )

    def _robust_cost(self, number: int, state: FloatArray, drawer: _Drawer) -> float:
        squares = self._residual(number, state, drawer) ** 2
        fit = float(np.sum(squares / (1.0 + squares / HALF_PX**2))) / _POINT_PX**2
        return fit + float(np.sum(((state - self._tracked[number]) / self._stddevs[number]) ** 2))

    def _drawer(self, extrinsics: Extrinsics) -> _Drawer:
        """Return what places the body before the further camera, including the camera's roll."""
        view = View.of(self._body, self._first, OtherCamera(self._other, extrinsics))
        axes = extrinsics.rotation @ self._first.reference_to_optical_rotation()
        roll = axes @ view.level_axes().T

        def drawn(state: FloatArray) -> FloatArray:
            there_m = self._cost.corners_before(view.states(state), view.body, view.camera)
            turned: FloatArray = there_m @ roll.T
            return turned

        return drawn


def moved_by(extrinsics: Extrinsics, change: FloatArray) -> Extrinsics:
    """Return the pose after a change (6,): rotation vector and translation in the camera's axes."""
    turn = np.asarray(cv2.Rodrigues(np.asarray(change[:3], np.float64))[0], np.float64)
    return Extrinsics(
        turn @ extrinsics.rotation,
        turn @ extrinsics.translation_m + np.asarray(change[3:], np.float64),
        extrinsics.source,
    )


def turned_by(before: Extrinsics, after: Extrinsics) -> FloatArray:
    """Return the rotation vector (3,), rad, in the camera's axes from one pose to another."""
    vector = np.asarray(cv2.Rodrigues(after.rotation @ before.rotation.T)[0], np.float64)
    return vector.ravel()
