"""Points of a simulated detector: true joints with errors like those of a pose network.

The errors have a constant part for each recording, a slow part, and noise; points of hidden joints
have larger errors and smaller scores. The deviations follow ``python -m tools.point_deviations``.
Positions in space are level, as those of a network that does not know the camera's pitch, and
forearms come forward.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.detection.image_points import POINT_INDEX, POINT_NAMES, ImagePoints
from cardbox_tracker.estimation.cost.joint_points_kernels import WRIST_SHARE
from cardbox_tracker.vision.camera import Camera

FloatArray = NDArray[np.float64]

# Standard deviations, m at the joint's depth: constant in a recording, slow, and white.
_CONSTANT_M, _SLOW_M, _WHITE_M = 0.012, 0.012, 0.006
# Time constant of the slow part, s.
_SLOW_S = 0.6
# Deviations of a point's depth, m: constant and slow.
_DEPTH_CONSTANT_M, _DEPTH_SLOW_M = 0.03, 0.04
# Forearms of such networks come forward by this share of their length.
_FORWARD = 0.14
# A joint this far behind the seen surface is hidden, m.
_HIDDEN_M = 0.12
# Chances for each second that a hand is lost, and that both hands are exchanged; duration, s.
_LOST, _EXCHANGED, _WRONG_S = 0.05, 0.01, 0.4
# Half distances of ears, hips and knuckles of index and little finger, m.
_EAR_M, _HIP_M, _KNUCKLE_M = 0.072, 0.085, 0.03


class SimulatedDetector:
    """Makes the points of one recording, image after image."""

    def __init__(self, camera: Camera, fps: float, rng: np.random.Generator) -> None:
        """Draw the constant errors; all noise comes from ``rng``."""
        self._camera, self._rng, self._fps = camera, rng, fps
        shape = (len(POINT_NAMES), 3)
        spread = np.array([1.0, 1.0, 0.0])
        depth = np.array([0.0, 0.0, 1.0])
        self._constant = rng.standard_normal(shape) * (
            _CONSTANT_M * spread + _DEPTH_CONSTANT_M * depth
        )
        self._slow_unit = _SLOW_M * spread + _DEPTH_SLOW_M * depth
        self._slow = rng.standard_normal(shape) * self._slow_unit
        self._lost_until = np.zeros(2)
        self._exchanged_until = 0.0
        self._time_s = 0.0

    def __call__(
        self, joints_m: dict[str, FloatArray], axes: dict[str, FloatArray], depth_m: FloatArray
    ) -> ImagePoints:
        """Return the points of the next image.

        Args:
            joints_m: ``head``, ``hips`` and the six keypoints by name, (3,), metres in the optical
                frame.
            axes: unit vectors (3,) in the optical frame: to the person's left of ``head`` and
                ``hips``, forward of ``face``, and from the little to the index finger of
                ``left_hand`` and ``right_hand``.
            depth_m: rendered depth (H, W), metres; infinite beside the person.
        """
        points = _places(joints_m, axes)
        rng, camera = self._rng, self._camera
        kept = float(np.exp(-1.0 / (_SLOW_S * self._fps)))
        fresh = rng.standard_normal(self._slow.shape) * self._slow_unit
        self._slow = kept * self._slow + np.sqrt(1.0 - kept * kept) * fresh
        hidden = self._hidden(points, depth_m)
        factor = np.where(hidden, 2.0, 1.0)[:, None]
        noise = rng.standard_normal(self._slow.shape) * (_WHITE_M, _WHITE_M, 0.0)
        found = points + factor * (self._constant + self._slow + noise)
        scores = np.where(hidden, rng.uniform(0.2, 0.8, len(points)), rng.uniform(0.8, 1.0))
        self._exchange_and_lose(found, scores)
        px = camera.project(found)
        inside = (px >= 0).all(axis=1) & (px < (camera.width, camera.height)).all(axis=1)
        scores = np.where(inside, scores, 0.2 * scores)
        return ImagePoints(px, scores, spatial_m=self._level(found))

    def _hidden(self, points: FloatArray, depth_m: FloatArray) -> NDArray[np.bool_]:
        px = np.nan_to_num(np.rint(self._camera.project(points)), nan=-1.0)
        column = np.clip(px[:, 0], 0, depth_m.shape[1] - 1).astype(int)
        row = np.clip(px[:, 1], 0, depth_m.shape[0] - 1).astype(int)
        return np.asarray(depth_m[row, column] < points[:, 2] - _HIDDEN_M)

    def _exchange_and_lose(self, found: FloatArray, scores: FloatArray) -> None:
        rng, step_s = self._rng, 1.0 / self._fps
        self._time_s += step_s
        for number, side in enumerate(("left", "right")):
            if rng.random() < _LOST * step_s:
                self._lost_until[number] = self._time_s + rng.exponential(_WRONG_S)
            if self._time_s < self._lost_until[number]:
                for joint in ("wrist", "index", "little_finger"):
                    scores[POINT_INDEX[f"{side}_{joint}"]] *= 0.2
        if rng.random() < _EXCHANGED * step_s:
            self._exchanged_until = self._time_s + rng.exponential(_WRONG_S)
        if self._time_s < self._exchanged_until:
            for joint in ("elbow", "wrist", "index", "little_finger"):
                pair = [POINT_INDEX[f"left_{joint}"], POINT_INDEX[f"right_{joint}"]]
                found[pair] = found[pair[::-1]]

    def _level(self, found: FloatArray) -> FloatArray:
        """Return the positions in a level frame, forearms brought forward."""
        reference = self._camera.optical_to_reference(found)
        spatial = np.stack([reference[:, 1], -reference[:, 2], -reference[:, 0]], axis=1)
        for side in ("left", "right"):
            elbow = spatial[POINT_INDEX[f"{side}_elbow"]]
            forward = _FORWARD * np.linalg.norm(spatial[POINT_INDEX[f"{side}_wrist"]] - elbow)
            for joint in ("wrist", "index", "little_finger"):
                spatial[POINT_INDEX[f"{side}_{joint}"], 2] -= forward
        return spatial


def _places(joints_m: dict[str, FloatArray], axes: dict[str, FloatArray]) -> FloatArray:
    """Return true places (17, 3) of all points, metres in the optical frame."""
    points = np.full((len(POINT_NAMES), 3), np.nan)

    def put(name: str, place: FloatArray) -> None:
        points[POINT_INDEX[name]] = place

    left, facing = axes["head"], axes["face"]
    up = np.cross(facing, left)
    put("nose", joints_m["head"] + 0.1 * facing)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        put(f"{side}_eye", joints_m["head"] + 0.085 * facing + 0.03 * sign * left + 0.02 * up)
        put(f"{side}_ear", joints_m["head"] + _EAR_M * sign * left)
        put(f"{side}_hip", joints_m["hips"] + _HIP_M * sign * axes["hips"])
        elbow, hand = joints_m[f"{side}_elbow"], joints_m[f"{side}_hand"]
        put(f"{side}_shoulder", joints_m[f"{side}_shoulder"])
        put(f"{side}_elbow", elbow)
        put(f"{side}_wrist", elbow + WRIST_SHARE * (hand - elbow))
        put(f"{side}_index", hand + _KNUCKLE_M * axes[f"{side}_hand"])
        put(f"{side}_little_finger", hand - _KNUCKLE_M * axes[f"{side}_hand"])
    return points
