"""Projection of a person's joints into an image, in one compiled call."""

from __future__ import annotations

import numpy as np

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import N_STATE, TORSO_X
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.compiling import inlined_kernel, kernel
from cardbox_tracker.estimation.cost.kernel_arguments import (
    ASIDE,
    BOTTOM,
    FORWARD,
    HEAD,
    HEIGHT,
    TORSO,
    UPWARDS,
    BodyTuple,
    Floats,
    Intrinsics,
    body_of,
    intrinsics_of,
    place_of,
    shape_of,
)
from cardbox_tracker.estimation.cost.kinematics import (
    angles_in,
    new_arm,
    pose_arm,
    side_of,
    state_pose,
    turn_arm,
)
from cardbox_tracker.vision.camera import Camera

HIP, NECK, HEAD_CENTRE, LEFT, RIGHT = 0, 1, 2, 3, 6
"""Rows of :meth:`PersonPoints.of`; an arm has three: shoulder, elbow, fingertips."""
_COUNT = 9
# Length of the fingers in forearm lengths.
_FINGERS = 0.15
_NEAREST_M = 0.2


class PersonPoints:
    """Projects the joints of one body into the image of one camera."""

    def __init__(self, body: BodyModel, camera: Camera) -> None:
        """Prepare for ``body`` before ``camera``, which includes the pitch."""
        parts, shoulder = shape_of(body.sizes)
        # As in the paper, the shoulders of raised arms are not lifted.
        girdle = np.zeros(5)
        girdle[[ASIDE, UPWARDS]] = shoulder
        self._body = parts, parts, girdle, place_of(body), intrinsics_of(camera)
        self._farthest_x_m = body.placement.distance_m - _NEAREST_M

    def of(self, posture: FloatArray) -> FloatArray:
        """Return column and row, px, and pixels per metre of hip, neck, head, and both arms.

        Points nearer than 0.2 m are treated as if they were 0.2 m away.

        Args:
            posture: (12,), or with ``torso_x`` and ``torso_z`` (14,), rad and metres.

        Returns:
            Shape (9, 3); rows as :data:`HIP` and the names beside it.
        """
        state, points = np.zeros(N_STATE), np.empty((_COUNT, 3))
        state[: len(posture)] = posture
        state[TORSO_X] = min(state[TORSO_X], self._farthest_x_m)
        _project(state, self._body, points)
        return points


@kernel
def _project(state: Floats, body: BodyTuple, points: Floats) -> None:
    """Write column, row and scale of the points of a state (14,) to ``points`` (9, 3)."""
    of = body_of(body)
    rotation, hip, arm, place = np.empty((3, 3)), np.empty(3), new_arm(), np.empty(3)
    state_pose(state, of.place, of.camera, rotation, hip)
    _write(hip, of.camera, points[HIP])
    top_m = of.parts[TORSO, BOTTOM] + of.parts[TORSO, HEIGHT]
    middle_m = of.parts[HEAD, BOTTOM] + 0.5 * of.parts[HEAD, HEIGHT]
    for j in range(3):
        place[j] = hip[j] + top_m * rotation[j, 2]
    _write(place, of.camera, points[NECK])
    for j in range(3):
        forward_m = of.parts[HEAD, FORWARD] * rotation[j, 0]
        place[j] = hip[j] + (forward_m + middle_m * rotation[j, 2])
    _write(place, of.camera, points[HEAD_CENTRE])
    for k in range(2):
        pose_arm(angles_in(state, k), side_of(k), of.parts, of.girdle, arm.points, arm.directions)
        turn_arm(arm, rotation, hip)
        for j in range(3):
            arm.joints[2, j] += _FINGERS * (arm.joints[2, j] - arm.joints[1, j])
        for i in range(3):
            _write(arm.joints[i], of.camera, points[LEFT + 3 * k + i])


@inlined_kernel
def _write(place: Floats, camera: Intrinsics, point: Floats) -> None:
    """Write column, row and scale (3,) of a place (3,) in the optical frame, metres."""
    scale = camera.fx / max(place[2], _NEAREST_M)
    point[0] = scale * place[0] + camera.cx
    point[1] = camera.fy / camera.fx * scale * place[1] + camera.cy
    point[2] = scale
