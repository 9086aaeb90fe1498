"""Draw the model over a picture: outline, skeleton, and how well it fits."""

from __future__ import annotations

from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.cardbox import cardbox_patches
from cardbox_tracker.body.kinematics import forward_kinematics
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.rasterisation import NEAR_PLANE_M, clip_near

Picture = NDArray[np.uint8]

OUTLINE_BGR = (60, 200, 60)
SKELETON_BGR = (0, 140, 255)
JOINT_BGR = (255, 255, 255)
TEXT_BGR = (255, 255, 255)

_SHIFT = 4


class Drawable(Protocol):
    """What an overlay shows of an estimate."""

    @property
    def state(self) -> str:
        """Tracking state."""

    @property
    def posture(self) -> FloatArray | None:
        """d1..d12, or None."""

    @property
    def cost_px(self) -> int | None:
        """Equation (2), or None."""

    @property
    def iou(self) -> float | None:
        """Fit, or None."""


def draw_overlay(
    picture: Picture, body: BodyModel, camera: Camera, estimate: Drawable, scale: int = 1
) -> Picture:
    """Return a colour picture with the model of ``estimate`` drawn over it.

    Args:
        picture: (H, W) grey or silhouette, or (H, W, 3) bgr, of the camera's size.
        body: the measured person.
        camera: working camera, pitched as the body model says.
        estimate: what to draw; without a posture only its state is written.
        scale: enlargement of the result, so that thin lines and text stay readable.

    Returns:
        (scale H, scale W, 3) bgr.
    """
    height, width = picture.shape[:2]
    size = (scale * width, scale * height)
    resized = cv2.resize(_bgr(picture), size, interpolation=cv2.INTER_LINEAR)
    canvas = np.asarray(resized, dtype=np.uint8)
    text = estimate.state.replace("_", " ")
    if estimate.posture is not None:
        view = camera.scaled(*size)
        draw_model(canvas, body, view, estimate.posture)
        text += f"  IoU {estimate.iou:.2f}  {estimate.cost_px} px"
    draw_text(canvas, text)
    return canvas


def draw_model(canvas: Picture, body: BodyModel, camera: Camera, posture: FloatArray) -> None:
    """Draw outline and skeleton of ``posture`` (12,) into ``canvas`` (H, W, 3), in place."""
    model = np.zeros(canvas.shape[:2], np.uint8)
    for corners in camera.reference_to_optical(cardbox_patches(body, posture)):
        polygon = clip_near(corners)
        if len(polygon) > 2:
            pixels = _subpixels(camera.project(polygon))
            cv2.fillConvexPoly(model, pixels, 255, cv2.LINE_8, _SHIFT)
    outlines, _ = cv2.findContours(model, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    thickness = max(1, round(camera.width / 400))
    cv2.drawContours(canvas, outlines, -1, OUTLINE_BGR, thickness, cv2.LINE_AA)
    frames = forward_kinematics(body, posture)
    chains = [
        [frames.hip, frames.neck, frames.head],
        [frames.neck, *frames.left[:3]],
        [frames.neck, *frames.right[:3]],
    ]
    for chain in chains:
        points = camera.reference_to_optical(np.array(chain))
        if np.any(points[:, 2] < NEAR_PLANE_M):
            continue
        pixels = _subpixels(camera.project(points))
        cv2.polylines(canvas, [pixels], False, SKELETON_BGR, thickness + 1, cv2.LINE_AA, _SHIFT)
        for pixel in pixels:
            cv2.circle(
                canvas,
                (int(pixel[0]), int(pixel[1])),
                (thickness + 1) << _SHIFT,
                JOINT_BGR,
                -1,
                cv2.LINE_AA,
                _SHIFT,
            )


def draw_text(canvas: Picture, text: str, line: int = 0) -> None:
    """Write ``text`` into the upper left corner of ``canvas``, in place; ``line`` counts down."""
    scale = canvas.shape[1] / 700
    font, size, thickness = cv2.FONT_HERSHEY_SIMPLEX, 0.75 * scale, max(1, round(1.5 * scale))
    (width, height), below = cv2.getTextSize(text, font, size, thickness)
    margin = round(8 * scale)
    left, bottom = margin, margin + height + line * (height + below + margin)
    # On a dark ground the text stays readable before any wall.
    corner = (left + width + margin // 2, bottom + below)
    cv2.rectangle(
        canvas, (left - margin // 2, bottom - height - margin // 2), corner, (0, 0, 0), -1
    )
    cv2.putText(canvas, text, (left, bottom), font, size, TEXT_BGR, thickness, cv2.LINE_AA)


def _subpixels(pixels: FloatArray) -> NDArray[np.int32]:
    """Pixel coordinates as OpenCV's drawing takes them, with ``_SHIFT`` fractional bits."""
    clipped = np.clip(pixels, -30_000, 30_000)
    return np.asarray(np.round(clipped * (1 << _SHIFT)), dtype=np.int32)


def _bgr(picture: Picture) -> Picture:
    if picture.ndim == 3:
        return picture
    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR), dtype=np.uint8)
