"""Draw what a person has to do, to be read from two metres away: an outline and large text."""

from __future__ import annotations

import textwrap

import cv2

from cardbox_tracker.body.cardbox import cardbox_patches
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.drawing.overlay import (
    TEXT_BGR,
    ImageArray,
    draw_outline,
    enlarged,
)
from cardbox_tracker.vision.camera import Camera

WANTED_BGR = (0, 220, 255)

_FONT = cv2.FONT_HERSHEY_SIMPLEX
# As fractions of the image: a person two metres away reads it, and it leaves the head free.
_LINE_HEIGHT = 0.075
_NUMBER_HEIGHT = 0.22
_WIDTH = 0.95
_LINES = 2


def draw_guidance(
    image: ImageArray,
    body: BodyModel,
    camera: Camera,
    posture: FloatArray,
    words: str,
    number: int | None = None,
    scale: int = 1,
) -> ImageArray:
    """Return a colour image with an outline to stand in, what to do, and a big number.

    Args:
        image: (H, W) grey or silhouette, or (H, W, 3) bgr, of the camera's size.
        body: somebody of about the person's size, at their distance.
        camera: working camera.
        posture: the wanted posture (12,).
        words: written along the top, in two lines.
        number: seconds left, beside the head; None for none.
        scale: enlargement of the result.

    Returns:
        (scale H, scale W, 3) bgr.
    """
    canvas = enlarged(image, scale)
    view = camera.scaled(*canvas.shape[1::-1])
    patches = cardbox_patches(body, posture)
    width = max(2, round(canvas.shape[1] / 160))
    # A dark rim keeps the line visible before a white silhouette.
    draw_outline(canvas, view, patches, (0, 0, 0), width + 2)
    draw_outline(canvas, view, patches, WANTED_BGR, width)
    end = _draw_words(canvas, words)
    if number is not None:
        _draw_number(canvas, str(number), end)
    return canvas


def _draw_words(canvas: ImageArray, words: str) -> int:
    """Write along the top, on a darkened ground; return the row where it ends."""
    lines = textwrap.wrap(words, max(len(words) // _LINES + 8, 12))
    if not lines:
        return 0
    height, width = canvas.shape[:2]
    size = min(_size_of_width(line, width) for line in lines)
    size = min(size, _size_of_height(_LINE_HEIGHT * height))
    step = round(_LINE_HEIGHT * height * 1.3)
    end = min(int((len(lines) + 0.3) * step), int(height))
    canvas[:end] //= 4
    for number, line in enumerate(lines, 1):
        _put(canvas, line, size, number * step)
    return end


def _draw_number(canvas: ImageArray, text: str, top: int) -> None:
    """Write at the left edge, below ``top``: beside the head of somebody in the middle."""
    height, width = canvas.shape[:2]
    size = _size_of_height(_NUMBER_HEIGHT * height)
    thickness = _thickness(size)
    corner = (round(0.06 * width), top + round((_NUMBER_HEIGHT + 0.03) * height))
    cv2.putText(canvas, text, corner, _FONT, size, (0, 0, 0), thickness + 6, cv2.LINE_AA)
    cv2.putText(canvas, text, corner, _FONT, size, WANTED_BGR, thickness, cv2.LINE_AA)


def _put(canvas: ImageArray, text: str, size: float, bottom: int) -> None:
    thickness = _thickness(size)
    (width, _), _ = cv2.getTextSize(text, _FONT, size, thickness)
    left = (canvas.shape[1] - width) // 2
    cv2.putText(canvas, text, (left, bottom), _FONT, size, TEXT_BGR, thickness, cv2.LINE_AA)


def _size_of_height(height_px: float) -> float:
    return height_px / cv2.getTextSize("0", _FONT, 1.0, 1)[0][1]


def _size_of_width(text: str, width_px: int) -> float:
    # Bold letters are wider than thin ones, so they are measured as they are drawn, roughly.
    size = _size_of_height(_LINE_HEIGHT * width_px * 0.75)
    drawn_px = cv2.getTextSize(text, _FONT, size, _thickness(size))[0][0]
    return size * _WIDTH * width_px / max(drawn_px, 1)


def _thickness(size: float) -> int:
    return max(1, round(1.8 * size))
