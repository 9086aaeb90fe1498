"""Bundle adjustment of a further camera's pose and the postures of a person seen by two cameras.

The unknowns are the pose of the further camera, equal in all frames, and the person's state in each
frame, which starts at the tracked state. The residuals are the distances between the outlines of
body and silhouettes in both cameras (:mod:`cardbox_tracker.terms.outline_distances`).
They are minimized together (Triggs et al., "Bundle Adjustment -- A Modern Synthesis", 2000).
Geman-McClure weights limit the influence of hair and clothes, which the model lacks.

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
from cardbox_tracker.common.least_squares import ENDS, Residuals, geman_mcclure, minimize, rules_of
from cardbox_tracker.measuring.silhouette_tangents import TopTangents
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import N_STATE
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.terms.outline_distances import HALF_PX, STATE_STEP, SeenOutline, comparing
from cardbox_tracker.terms.term import Silhouette
from cardbox_tracker.terms.whole_body import WholeBodyCost
from cardbox_tracker.terms.whole_body_config import WholeBodyCostConfig

N_POSE = 6
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


class Sighting(NamedTuple):
    """The person at one time."""

    state: FloatArray  #: state for the first camera, (14,): d1..d12, ``torso_x``, ``torso_z``
    first: Silhouette  #: silhouette of the first camera, (H, W), 0 or 255
    other: Silhouette  #: silhouette of the further camera
    stddev: FloatArray = STATE_STDDEV  #: standard deviations of the state, (14,)


_Drawer = Callable[[FloatArray], FloatArray]
"""Takes a state (14,); returns the patches (13, 4, 3), m in the camera's optical frame."""


class PoseProblem:
    """The bundle adjustment of a further camera."""

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
        self._body, self._tangents, self._extrinsics = body, tangents, extrinsics
        self._first = comparing(first.with_pitch(body.camera_pose.pitch_rad))
        self._other = comparing(other.with_pitch(0.0))
        self._cost = WholeBodyCost(body, self._first, WholeBodyCostConfig())
        self._seen: list[tuple[SeenOutline, SeenOutline]] = []
        tracked, stddevs = [np.zeros(N_POSE)], [np.full(N_POSE, np.inf)]
        for state, seen, seen_there, stddev in sightings:
            hips_m = np.array(self._cost.hips(state))
            there_m = extrinsics.rotation @ hips_m + extrinsics.translation_m
            pair = (
                SeenOutline(seen, self._first, hips_m),
                SeenOutline(seen_there, self._other, there_m),
            )
            if not (pair[0].is_empty or pair[1].is_empty):
                self._seen.append(pair)
                tracked.append(state)
                stddevs.append(stddev)
        self._start, self._stddevs = np.concatenate(tracked), np.concatenate(stddevs)

    def solve(self, free: Sequence[int] | None = None) -> tuple[Extrinsics, float]:
        """Return the pose, and the mean cost of a sighting's outlines.

        ``free`` are indices of the change that are estimated; by default all, or all except the
        roll without tangents. Raises CameraError if the person is not in front of the further
        camera.
        """
        if free is None:
            free = WITHOUT_ROLL if self._tangents is None else range(N_POSE)
        is_pose = np.arange(len(self._start)) < N_POSE
        limit = np.where(is_pose & ~np.isin(np.arange(len(self._start)), list(free)), 0.0, np.inf)
        rules = rules_of(
            len(self._start),
            mean=self._start,
            inverse=self._stddevs**-2.0,
            low=-limit,
            high=limit,
        )
        residuals = {"outlines": self._outlines}
        if self._tangents is not None:
            residuals["tangents"] = self._tangent_heights
        solution = minimize(residuals, self._start[None], rules, *ENDS)
        cost = float(solution.costs["outlines"][0]) / max(1, len(self._seen))
        return moved_by(self._extrinsics, solution.values[0, :N_POSE]), cost

    def _poses(self, values: FloatArray) -> list[Extrinsics]:
        """Return the pose, those with a larger and those with a smaller value of each number."""
        steps = np.vstack([np.zeros(N_POSE), np.diag(_POSE_STEP), -np.diag(_POSE_STEP)])
        return [moved_by(self._extrinsics, values[0, :N_POSE] + step) for step in steps]

    def _outlines(self, values: FloatArray) -> Residuals:
        """Return the distances of body and silhouette in both cameras."""
        here, *beside = map(self._drawer, self._poses(values))
        states = values[0, N_POSE:].reshape(-1, N_STATE)
        counts = [len(one.distances) + len(two.distances) for one, two in self._seen]
        ends = np.cumsum([0, *counts])
        errors, slopes, costs = np.empty(ends[-1]), np.zeros((ends[-1], values.size)), np.zeros(1)
        for number, (state, (first, other)) in enumerate(zip(states, self._seen, strict=True)):
            steps = np.vstack([np.zeros(N_STATE), np.diag(STATE_STEP), -np.diag(STATE_STEP)])
            moved = [
                np.append(first.drawn(self._cost.corners(one)), other.drawn(here(one)))
                for one in state + steps
            ]
            there = np.array([other.drawn(drawer(state)) for drawer in beside])
            slope = np.zeros((len(moved[0]), N_POSE + N_STATE))
            slope[len(first.distances) :, :N_POSE] = _slopes(there, _POSE_STEP)
            slope[:, N_POSE:] = _slopes(np.array(moved[1:]), STATE_STEP)
            error = moved[0] - np.append(first.distances, other.distances)
            # Of the many unknowns, a sighting depends on the pose and its own state.
            robust = geman_mcclure(error[None], slope[None], HALF_PX, _POINT_PX)
            rows, own = slice(*ends[number : number + 2]), np.arange(N_POSE + N_STATE)
            own[N_POSE:] += number * N_STATE
            errors[rows], slopes[rows, own] = robust.values[0], robust.jacobian[0]
            assert robust.costs is not None
            costs += robust.costs
        return Residuals(errors[None], slopes[None], costs)

    def _tangent_heights(self, values: FloatArray) -> Residuals:
        assert self._tangents is not None
        now, *beside = map(self._tangents.heights, self._poses(values))
        slopes = np.zeros((len(now), len(self._start)))
        slopes[:, :N_POSE] = _slopes(np.array(beside), _POSE_STEP)
        return self._tangents.residuals(now, slopes)

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


def _slopes(beside: FloatArray, steps: FloatArray) -> FloatArray:
    """Return derivatives (n, k) of n numbers, given (2 k, n) at larger and at smaller values."""
    more, less = np.split(beside, 2)
    slopes: FloatArray = (more - less).T / (2.0 * steps)
    return slopes


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
