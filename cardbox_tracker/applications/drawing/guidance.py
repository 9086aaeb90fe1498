"""Draws the guidance of a measurement, readable from two metres: outline, few words, big number."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from typing import NamedTuple

import cv2
import numpy as np

from cardbox_tracker.applications.drawing.overlay import (
    TEXT_BGR,
    ImageArray,
    draw_outline,
    enlarged,
    pixels_of,
)
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.measuring.asked_outline import LiveFit
from cardbox_tracker.measuring.config import InitializationConfig
from cardbox_tracker.measuring.guidance import Prompt
from cardbox_tracker.measuring.references import MIN_PERSON_FRACTION, lateral_m
from cardbox_tracker.measuring.stature import at_height_of
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.parts import body_parts
from cardbox_tracker.person.posture import REFERENCE_NAMES, TORSO_Y, reference_posture
from cardbox_tracker.person.sizes import FloatArray

Bgr = tuple[int, int, int]

FIT_BGR: dict[str, Bgr] = {"far": (60, 60, 255), "nearly": (0, 190, 255), "fits": (70, 220, 70)}
"""Colour of the outline by the fit of the person: red, amber or green."""
MOOD_BGR: dict[str, Bgr] = {"ask": (50, 40, 30), "good": (50, 120, 30), "bad": (30, 60, 170)}
"""Background of the words by their mood: a request, praise or a refusal."""

_FONT = cv2.FONT_HERSHEY_DUPLEX
_BLACK: Bgr = (0, 0, 0)
# Fractions of the image's height.
_BAND, _LINE_HEIGHT, _NUMBER_HEIGHT = 0.30, 0.095, 0.24
# Fractions of its width: the words, the outline, the arrow.
_WORDS, _OUTLINE, _ARROW = 0.94, 1 / 110, 1 / 45
_NOSE_M, _NOSE_HALF_M = 0.08, 0.045
# Sideways component of the facing direction above which nose and arrow are drawn.
_SIDEWAYS = 0.5
_SCALE = 2
# Factor of the brightness outside the person.
_DARKER = 2


class Asked(NamedTuple):
    """The posture that a person is asked to take."""

    body: BodyModel  #: a body of about the person's size, at their place
    camera: Camera  #: camera at the working resolution, with the pitch of the body model
    posture: FloatArray  #: (12,), rad and metres
    fit: str = "far"  #: fit of the person to the posture: ``far``, ``nearly`` or ``fits``


class Guide:
    """Draws the prompts of a measurement for one camera.

    Attributes:
        camera: camera at the working resolution.
        config: settings with distance and turn of the person and pitch of the camera.
    """

    def __init__(self, camera: Camera, config: InitializationConfig) -> None:
        self.camera, self.config = camera, config
        self._fit = LiveFit(camera, config)

    def draw(
        self, prompt: Prompt, silhouette: ImageArray, image: ImageArray | None, mirror: bool
    ) -> ImageArray:
        """Return a prompt as a picture, bgr, over the image or else its silhouette, (H, W)."""
        picture = silhouette
        if image is not None:
            picture = image.copy()
            picture[silhouette == 0] //= _DARKER
        asked = self._asked(prompt.name, silhouette) if prompt.name in REFERENCE_NAMES else None
        return draw_guidance(
            picture, prompt.words, prompt.mood, prompt.left_s, asked, scale=_SCALE, mirror=mirror
        )

    def _asked(self, name: str, silhouette: ImageArray) -> Asked:
        """Return the outline of a person of mean size, at the person's place or in the middle."""
        config = self.config
        pitch_rad = config.camera_pitch_rad
        body = BodyModel.of(
            distance_m=config.distance_m, camera_pitch_rad=pitch_rad, side_turn=config.side_turn
        )
        posture = reference_posture(name, config.side_turn)
        if np.count_nonzero(silhouette) >= MIN_PERSON_FRACTION * silhouette.size:
            body = at_height_of(silhouette, body, self.camera)
            posture[TORSO_Y] = lateral_m(silhouette, self.camera, config.distance_m)
        view = self.camera.with_pitch(pitch_rad)
        return Asked(body, view, posture, self._fit(name, silhouette))


def draw_guidance(
    image: ImageArray,
    words: str,
    mood: str = "ask",
    number: int | None = None,
    asked: Asked | None = None,
    scale: int = 1,
    mirror: bool = False,
) -> ImageArray:
    """Return (1.3 scale H, scale W, 3) bgr with words in a band above the image of a person.

    The image is (H, W) grey or silhouette, or (H, W, 3) bgr, of the camera's size. The words take
    at most two lines, and the ``mood`` colours the band: ``ask``, ``good`` or ``bad``. ``number``
    are seconds left, beside the head. ``asked`` is an outline to stand in, with nose and arrow if
    it looks aside. ``mirror`` mirrors the image, but not words and number.
    """
    canvas = enlarged(image, scale)
    if asked is not None:
        _draw_asked(canvas, asked)
    if mirror:
        canvas = np.ascontiguousarray(canvas[:, ::-1])
    height, width = canvas.shape[:2]
    tall = _NUMBER_HEIGHT * height
    if number is not None:
        # The upper left corner is beside the head of a person in the middle.
        corner, size = (round(0.04 * width), round(tall + 0.05 * height)), _size_of_height(tall)
        for colour, grow in ((_BLACK, 2), (TEXT_BGR, 1)):
            thick = grow * _thickness(size)
            cv2.putText(canvas, str(number), corner, _FONT, size, colour, thick, cv2.LINE_AA)
    if asked is not None and asked.fit == "fits":
        # A tick in the upper right corner, for people who cannot tell red from green.
        corner_px = np.array([0.96 * width - 1.1 * tall, 0.05 * height])
        tick = corner_px + tall * np.array([(0.0, 0.55), (0.38, 0.92), (1.1, 0.1)])
        _draw_lines(canvas, {max(2, round(0.14 * tall)): tick}, FIT_BGR["fits"])
    return np.vstack([_band(words, mood, width, height), canvas])


