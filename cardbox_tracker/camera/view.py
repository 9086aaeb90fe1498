"""A further camera as an upright camera with transformed states.

All parts of the tracker assume an upright camera, level except for its pitch, before a person at a
distance. A further camera becomes such a camera if its image is turned upright and states refer to
its own level frame, which is rotated about the vertical and translated against the first camera's.
This changes ``torso_y``, ``torso_yaw``, ``torso_x`` and ``torso_z`` of a state (14,); roll, pitch
and arms are the same. So a further camera needs no other kernels.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import asin, atan2, cos, hypot, sin
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.extrinsics import Extrinsics
from cardbox_tracker.common.compiling import kernel
from cardbox_tracker.common.errors import BodyModelError, CameraError
from cardbox_tracker.common.settings import of_kind
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import N_STATE, TORSO_X, TORSO_Y, TORSO_Z, YAW
from cardbox_tracker.person.sizes import FloatArray

AnyImage = NDArray[Any]
LevelPoint = tuple[float, float]
"""Coordinates x and y of a point or a direction in a level frame, metres."""

_NO_FRACTIONS = np.empty(0, np.uint16)
# An image with less roll is not turned: the error at the border is a fifth of a pixel at 320 px.
_UPRIGHT_RAD = 0.001


@dataclass(frozen=True)
class OtherCamera:
    """A further camera."""

    camera: Camera  #: at the working resolution, without its pitch
    extrinsics: Extrinsics  #: its pose relative to the first camera

    def __post_init__(self) -> None:
        """Check the values; ValueError, or CameraError for a pose that is none."""
        of_kind("camera", self.camera, Camera)
        pose = of_kind("extrinsics", self.extrinsics, Extrinsics)
        parts = pose.rotation, pose.translation_m
        is_shaped = [*map(np.shape, parts)] == [(3, 3), (3,)]
        Extrinsics.of(np.column_stack(parts) if is_shaped else parts, "the pose of another camera")


@dataclass(frozen=True, eq=False)
class View:
    """One body before a further camera.

    The state in the frame of this camera is ``turned`` @ (state of the first camera) + ``moved``.
    """

    body: BodyModel  #: the person, placed before that camera
    camera: Camera  #: that camera, turned upright
    yaw_rad: float  #: rotation of its level frame about the vertical
    roll_rad: float  #: rotation of its image about the optical axis, which the upright camera lacks
    #: translation from the first level frame into its own, after the rotation, (3,).
    offset_m: FloatArray
    #: pixel of the camera's image for each pixel of the upright image, (H, W, 2) int16; None if the
    #: camera stands upright.
    turn: NDArray[np.int16] | None
    #: map from pixels of the upright image to those of the camera's image, (2, 3).
    raw_px: FloatArray
    turned: FloatArray  #: (14, 14)
    moved: FloatArray  #: (14,)

    @classmethod
    def of(cls, body: BodyModel, first: Camera, other: OtherCamera) -> View:
        """Return the view of ``body`` before ``first``, which includes its pitch.

        Raises CameraError if the other camera looks straight up or down, stands where the first one
        does, or does not have the person in front of it.
        """
        other.extrinsics.check()
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
        upright, turn, raw_px = _upright(upright, roll_rad)
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
        # The hips are at x - distance, y, z + height; the rotation only changes x, y and the yaw.
        c, s = cos(yaw_rad), sin(yaw_rad)
        turned = np.eye(N_STATE)
        turned[TORSO_X, TORSO_X], turned[TORSO_X, TORSO_Y] = c, -s
        turned[TORSO_Y, TORSO_X], turned[TORSO_Y, TORSO_Y] = s, c
        moved = np.zeros(N_STATE)
        moved[TORSO_X] = offset_m[0] + there.placement.distance_m - c * place.distance_m
        moved[TORSO_Y] = offset_m[1] + s * place.distance_m
        moved[TORSO_Z] = offset_m[2] + place.hip_height_m - there.placement.hip_height_m
        moved[YAW] = -yaw_rad
        return cls(there, upright, yaw_rad, roll_rad, offset_m, turn, raw_px, turned, moved)

    def states(self, states: FloatArray) -> FloatArray:
        """Return states (N, 14) or (14,) of the first camera in the frame of this camera."""
        here = np.ascontiguousarray(states, np.float64)
        there: FloatArray = _moved_states(here.reshape(-1, N_STATE), self.turned, self.moved)
        return there.reshape(here.shape)

    def points(self, points_m: FloatArray) -> FloatArray:
        """Return points (..., 3) of the first level frame in this camera's level frame, metres."""
        moved: FloatArray = points_m @ _about_vertical(self.yaw_rad).T + self.offset_m
        return moved

    def upright(self, image: AnyImage, is_mask: bool = False) -> AnyImage:
        """Return an image (H, W) or (H, W, 3) turned upright; a mask is 0 beyond its border."""
        if self.turn is None:
            return image
        border = cv2.BORDER_CONSTANT if is_mask else cv2.BORDER_REPLICATE
        # The nearest pixel suffices for colours, too, because they are averaged over 3x3 pixels.
        turned = cv2.remap(image, self.turn, _NO_FRACTIONS, cv2.INTER_NEAREST, borderMode=border)
        return np.asarray(turned, image.dtype)

    def upright_px(self, px: FloatArray) -> FloatArray:
        """Return where pixels (N, 2) of the camera's image lie in the upright image."""
        linear, shift = self.raw_px[:, :2], self.raw_px[:, 2]
        turned: FloatArray = (px - shift) @ np.linalg.inv(linear).T.astype(np.float64)
        return turned

    def level_axes(self) -> FloatArray:
        """Return the rotation (3, 3) from the first level frame into the upright optical frame."""
        axes: FloatArray = self.camera.reference_to_optical_rotation() @ _about_vertical(
            self.yaw_rad
        )
        return axes

    def line_of_sight(self, bearing: float) -> tuple[LevelPoint, LevelPoint]:
        """Return the camera's place and the unit direction of a line of sight, metres.

        Both are in the first level frame; ``bearing`` is the lateral coordinate divided by the
        depth.
        """
        c, s = cos(self.yaw_rad), sin(self.yaw_rad)
        x_m, y_m, _ = self.offset_m.tolist()
        length = hypot(1.0, bearing)
        ahead = (-c - s * bearing) / length, (c * bearing - s) / length
        return (s * y_m - c * x_m, -s * x_m - c * y_m), ahead


