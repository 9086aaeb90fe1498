"""Draw what a person shall do, to be read from two metres away: an outline and large text."""

from __future__ import annotations

from collections.abc import Sequence

import cv2

from cardbox_tracker.body.cardbox import cardbox_patches
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.drawing import (
    OUTLINE_SHIFT,
    TEXT_BGR,
    Picture,
    enlarged,
    outlines_of,
)

WANTED_BGR = (0, 220, 255)


def draw_guidance(
    picture: Picture,
    body: BodyModel,
    camera: Camera,
    posture: FloatArray,
    lines: Sequence[str],
    scale: int = 1,
) -> Picture:
    """Return a colour picture with an outline to stand in, and large text above it.

    Args:
        picture: (H, W) grey or silhouette, or (H, W, 3) bgr, of the camera's size.
        body: somebody of about the person's size, at their distance.
        camera: working camera.
        posture: the wanted posture (12,).
        lines: what to say, from the top; each is made as large as the width allows.
        scale: enlargement of the result.

    Returns:
        (scale H, scale W, 3) bgr.
    """
    canvas = enlarged(picture, scale)
    outlines = outlines_of(camera.scaled(*canvas.shape[1::-1]), cardbox_patches(body, posture))
    width = max(2, round(canvas.shape[1] / 160))
    # A dark rim keeps the line visible before a white silhouette.
    for colour, thickness in (((0, 0, 0), width + 2), (WANTED_BGR, width)):
        cv2.polylines(canvas, outlines, True, colour, thickness, cv2.LINE_AA, OUTLINE_SHIFT)
    top = 0
    for line in lines:
        top = _draw_large(canvas, line, top)
    return canvas


def _draw_large(canvas: Picture, text: str, top: int) -> int:
    """Write a line as wide as the canvas, at most a sixth of its height; return where it ends."""
    height, width = canvas.shape[:2]
    font = cv2.FONT_HERSHEY_DUPLEX
    (plain_width, plain_height), below = cv2.getTextSize(text, font, 1.0, 1)
    size = min(0.94 * width / max(plain_width, 1), height / 6 / (plain_height + below))
    thickness = max(1, round(1.6 * size))
    bottom = round(top + (plain_height + 0.8 * below) * size)
    end = int(bottom + below * size)
    canvas[top:end] //= 3
    left = (width - round(plain_width * size)) // 2
    cv2.putText(canvas, text, (left, bottom), font, size, TEXT_BGR, thickness, cv2.LINE_AA)
    return end
