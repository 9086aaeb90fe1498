"""Draws instructions that are readable from two metres: an outline, few words, a big number."""

from __future__ import annotations

import textwrap
from typing import NamedTuple

import cv2
import numpy as np

from cardbox_tracker.body.cardbox import cardbox_patches
from cardbox_tracker.body.kinematics import pose
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.parts import body_parts
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.drawing.overlay import TEXT_BGR, ImageArray, draw_outline, enlarged
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.rasterisation import in_front

Bgr = tuple[int, int, int]

FIT_BGR: dict[str, Bgr] = {"far": (60, 60, 255), "nearly": (0, 190, 255), "fits": (70, 220, 70)}
"""Colour of the outline by the fit of the person: red, amber or green."""
MOOD_BGR: dict[str, Bgr] = {"ask": (50, 40, 30), "good": (50, 120, 30), "bad": (30, 60, 170)}
"""Background of the words by their mood: a request, praise or a refusal."""

_FONT = cv2.FONT_HERSHEY_DUPLEX
# Fractions of the image's height and width.
_BAND, _LINE_HEIGHT, _NUMBER_HEIGHT = 0.30, 0.095, 0.24
_WIDTH = 0.94
_LINES = 2
# Fractions of the image's width.
_OUTLINE, _ARROW = 1 / 110, 1 / 45
_NOSE_M, _NOSE_HALF_M = 0.08, 0.045
# Sideways component of the facing direction above which nose and arrow are drawn.
_SIDEWAYS = 0.5


class Asked(NamedTuple):
    """The posture that a person is asked to take.

    Attributes:
        body: a body of about the person's size, at their place.
        camera: camera at the working resolution, with the pitch of the body model.
        posture: (12,), rad and metres.
        fit: fit of the person to the posture: ``far``, ``nearly`` or ``fits``.
    """

    body: BodyModel
    camera: Camera
    posture: FloatArray
    fit: str = "far"


def draw_guidance(
    image: ImageArray,
    words: str,
    mood: str = "ask",
    number: int | None = None,
    asked: Asked | None = None,
    scale: int = 1,
    mirror: bool = False,
) -> ImageArray:
    """Return a colour image with instructions for a person and the words in a band above it.

    Args:
        image: (H, W) grey or silhouette, or (H, W, 3) bgr, of the camera's size.
        words: a few words, which are written in at most two lines.
        mood: colour of the band: ``ask``, ``good`` or ``bad``.
        number: seconds left, beside the head; None for no number.
        asked: outline to stand in, with nose and arrow if it looks aside; None for no outline.
        scale: enlargement of the result.
        mirror: mirror the image, but not words and number.

    Returns:
        (1.3 scale H, scale W, 3) bgr.
    """
    canvas = enlarged(image, scale)
    if asked is not None:
        _draw_asked(canvas, asked)
    if mirror:
        canvas = np.ascontiguousarray(canvas[:, ::-1])
    if number is not None:
        _draw_number(canvas, str(number))
    if asked is not None and asked.fit == "fits":
        _draw_tick(canvas)
    return np.vstack([_band(words, mood, canvas.shape[1], canvas.shape[0]), canvas])


def _draw_asked(canvas: ImageArray, asked: Asked) -> None:
    view = asked.camera.scaled(*canvas.shape[1::-1])
    colour = FIT_BGR[asked.fit]
    width = max(2, round(canvas.shape[1] * _OUTLINE))
    patches = cardbox_patches(asked.body, asked.posture)
    # A dark rim keeps the line visible on a white silhouette.
    draw_outline(canvas, view, patches, (0, 0, 0), width + 4)
    draw_outline(canvas, view, patches, colour, width)
    frames = pose(asked.body, asked.posture)
    forward = frames.torso_rotation[:, 0]
    if abs(float(forward[1])) > _SIDEWAYS:
        depth_m = body_parts(asked.body.sizes).head.depth_m
        _draw_nose(canvas, view, frames.head, forward, depth_m, colour)
        _draw_turn(canvas, view, frames.hip, 1 if forward[1] > 0 else -1)


