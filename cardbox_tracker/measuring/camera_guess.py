"""Initial pose of a further camera from a person in the reference postures.

A grid of camera poses without roll covers all azimuths around the person at several distances and
pitches; each is translated so that the top of the head projects to the top of the silhouette.
:mod:`cardbox_tracker.measuring.camera_pose` refines the best poses. Front and back views look
alike in ``front`` and ``arms``; ``side`` separates them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import cos, sin

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.extrinsics import Extrinsics
from cardbox_tracker.camera.view import OtherCamera, View
from cardbox_tracker.common.errors import CameraError, InitializationError
from cardbox_tracker.measuring.camera_pose import PoseProblem, Sighting
from cardbox_tracker.measuring.references import COARSE_PX
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.parts import body_parts
from cardbox_tracker.person.posture import (
    REFERENCE_NAMES,
    TORSO_X,
    TORSO_Y,
    TORSO_Z,
    reference_posture,
)
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.terms.term import Silhouette
from cardbox_tracker.terms.whole_body import WholeBodyCost
from cardbox_tracker.terms.whole_body_config import WholeBodyCostConfig

_YAWS_RAD = np.radians(np.arange(-180.0, 180.0, 7.5))
_PITCHES_RAD = np.radians([-20.0, -10.0, 0.0, 10.0, 20.0, 30.0])
_DISTANCES_M = np.geomspace(1.0, 5.0, 12)
# Number of refined guesses, and their least difference in rad and metres.
_BEST, _APART_RAD, _APART_M = 4, 0.3, 0.5
# A silhouette with less intersection over union shows another posture or no person.
_LEAST_IOU = 0.5


def reference_states(body: BodyModel, side_turn: str) -> dict[str, FloatArray]:
    """Return the states (14,) of the reference postures at the measured place of ``body``."""
    return {name: body.reference_state(name, side_turn) for name in REFERENCE_NAMES}


def guessed_extrinsics(
    body: BodyModel,
    first: Camera,
    other: Camera,
    references: Mapping[str, tuple[Silhouette, Silhouette]],
    side_turn: str = "left",
) -> Extrinsics:
    """Return the initial pose of a further camera, ``other``, which lacks its pitch.

    The ``first`` camera measured the person. ``references`` are silhouettes (H, W), 0 or 255, of
    both by the names of the postures; the person turned to ``side_turn`` for ``side``. Raises
    InitializationError if no pose fits the further camera's silhouettes.
    """
    first = first.with_pitch(body.camera_pose.pitch_rad)
    states = reference_states(body, side_turn)
    seen = {name: pair[1] for name, pair in references.items()}
    best = _best_guesses(body, first, other, states, seen)
    sightings = [Sighting(states[name], *pair) for name, pair in references.items()]
    improved = []
    for guess in best:
        try:
            improved.append(PoseProblem(body, first, other, guess, sightings).solve())
        except (CameraError, np.linalg.LinAlgError):
            continue
    if not improved:
        raise InitializationError(
            "the further camera's silhouettes do not show the person of the first one: expected "
            "one person whom both cameras see from the hips to the head, in each posture; check "
            "the times, and look at both cameras' images"
        )
    return min(improved, key=lambda one: one[1])[0]


def _best_guesses(
    body: BodyModel,
    first: Camera,
    other: Camera,
    states: Mapping[str, FloatArray],
    seen: Mapping[str, Silhouette],
) -> list[Extrinsics]:
    """Return the best guesses that differ from each other."""
    camera = other.with_pitch(0.0).scaled(COARSE_PX, round(COARSE_PX * other.height / other.width))
    size = camera.width, camera.height
    small = {
        name: np.asarray(cv2.resize(mask, size, interpolation=cv2.INTER_AREA)) > 127
        for name, mask in seen.items()
    }
    cost = WholeBodyCost(body, first, WholeBodyCostConfig())
    rated = []
    for guess in _guesses(body, first, camera, small["front"]):
        try:
            view = View.of(body, first, OtherCamera(camera, guess))
        except CameraError:
            continue
        ious = [_iou(cost, view, states[name], mask) for name, mask in small.items()]
        rated.append((float(np.mean(ious)), guess))
    rated.sort(key=lambda one: -one[0])
    chosen: list[Extrinsics] = []
    for iou, guess in rated:
        if len(chosen) == _BEST or iou < _LEAST_IOU:
            break
        differences = [guess.difference(other) for other in chosen]
        if all(angle > _APART_RAD or away > _APART_M for angle, away in differences):
            chosen.append(guess)
    return chosen


def _guesses(
    body: BodyModel, first: Camera, camera: Camera, front: NDArray[np.bool_]
) -> Iterator[Extrinsics]:
    """Yield poses of all directions that project the head's top to the top of ``front``."""
    rows = np.flatnonzero(front.any(axis=1))
    if not rows.size:
        return
    top = int(rows[0])
    column = float(np.median(np.flatnonzero(front[top : top + 3].any(axis=0))))
    ray = camera.rays(np.array([column, top]))
    ray /= np.linalg.norm(ray)
    frames = pose(body, reference_posture("front"))
    crown = frames.head + np.array([0.0, 0.0, body_parts(body.sizes).head.height_m / 2])
    crown[1] += body.placement.lateral_m
    crown = first.reference_to_optical(crown)
    down = first.reference_to_optical_rotation() @ np.array([0.0, 0.0, -1.0])
    for yaw in _YAWS_RAD.tolist():
        for pitch in _PITCHES_RAD.tolist():
            # The first camera's levelled axes are rotated about the vertical, then pitched.
            ahead = np.cross(np.array([1.0, 0.0, 0.0]), down)
            aside = np.cross(down, ahead)
            z = cos(yaw) * ahead + sin(yaw) * aside
            z_pitched = cos(pitch) * z + sin(pitch) * down
            y = cos(pitch) * down - sin(pitch) * z
            rotation = np.array([np.cross(y, z_pitched), y, z_pitched])
            for distance_m in _DISTANCES_M.tolist():
                yield Extrinsics(rotation, distance_m * ray - rotation @ crown)


def _iou(cost: WholeBodyCost, view: View, state: FloatArray, seen: NDArray[np.bool_]) -> float:
    """Return the intersection over union above the hips."""
    there = view.states(state)
    corners_m = cost.corners_before(there, view.body, view.camera)
    if corners_m[..., 2].min() < 0.2:
        return 0.0
    camera = view.camera
    image = np.zeros(seen.shape, np.uint8)
    for patch in np.rint(16.0 * camera.project(corners_m)).astype(np.int32):
        cv2.fillConvexPoly(image, cv2.convexHull(patch), 1, cv2.LINE_8, 4)
    place = view.body.placement
    hips = np.array(
        [there[TORSO_X] - place.distance_m, there[TORSO_Y], place.hip_height_m + there[TORSO_Z]]
    )
    row = int(np.clip(camera.project(camera.reference_to_optical(hips))[1], 1, len(seen)))
    drawn, mask = image[:row] > 0, seen[:row]
    return float((drawn & mask).sum() / max(1, (drawn | mask).sum()))