@kernel
def _moved_states(states: FloatArray, turned: FloatArray, moved: FloatArray) -> FloatArray:
    """Return states (N, 14) @ ``turned`` + ``moved``; only the place on the floor is turned."""
    there = states + moved
    for i in range(states.shape[0]):
        x_m, y_m = states[i, TORSO_X], states[i, TORSO_Y]
        for j in (TORSO_X, TORSO_Y):
            there[i, j] = x_m * turned[TORSO_X, j] + y_m * turned[TORSO_Y, j] + moved[j]
    return there


def _about_vertical(yaw_rad: float) -> FloatArray:
    """Return the matrix (3, 3) of coordinates in a frame that is rotated by ``yaw_rad`` about Z."""
    c, s = cos(yaw_rad), sin(yaw_rad)
    return np.array([(c, s, 0.0), (-s, c, 0.0), (0.0, 0.0, 1.0)])


def _upright(
    camera: Camera, roll_rad: float
) -> tuple[Camera, NDArray[np.int16] | None, FloatArray]:
    """Return the camera without its roll ``roll_rad``, and the source of each upright pixel."""
    if abs(roll_rad) < _UPRIGHT_RAD:
        return camera, None, np.eye(2, 3)
    c, s = cos(roll_rad), sin(roll_rad)
    # The orientation (landscape or portrait) that needs less rotation keeps most of the image.
    if abs(s) > abs(c):
        upright = replace(
            camera, width=camera.height, height=camera.width, fx=camera.fy, fy=camera.fx
        )
    else:
        upright = camera
    # The homography is K R K'^-1; the middle of the upright image maps to that of the raw image.
    linear = np.array([(c * camera.fx, -s * camera.fx), (s * camera.fy, c * camera.fy)])
    linear /= np.array([upright.fx, upright.fy])
    middle = 0.5 * np.array([camera.width - 1.0, camera.height - 1.0])
    middle_upright = 0.5 * np.array([upright.width - 1.0, upright.height - 1.0])
    principal = np.array([camera.cx, camera.cy])
    cx, cy = (middle_upright + np.linalg.solve(linear, principal - middle)).tolist()
    shift = middle - linear @ middle_upright
    grid = np.stack(np.meshgrid(np.arange(upright.width), np.arange(upright.height)), -1)
    turn = np.rint(grid @ linear.T + shift).astype(np.int16)
    return replace(upright, cx=cx, cy=cy), turn, np.column_stack([linear, shift])