def _draw_asked(canvas: ImageArray, asked: Asked) -> None:
    view = asked.camera.scaled(*canvas.shape[1::-1])
    colour = FIT_BGR[asked.fit]
    width = max(2, round(canvas.shape[1] * _OUTLINE))
    patches = cardbox_patches(asked.body, asked.posture)
    # A dark rim keeps the line visible on a white silhouette.
    draw_outline(canvas, view, patches, _BLACK, width + 4)
    draw_outline(canvas, view, patches, colour, width)
    frames = pose(asked.body, asked.posture)
    forward = frames.torso_rotation[:, 0]
    if abs(float(forward[1])) <= _SIDEWAYS:
        return
    face = frames.head + 0.5 * body_parts(asked.body.sizes).head.depth_m * forward
    up = np.array([0.0, 0.0, _NOSE_HALF_M])
    nose = pixels_of(view, np.array([face + up, face + _NOSE_M * forward, face - up]))
    if nose is not None:
        corners = np.round(nose).astype(np.int32)
        cv2.fillConvexPoly(canvas, corners, colour, cv2.LINE_AA)
        cv2.polylines(canvas, [corners], True, _BLACK, max(1, width // 2), cv2.LINE_AA)
    hip = pixels_of(view, frames.hip[None])
    if hip is not None:
        _draw_turn(canvas, float(hip[0, 0]), 1 if forward[1] > 0 else -1)


def _draw_turn(canvas: ImageArray, column: float, side: int) -> None:
    """Draw an arrow around the body, from the front to the right (``side`` 1) or the left (-1)."""
    height, width = canvas.shape[:2]
    column = float(np.clip(column, 0.25 * width, 0.75 * width))
    row, wide, high = 0.74 * height, 0.2 * width, 0.1 * height
    # The arrow leads from the bottom of the ellipse to the direction in which the face will point.
    turned = np.radians(np.linspace(115.0, 8.0, 24))
    points = np.stack([column + side * wide * np.cos(turned), row + high * np.sin(turned)], axis=1)
    tip = points[-1] + (0.0, -0.16 * height)
    base = np.array([(0.075 * width, 0.0), (-0.075 * width, 0.0)])
    head = np.vstack([tip, points[-1] + base, tip])
    _draw_lines(canvas, {max(2, round(width * _ARROW)): points, 1: head}, TEXT_BGR)
    cv2.fillConvexPoly(canvas, np.round(head).astype(np.int32), TEXT_BGR, cv2.LINE_AA)


def _draw_lines(canvas: ImageArray, lines: Mapping[int, FloatArray], colour: Bgr) -> None:
    """Draw lines through pixels (n, 2) by their thickness, with a dark rim around all."""
    for ink, grow in ((_BLACK, 6), (colour, 0)):
        for thick, points in lines.items():
            line = np.round(points).astype(np.int32)
            cv2.polylines(canvas, [line], False, ink, thick + grow, cv2.LINE_AA)


def _band(words: str, mood: str, width: int, height: int) -> ImageArray:
    """Return a band with the words, ``width`` px wide, for an image of ``height`` px."""
    tall = round(_BAND * height)
    band = np.full((tall, width, 3), MOOD_BGR[mood], np.uint8)
    lines = _two_lines(words)
    size = min(
        [_size_of_height(_LINE_HEIGHT * height), *(_size_of_width(one, width) for one in lines)]
    )
    thick = _thickness(size)
    for number, line in enumerate(lines):
        (wide, high), _ = cv2.getTextSize(line, _FONT, size, thick)
        middle = tall * (2 * number + 1) / (2 * len(lines))
        corner = (width - wide) // 2, round(middle + high / 2)
        cv2.putText(band, line, corner, _FONT, size, TEXT_BGR, thick, cv2.LINE_AA)
    return band


def _two_lines(words: str) -> list[str]:
    """Return few words in one line, or else two lines of lengths as equal as possible."""
    if len(words) <= 16:
        return [words] if words else []
    wrapped = (textwrap.wrap(words, width) for width in range(len(words) // 2, len(words) + 1))
    return next(lines for lines in wrapped if len(lines) <= 2)


def _size_of_height(height_px: float) -> float:
    return height_px / cv2.getTextSize("0", _FONT, 1.0, 1)[0][1]


def _size_of_width(text: str, width_px: int) -> float:
    # Bold letters are wider, so the width is measured at the thickness that is drawn.
    size = _size_of_height(_LINE_HEIGHT * width_px * 0.75)
    drawn_px = cv2.getTextSize(text, _FONT, size, _thickness(size))[0][0]
    return size * _WORDS * width_px / max(drawn_px, 1)


def _thickness(size: float) -> int:
    return max(1, round(1.8 * size))