def _draw_nose(
    canvas: ImageArray,
    view: Camera,
    head_m: FloatArray,
    forward: FloatArray,
    depth_m: float,
    colour: Bgr,
) -> None:
    """Draw the nose of a person who looks in the direction ``forward``."""
    face, up = head_m + 0.5 * depth_m * forward, np.array([0.0, 0.0, _NOSE_HALF_M])
    points = view.reference_to_optical(np.array([face + up, face + _NOSE_M * forward, face - up]))
    if not in_front(points).all():
        return
    corners = np.round(view.project(points)).astype(np.int32)
    width = max(2, round(canvas.shape[1] * _OUTLINE))
    cv2.fillConvexPoly(canvas, corners, colour, cv2.LINE_AA)
    cv2.polylines(canvas, [corners], True, (0, 0, 0), max(1, width // 2), cv2.LINE_AA)


def _draw_turn(canvas: ImageArray, view: Camera, hip_m: FloatArray, side: int) -> None:
    """Draw an arrow around the body, from the front to the right (``side`` 1) or the left (-1)."""
    height, width = canvas.shape[:2]
    hip = view.reference_to_optical(hip_m)
    if not in_front(hip[None]).all():
        return
    column = float(np.clip(view.project(hip)[0], 0.25 * width, 0.75 * width))
    row, wide, high = 0.74 * height, 0.2 * width, 0.1 * height
    # The arrow leads from the bottom of the ellipse to the direction in which the face will point.
    turned = np.radians(np.linspace(115.0, 8.0, 24))
    points = np.stack([column + side * wide * np.cos(turned), row + high * np.sin(turned)], axis=1)
    tip = points[-1] + (0.0, -0.16 * height)
    line = np.round(points).astype(np.int32)
    base = np.array([(0.075 * width, 0.0), (-0.075 * width, 0.0)])
    head = np.round(np.vstack([tip, points[-1] + base])).astype(np.int32)
    thick = max(2, round(width * _ARROW))
    for colour, grow in (((0, 0, 0), 6), (TEXT_BGR, 0)):
        cv2.polylines(canvas, [line], False, colour, thick + grow, cv2.LINE_AA)
        cv2.fillConvexPoly(canvas, head, colour, cv2.LINE_AA)
        if grow:
            cv2.polylines(canvas, [head], True, colour, grow, cv2.LINE_AA)


def _draw_number(canvas: ImageArray, text: str) -> None:
    """Write the number in the upper left corner, beside the head of a person in the middle."""
    height, width = canvas.shape[:2]
    size = _size_of_height(_NUMBER_HEIGHT * height)
    thickness = _thickness(size)
    corner = (round(0.04 * width), round((_NUMBER_HEIGHT + 0.05) * height))
    cv2.putText(canvas, text, corner, _FONT, size, (0, 0, 0), 2 * thickness, cv2.LINE_AA)
    cv2.putText(canvas, text, corner, _FONT, size, TEXT_BGR, thickness, cv2.LINE_AA)


def _draw_tick(canvas: ImageArray) -> None:
    """Draw a tick in the upper right corner, for people who cannot tell red from green."""
    height, width = canvas.shape[:2]
    tall = _NUMBER_HEIGHT * height
    corner = np.array([0.96 * width - 1.1 * tall, 0.05 * height])
    parts = corner + tall * np.array([(0.0, 0.55), (0.38, 0.92), (1.1, 0.1)])
    tick = np.round(parts).astype(np.int32)
    thick = max(2, round(0.14 * tall))
    for colour, grow in (((0, 0, 0), 6), (FIT_BGR["fits"], 0)):
        cv2.polylines(canvas, [tick], False, colour, thick + grow, cv2.LINE_AA)


def _band(words: str, mood: str, width: int, height: int) -> ImageArray:
    """Return a band with the words, ``width`` px wide, for an image of ``height`` px."""
    tall = round(_BAND * height)
    band = np.full((tall, width, 3), MOOD_BGR[mood], np.uint8)
    lines = _two_lines(words)
    if not lines:
        return band
    size = min(_size_of_width(line, width) for line in lines)
    size = min(size, _size_of_height(_LINE_HEIGHT * height))
    for number, line in enumerate(lines):
        middle = tall * (2 * number + 1) / (2 * len(lines))
        _put(band, line, size, middle)
    return band


def _two_lines(words: str) -> list[str]:
    """Return few words in one line, or else two lines of lengths as equal as possible."""
    if len(words) <= 16:
        return [words] if words else []
    for width in range(len(words) // _LINES, len(words) + 1):
        lines = textwrap.wrap(words, width)
        if len(lines) <= _LINES:
            return lines
    return [words]


def _put(canvas: ImageArray, text: str, size: float, middle: float) -> None:
    thickness = _thickness(size)
    (width, height), _ = cv2.getTextSize(text, _FONT, size, thickness)
    left = (canvas.shape[1] - width) // 2
    corner = (left, round(middle + height / 2))
    cv2.putText(canvas, text, corner, _FONT, size, TEXT_BGR, thickness, cv2.LINE_AA)


def _size_of_height(height_px: float) -> float:
    return height_px / cv2.getTextSize("0", _FONT, 1.0, 1)[0][1]


def _size_of_width(text: str, width_px: int) -> float:
    # Bold letters are wider, so the width is measured at the thickness that is drawn.
    size = _size_of_height(_LINE_HEIGHT * width_px * 0.75)
    drawn_px = cv2.getTextSize(text, _FONT, size, _thickness(size))[0][0]
    return size * _WIDTH * width_px / max(drawn_px, 1)


def _thickness(size: float) -> int:
    return max(1, round(1.8 * size))
