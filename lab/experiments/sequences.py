"""Image sequences in the style of the paper's figures (experiment 7).

Each column is an image; the rows have the best estimate, the matching result and the raw image.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import clip_near, render
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import atomic_path
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.terms.silhouette import rows_above_hips
from lab.experiments.sessions import Session

ImageArray = NDArray[np.uint8]

_GAP_PX = 4
_SCALE = 0.6
"""Scale of the figure, which keeps the file small."""
_SHIFT = 8
_FILL_BGR = (214, 190, 150)
_EDGE_BGR = (70, 40, 20)


def write_sequence(
    session: Session, indices: Sequence[int], postures: NDArray[np.float64], path: Path
) -> None:
    """Write the figure of the images ``indices`` (k) with the estimates ``postures`` (k, 12)."""
    images = dict(zip(session.shown.tolist(), session.images, strict=True))
    columns = [
        np.concatenate(
            _with_gaps(
                [
                    draw_estimate(session.body, session.camera, posture),
                    draw_difference(session, index, posture),
                    _bgr(images[int(index)]),
                ],
                axis=0,
            )
        )
        for index, posture in zip(indices, postures, strict=True)
    ]
    large = np.concatenate(_with_gaps(columns, axis=1), axis=1)
    figure = cv2.resize(large, None, fx=_SCALE, fy=_SCALE, interpolation=cv2.INTER_AREA)
    with atomic_path(path) as temporary:
        if not cv2.imwrite(str(temporary), figure):
            raise CardboxError(f"cannot write {path}")


def draw_estimate(body: BodyModel, camera: Camera, posture: NDArray[np.float64]) -> ImageArray:
    """Return the model's patches on white, (H, W, 3) bgr, the nearest on top."""
    canvas = np.full((camera.height, camera.width, 3), 255, np.uint8)
    if np.any(np.isnan(posture)):
        return canvas
    corners_m = camera.reference_to_optical(cardbox_patches(body, posture))
    for corners in corners_m[np.argsort(-corners_m[..., 2].mean(axis=1))]:
        visible = clip_near(corners)
        if len(visible) > 2:
            polygon = np.round(camera.project(visible) * (1 << _SHIFT)).astype(np.int32)
            cv2.fillConvexPoly(canvas, polygon, _FILL_BGR, cv2.LINE_AA, _SHIFT)
            cv2.polylines(canvas, [polygon], True, _EDGE_BGR, 1, cv2.LINE_AA, _SHIFT)
    return canvas


def draw_difference(session: Session, index: int, posture: NDArray[np.float64]) -> ImageArray:
    """Return the pixels that the cost counts, white on black; rows below the hips are grey."""
    camera = session.camera
    rows = rows_above_hips(session.body, camera)
    difference = np.full((camera.height, camera.width), 64, np.uint8)
    difference[:rows] = session.silhouettes[index][:rows]
    if not np.any(np.isnan(posture)):
        difference[:rows] ^= render(cardbox_patches(session.body, posture), camera, rows)
    return _bgr(difference)


def _bgr(image: ImageArray) -> ImageArray:
    return np.repeat(image[..., None], 3, axis=2)


def _with_gaps(images: Sequence[ImageArray], axis: int) -> list[ImageArray]:
    parts: list[ImageArray] = []
    for image in images:
        if parts:
            shape = list(image.shape)
            shape[axis] = _GAP_PX
            parts.append(np.full(shape, 160, np.uint8))
        parts.append(image)
    return parts
