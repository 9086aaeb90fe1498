"""The cameras of a synthetic session, placed around the person."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import OPTICAL_FRAME, Camera
from cardbox_tracker.camera.extrinsics import Extrinsics
from cardbox_tracker.camera.pairing import MOST_CAMERAS
from cardbox_tracker.camera.view import OtherCamera, View
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import PLACE, POSTURE

FRAME_ID = OPTICAL_FRAME

# Azimuths of the cameras towards the person's left, degrees; all have the same distance.
_ROUND_DEG = (0.0, 65.0, -55.0, 110.0)


@dataclass(frozen=True)
class SyntheticCamera:
    """One camera of a session.

    Attributes:
        name: namespace of its topics.
        camera: intrinsics and pitch.
        extrinsics: transform from the optical frame of the first camera to this one's.
        view: transform of body states to a further camera; None for the first camera.
    """

    name: str
    camera: Camera
    extrinsics: Extrinsics
    view: View | None = None

    @property
    def image_topic(self) -> str:
        """Topic of the images."""
        return f"/{self.name}/image_raw"

    @property
    def info_topic(self) -> str:
        """Topic of the CameraInfo."""
        return f"/{self.name}/camera_info"

    @property
    def frame_id(self) -> str:
        """Name of the optical frame."""
        return f"{self.name}_optical_frame"

    def seen(
        self, body: BodyModel, posture: NDArray[np.float64]
    ) -> tuple[BodyModel, NDArray[np.float64]]:
        """Return body and posture (12,) in this camera's reference frame."""
        if self.view is None:
            return body, posture
        there = self.view.states(np.append(posture, [0.0, 0.0]))
        place = self.view.body.placement
        x_m, z_m = there[PLACE].tolist()
        moved = self.view.body.with_values(
            distance_m=place.distance_m - x_m, hip_height_m=place.hip_height_m + z_m
        )
        return moved, there[POSTURE]

    def truth(self) -> dict[str, Any]:
        """Return the camera's entry of ``ground_truth.json``."""
        rows = np.column_stack([self.extrinsics.rotation, self.extrinsics.translation_m])
        return {
            "name": self.name,
            "width": self.camera.width,
            "height": self.camera.height,
            "focal_px": self.camera.fx,
            "cx": self.camera.cx,
            "cy": self.camera.cy,
            "frame_id": self.frame_id,
            "image_topic": self.image_topic,
            "info_topic": self.info_topic,
            "from_first": [*rows.tolist(), [0.0, 0.0, 0.0, 1.0]],
        }


def synthetic_cameras(body: BodyModel, first: Camera, count: int) -> list[SyntheticCamera]:
    """Return ``count`` cameras like ``first``; the person, placed as in ``body``, faces the first.

    All have the height of the first camera and look at the person.

    Raises:
        CardboxError: ``count`` is out of range.
    """
    if not 1 <= count <= MOST_CAMERAS:
        raise CardboxError(f"{count} cameras were requested; expected 1 to {MOST_CAMERAS}")
    alone = Extrinsics(np.eye(3), np.zeros(3))
    if count == 1:
        return [SyntheticCamera("camera", first, alone)]
    cameras = [SyntheticCamera("cam0", first, alone)]
    upright = first.reference_to_optical_rotation()
    place = body.placement
    middle = np.array([-place.distance_m, place.lateral_m, 0.0])
    for number, angle in enumerate(np.radians(_ROUND_DEG[1:count]).tolist(), 1):
        c, s = np.cos(angle), np.sin(angle)
        # A level frame turned about the vertical through the person.
        level = np.array([(c, s, 0.0), (-s, c, 0.0), (0.0, 0.0, 1.0)])
        centre = middle + level.T @ np.array([place.distance_m, 0.0, 0.0])
        rotation = upright @ level @ upright.T
        where = Extrinsics(rotation, -upright @ level @ centre)
        view = View.of(body, first, OtherCamera(first.with_pitch(0.0), where))
        cameras.append(SyntheticCamera(f"cam{number}", view.camera, where, view))
    return cameras
