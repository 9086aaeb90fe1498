"""A further camera as the tracker uses it: a level one of its own, which sees moved states.

All the tracker's parts know one kind of camera: level but for its pitch, before a person who stands
at a distance. Any camera is of that kind once its image is turned upright and what it sees is given
in a level frame of its own, which is turned about the vertical and moved against the first one's. A
state (14,) then becomes another one, with other ``torso_y``, ``torso_yaw``, ``torso_x`` and
``torso_z``; roll, pitch and arms are the same. So a second camera needs no other kernels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import asin, atan2, cos, sin

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import N_JOINTS
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.errors import BodyModelError, CameraError
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.extrinsics import Extrinsics

ImageArray = NDArray[np.uint8]

_Y, _YAW, _X, _Z = 0, 3, N_JOINTS, N_JOINTS + 1
_NO_FRACTIONS = np.empty(0, np.uint16)
# Turned by less, an image stays as it is: a fifth of a pixel at the border of 320.
_UPRIGHT_RAD = 0.001


@dataclass(frozen=True)
class OtherCamera:
    """A further camera.

    Attributes:
        camera: at the working resolution, without its pitch.
        extrinsics: where it stands.
    """

    camera: Camera
    extrinsics: Extrinsics


@dataclass(frozen=True, eq=False)
class View:
    """One body as a further camera sees it.

    Attributes:
        body: the person, placed before that camera.
        camera: that camera, turned upright.
        yaw_rad: how its level frame is turned about the vertical.
        offset_m: from the first level frame into its own, after that turn, (3,).
        turn: the pixel of the camera's image for each of the upright one, (H, W, 2) int16; None if
            it stands upright.
        turned: states (N, 14) of the first camera times this, (14, 14), plus
        moved: this, (14,), are those that this camera has.
    """

    body: BodyModel
    camera: Camera
    yaw_rad: float
    offset_m: FloatArray
    turn: NDArray[np.int16] | None
    turned: FloatArray
    moved: FloatArray

    @classmethod
    def of(cls, body: BodyModel, first: Camera, other: OtherCamera) -> View:
        """Return the view of ``body``, which stands before ``first``, pitched as it stands.

        Raises:
            CameraError: the other camera looks straight up or down, or the person was measured
                behind it.
        """
        axes = other.extrinsics.rotation @ first.reference_to_optical_rotation()
        ahead = axes[2]
        pitch_rad = asin(min(max(-float(ahead[2]), -1.0), 1.0))
        if abs(cos(pitch_rad)) < 0.1:
            raise CameraError(
                f"the camera with the extrinsics {other.extrinsics} looks straight up or down; "
                "expected one that sees the person from a side"
            )
        yaw_rad = atan2(-float(ahead[1]), -float(ahead[0]))
        level = _about_vertical(yaw_rad)
        upright = other.camera.with_pitch(pitch_rad)
        turned = axes @ (upright.reference_to_optical_rotation() @ level).T
        roll_rad = atan2(float(turned[1, 0]), float(turned[0, 0]))
        upright, turn = _upright(upright, roll_rad)
        offset_m = level @ (axes.T @ other.extrinsics.translation_m)
        place = body.placement
        hips = np.array([-place.distance_m, place.lateral_m, place.hip_height_m])
        x_m, y_m, z_m = (level @ hips + offset_m).tolist()
        try:
            there = body.with_values(
                distance_m=-x_m, lateral_m=y_m, hip_height_m=z_m, camera_pitch_rad=pitch_rad
            )
        except BodyModelError as error:
            raise CameraError(
                f"a camera with the extrinsics {other.extrinsics} does not have the person in "
                f"front of it: {error}; check extrinsics and the order of the cameras"
            ) from None
        # The hips are at x - distance, y, z + height; only x, y and the yaw change with the turn.
        c, s = cos(yaw_rad), sin(yaw_rad)
        turned = np.eye(N_JOINTS + 2)
        turned[_X, _X], turned[_Y, _X], turned[_X, _Y], turned[_Y, _Y] = c, s, -s, c
        moved = np.zeros(N_JOINTS + 2)
        moved[_X] = offset_m[0] + there.placement.distance_m - c * place.distance_m
        moved[_Y] = offset_m[1] + s * place.distance_m
        moved[_Z] = offset_m[2] + place.hip_height_m - there.placement.hip_height_m
        moved[_YAW] = -yaw_rad
        return cls(there, upright, yaw_rad, offset_m, turn, turned, moved)

    def states(self, states: FloatArray) -> FloatArray:
        """Return states (N, 14) or (14,) of the first camera as this one has them."""
        moved: FloatArray = states @ self.turned + self.moved
        return moved

    def points(self, points_m: FloatArray) -> FloatArray:
        """Return points (..., 3) of the first camera's level frame in that of this one, metres."""
        moved: FloatArray = points_m @ _about_vertical(self.yaw_rad).T + self.offset_m
        return moved

    def upright(
        self,
        image: ImageArray,
        is_mask: bool = False,
        box: Sequence[int] | None = None,
    ) -> ImageArray:
        """Return an image (H, W) or (H, W, 3) of the camera turned upright.

        Args:
            image: of the camera.
            is_mask: what is beyond the image is 0, not like its border.
            box: column, row, width and height of what is asked for; the rest is 0.
        """
        if self.turn is None:
            return image
        border = cv2.BORDER_CONSTANT if is_mask else cv2.BORDER_REPLICATE
        turn = self.turn
        if box is not None:
            left, top, width, height = box
            if not width:
                return np.zeros((*turn.shape[:2], *image.shape[2:]), np.uint8)
            turn = turn[top : top + height, left : left + width]
        # The nearest pixel does for colours, too, which are averaged over 3x3 anyway.
        turned = cv2.remap(image, turn, _NO_FRACTIONS, cv2.INTER_NEAREST, borderMode=border)
        if box is None:
            return np.asarray(turned, np.uint8)
        whole = np.zeros((*self.turn.shape[:2], *image.shape[2:]), np.uint8)
        whole[top : top + height, left : left + width] = turned
        return whole

    def level_axes(self) -> FloatArray:
        """Return the rotation (3, 3) from the first level frame into the upright optical frame."""
        axes: FloatArray = self.camera.reference_to_optical_rotation() @ _about_vertical(
            self.yaw_rad
        )
        return axes

    def line_of_sight(self, bearing: float) -> tuple[FloatArray, FloatArray]:
        """Return the camera's place and the level direction (x, y) of a line of sight, each (2,).

        Metres in the first camera's level frame; ``bearing`` is aside over ahead.
        """
        level = _about_vertical(self.yaw_rad)
        place = -level.T @ self.offset_m
        direction = level.T @ np.array([-1.0, bearing, 0.0])
        return place[:2], direction[:2] / np.linalg.norm(direction[:2])


