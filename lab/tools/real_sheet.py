"""Make pictures of real people for documents, blurred, with their source."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.applications.drawing.overlay import draw_overlay
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.tracking.estimate import Estimate

Image = NDArray[np.uint8]
FloatArray = NDArray[np.float64]
Shown = tuple[Image, Image, FloatArray, BodyModel, Estimate]
"""Image (H, W, 3), mask (H, W), landmarks (6, 2) in px, body and estimate."""

REFERENCE_BGR = (255, 255, 0)
"""Colour of the joints to which the model is compared."""

ATTRIBUTION = (
    "Pictures: github.com/intel-iot-devkit/sample-videos, Intel Corporation, CC BY 4.0; changed: "
    "cut, faces and surroundings blurred, model and landmarks drawn"
)

COLUMNS = 5
"""Pictures in a row."""


def contact_sheet(shown: Sequence[Shown], camera: Camera) -> Image:
    """Return pictures (H, W, 3) with model and landmarks side by side; faces are blurred."""
    tiles = []
    for image, mask, landmarks_px, body, estimate in shown:
        hidden = blurred(image, mask, landmarks_px)
        view = camera.with_pitch(body.camera_pose.pitch_rad)
        tile = draw_overlay(hidden, body, view, estimate)
        for u, v in landmarks_px[np.isfinite(landmarks_px).all(axis=1)]:
            cv2.circle(tile, (round(u), round(v)), 3, REFERENCE_BGR, -1, cv2.LINE_AA)
        tiles.append(tile)
    return side_by_side(tiles, (ATTRIBUTION,))


def side_by_side(tiles: Sequence[Image], lines: Sequence[str]) -> Image:
    """Return pictures (H, W, 3) of one size in rows of ``COLUMNS``, and lines of text."""
    height, width = tiles[0].shape[:2]
    strip = np.zeros((24 * len(lines), COLUMNS * width, 3), np.uint8)
    for number, line in enumerate(lines):
        place = (6, 24 * number + 17)
        cv2.putText(strip, line, place, 0, 0.5, (255, 255, 255), 1, cv2.LINE_AA)
    every = [*tiles, *[np.zeros((height, width, 3), np.uint8)] * (-len(tiles) % COLUMNS)]
    rows = [np.hstack(every[n : n + COLUMNS]) for n in range(0, len(every), COLUMNS)]
    return np.asarray(np.vstack([*rows, strip]), np.uint8)


def blurred(image: Image, mask: Image, landmarks_px: FloatArray) -> Image:
    """Return an image (H, W, 3) in which only the person below the shoulders is sharp.

    Others may be in the image as well, so everything beside the person is blurred, too.
    """
    small = cv2.resize(image, (20, 15), interpolation=cv2.INTER_AREA)
    coarse = cv2.resize(small, image.shape[1::-1], interpolation=cv2.INTER_LINEAR)
    sharp = mask > 0
    shoulders = landmarks_px[[0, 3], 1]
    if not np.isfinite(shoulders).all():
        return np.asarray(coarse, np.uint8)
    # A hand before the face is blurred, too.
    sharp[: max(0, int(shoulders.min()) - 2)] = False
    return np.where(sharp[..., None], image, coarse).astype(np.uint8)
