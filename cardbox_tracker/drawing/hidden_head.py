"""Makes the head of the tracked person unrecognizable in an image."""

from __future__ import annotations

import cv2
import numpy as np

from cardbox_tracker.body.cardbox import PATCH_NAMES, cardbox_patches
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.detection.image_points import POINT_INDEX, ImagePoints
from cardbox_tracker.drawing.overlay import ImageArray
from cardbox_tracker.estimation.estimate import Estimate
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.rasterisation import clip_near

_HEAD = [PATCH_NAMES.index("head_frontal"), PATCH_NAMES.index("head_sagittal")]
_FACE = [POINT_INDEX[name] for name in ("nose", "left_eye", "right_eye", "left_ear", "right_ear")]
# Share of the head's size that is added on each side, since the model's head does not nod.
_MARGIN = 0.5
# Coarse pixels across the region, about three of which cover the face.
_BLOCKS = 6


def with_hidden_head(
    image: ImageArray,
    body: BodyModel,
    camera: Camera,
    estimate: Estimate,
    points: ImagePoints | None = None,
) -> ImageArray:
    """Return a copy of ``image`` with coarse pixels around the head.

    Args:
        image: (H, W) or (H, W, 3), of the camera's size.
        body: the measured person.
        camera: with the pitch of the body model.
        estimate: an estimate; without a posture, or with the head behind the camera, the whole
            image becomes coarse.
        points: of a detector in this image; those of the face are covered, too.
    """
    hidden = image.copy()
    height, width = image.shape[:2]
    left, top, right, bottom = _region(body, camera, estimate, points) or (0, 0, width, height)
    part = hidden[max(0, top) : max(0, bottom), max(0, left) : max(0, right)]
    if part.size:
        high, wide = part.shape[:2]
        blocks = (_BLOCKS, max(1, round(_BLOCKS * high / wide)))
        coarse = cv2.resize(part, blocks, interpolation=cv2.INTER_AREA)
        part[:] = cv2.resize(coarse, (wide, high), interpolation=cv2.INTER_NEAREST)
    return hidden


def _region(
    body: BodyModel, camera: Camera, estimate: Estimate, points: ImagePoints | None
) -> tuple[int, int, int, int] | None:
    """Return left, top, right and bottom of the head with its margin, px; None if unknown."""
    if estimate.posture is None:
        return None
    patches = cardbox_patches(estimate.placed(body), estimate.posture)[_HEAD]
    visible = [clip_near(corners) for corners in camera.reference_to_optical(patches)]
    corners: list[FloatArray] = [camera.project(polygon) for polygon in visible if len(polygon)]
    if not corners:
        return None
    head = np.concatenate(corners)
    margin = _MARGIN * np.ptp(head, axis=0).max()
    if points is not None:
        face = points.px[_FACE]
        head = np.concatenate([head, face[np.isfinite(face).all(axis=1)]])
    (left, top), (right, bottom) = head.min(axis=0) - margin, head.max(axis=0) + margin
    return int(left), int(top), int(np.ceil(right)), int(np.ceil(bottom))