def _about_vertical(yaw_rad: float) -> FloatArray:
    """Return what turns a frame by ``yaw_rad`` about Z: coordinates in the turned one, (3, 3)."""
    c, s = cos(yaw_rad), sin(yaw_rad)
    return np.array([(c, s, 0.0), (-s, c, 0.0), (0.0, 0.0, 1.0)])


def _upright(camera: Camera, roll_rad: float) -> tuple[Camera, NDArray[np.int16] | None]:
    """Return the camera turned back by ``roll_rad`` about its axis, and the turn of its pixels."""
    if abs(roll_rad) < _UPRIGHT_RAD:
        return camera, None
    c, s = cos(roll_rad), sin(roll_rad)
    # The nearer of landscape and portrait keeps most of the image.
    if abs(s) > abs(c):
        upright = replace(
            camera, width=camera.height, height=camera.width, fx=camera.fy, fy=camera.fx
        )
    else:
        upright = camera
    # In raw pixels: K R K'^-1, with the middle of the upright image at the middle of the raw one.
    linear = np.array([(c * camera.fx, -s * camera.fx), (s * camera.fy, c * camera.fy)])
    linear /= np.array([upright.fx, upright.fy])
    middle = 0.5 * np.array([camera.width - 1.0, camera.height - 1.0])
    middle_upright = 0.5 * np.array([upright.width - 1.0, upright.height - 1.0])
    principal = np.array([camera.cx, camera.cy])
    cx, cy = (middle_upright + np.linalg.solve(linear, principal - middle)).tolist()
    shift = middle - linear @ middle_upright
    grid = np.stack(np.meshgrid(np.arange(upright.width), np.arange(upright.height)), -1)
    turn = np.rint(grid @ linear.T + shift).astype(np.int16)
    return replace(upright, cx=cx, cy=cy), turn
