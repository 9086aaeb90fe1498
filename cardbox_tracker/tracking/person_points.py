"""Projection of a person's joints into an image."""

from __future__ import annotations

import numpy as np

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import N_STATE, TORSO_X
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import POINT_NAMES

HIP, NECK, HEAD_CENTRE, LEFT, RIGHT = (
    POINT_NAMES.index(name) for name in ("hip", "neck", "head", "left_shoulder", "right_shoulder")
)
"""Rows of :meth:`PersonPoints.of`; an arm has three: shoulder, elbow, fingertips."""
# Length of the fingers in forearm lengths.
_FINGERS = 0.15
_NEAREST_M = 0.2


class PersonPoints:
    """Projects the joints of one body into the image of one camera."""

    def __init__(self, body: BodyModel, camera: Camera) -> None:
        """Prepare for ``body`` before ``camera``, which includes the pitch."""
        self._body, self._camera = body, camera

    def of(self, posture: FloatArray) -> FloatArray:
        """Return column and row, px, and pixels per metre of hip, neck, head and arms, (9, 3).

        The posture is (12,) or (14,), rad and metres. Rows are as :data:`HIP` and the names beside
        it. Points nearer than 0.2 m are treated as if they were 0.2 m away.
        """
        camera, state = self._camera, np.zeros(N_STATE)
        state[: len(posture)] = posture
        state[TORSO_X] = min(state[TORSO_X], self._body.placement.distance_m - _NEAREST_M)
        points_m = pose(self._body, state, camera.pitch_rad).points_m
        for arm in (LEFT, RIGHT):
            points_m[arm + 2] += _FINGERS * (points_m[arm + 2] - points_m[arm + 1])
        x, y, z = points_m.T
        scale = camera.fx / np.maximum(z, _NEAREST_M)
        column, row = scale * x + camera.cx, camera.fy / camera.fx * scale * y + camera.cy
        return np.stack([column, row, scale], axis=1)
