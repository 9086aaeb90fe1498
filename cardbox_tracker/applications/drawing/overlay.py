"""Draws the model over an image: parts, outline, skeleton and fit; or hides the head in it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import clip_near, in_front
from cardbox_tracker.detectors.image_points import POINT_INDEX, ImagePoints
from cardbox_tracker.person.cardbox import PATCH_NAMES, cardbox_patches, patches_at
from cardbox_tracker.person.kinematics import PosedBodies, gaze_m, pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.parts import body_parts
from cardbox_tracker.person.posture import PLACE, POSTURE
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import KeypointState
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from cardbox_tracker.search.doubt import HANDS
from cardbox_tracker.tracking.estimate import CLOSED, FILLED, NO_PERSON, OPEN, UNCERTAIN, Estimate
from cardbox_tracker.tracking.tracker import Tracker

ImageArray = NDArray[np.uint8]

OUTLINE_BGR = (60, 220, 60)
SKELETON_BGR = (0, 140, 255)
GAZE_BGR = (255, 230, 60)
HAND_BGR = (255, 160, 220)
JOINT_BGR = (255, 255, 255)
TEXT_BGR = (255, 255, 255)
# Colours of the markers and of the URDF: torso, left, right.
_PART_BGR = {"left": (102, 179, 51), "right": (51, 115, 217)}
_TORSO_BGR = (191, 115, 64)
_FILL = 0.4
UNCERTAIN_BGR = (40, 170, 255)
_STATE_BGR = {"tracking": (120, 255, 120), "uncertain": UNCERTAIN_BGR, "lost": (90, 110, 255)}
_BONE_BGR = {
    KeypointState.UNCERTAIN: (0, 230, 255),
    KeypointState.LOST: (60, 60, 255),
    KeypointState.HIDDEN: (200, 200, 200),
}

_SHIFT = 4
# Outlines in images that are less wide are traced at twice their size.
_FINE_PX = 1280
# Pixels beside a polygon that drawing it may change.
_EDGE_PX = 3
# Lines and text are readable from this size of the longer side on.
_READABLE_PX = 640

_HEAD = [PATCH_NAMES.index("head_frontal"), PATCH_NAMES.index("head_sagittal")]
_FACE = [POINT_INDEX[name] for name in ("nose", "left_eye", "right_eye", "left_ear", "right_ear")]
_WIDTH = [*_FACE, POINT_INDEX["left_shoulder"], POINT_INDEX["right_shoulder"]]
# Share of the head's size that is added on each side, since the model's head does not nod.
_MARGIN = 0.5
# Share of the width of face and shoulders by which a head is larger than its face on each side.
_AROUND_FACE = 0.5
# Coarse pixels across the region, about three of which cover the face.
_BLOCKS = 6


def draw_overlay(
    image: ImageArray,
    body: BodyModel,
    camera: Camera,
    estimate: Estimate,
    scale: int = 1,
    hides_heads: bool = False,
) -> ImageArray:
    """Return (scale H, scale W, 3) bgr with the model of ``estimate`` drawn over an image.

    The image is (H, W) grey or silhouette, or (H, W, 3) bgr, of the size of the working camera,
    which has the pitch of the body model. Without a posture only the state is written; outline and
    state are amber if the posture may be wrong. ``hides_heads`` is for :func:`with_hidden_head`.
    """
    canvas = enlarged(image, scale)
    view = camera.scaled(*canvas.shape[1::-1])
    # One of several people who is not there has no head to hide.
    if hides_heads and not (estimate.person and estimate.state == NO_PERSON):
        canvas = with_hidden_head(canvas, body, view, estimate)
    text = estimate.state.replace("_", " ")
    if estimate.posture is not None:
        outline = UNCERTAIN_BGR if estimate.state in (UNCERTAIN, FILLED) else OUTLINE_BGR
        there = estimate.placed(body)
        posed = draw_model(canvas, there, view, estimate.posture, outline, estimate.keypoint_states)
        if estimate.neck is not None:
            _draw_gaze(canvas, view, gaze_m(body_parts(there.sizes), posed, estimate.neck))
        _draw_hands(canvas, view, estimate)
        _draw_legs(canvas, view, estimate)
        if estimate.iou is not None:
            text += f"  IoU {estimate.iou:.2f}  {estimate.cost_px} px"
        if estimate.place is not None and estimate.place.state is KeypointState.UNCERTAIN:
            text += "  place uncertain"
    _draw_text(canvas, text, _STATE_BGR.get(estimate.state, TEXT_BGR))
    return canvas


def draw_camera_overlay(
    picture: ImageArray, number: int, estimate: Estimate, tracker: Tracker
) -> ImageArray:
    """Return the picture of a camera, 0 for the first, with the model; others are turned upright.

    A small picture, (H, W) grey or (H, W, 3) bgr, is enlarged by a whole factor, so that lines and
    text are readable.
    """
    scale = readable_scale(picture)
    if number == 0:
        return draw_overlay(picture, tracker.body, tracker.camera, estimate, scale)
    view = tracker.views[number - 1]
    if estimate.posture is not None:
        place_m = np.zeros(2) if estimate.offset_m is None else estimate.offset_m
        state = view.states(np.concatenate([estimate.posture, place_m]))
        posture, there = state[POSTURE], state[PLACE]
        # The places of hands and legs are those in the first camera.
        estimate = replace(estimate, posture=posture, offset_m=there, hands=None, legs=None)
    return draw_overlay(view.upright(picture), view.body, view.camera, estimate, scale)


def draw_sharp_overlay(
    frame: RecordedFrame, estimate: Estimate, tracker: Tracker, hides_heads: bool = False
) -> ImageArray:
    """Return the first camera's picture with the model, enlarged in pixels, which compress well."""
    picture = frame.image
    if hides_heads:
        picture = with_hidden_faces(picture, tracker.camera, frame.everyone)
    scale = readable_scale(picture)
    large = picture.repeat(scale, axis=0).repeat(scale, axis=1)
    return draw_overlay(large, tracker.body, tracker.camera, estimate, 1, hides_heads)


def draw_message(image: ImageArray, text: str) -> ImageArray:
    """Return a bgr image with ``text`` over ``image`` (H, W) or (H, W, 3), enlarged if small."""
    canvas = enlarged(image, readable_scale(image))
    _draw_text(canvas, text)
    return canvas


def draw_model(
    canvas: ImageArray,
    body: BodyModel,
    camera: Camera,
    posture: FloatArray,
    outline_bgr: tuple[int, int, int] = OUTLINE_BGR,
    states: Sequence[KeypointState] | None = None,
) -> PosedBodies:
    """Draw the parts of ``posture`` (12,) into ``canvas`` (H, W, 3), and return the posed body.

    Patches are tinted by side, and their common outline is drawn in ``outline_bgr``. With
    ``states`` of the keypoints, bones to uncertain ones are yellow, to lost ones red, and to hidden
    ones dashed.
    """
    frames = pose(body, posture)
    patches = patches_at(body, frames)
    # The torso is drawn first, so that an arm in front of it stays visible.
    parts = sorted(_polygons(camera, patches), key=lambda part: part[0] in _PART_BGR)
    region, corner = _region_of(parts, _EDGE_PX)
    there = canvas[region]
    if there.size:
        tint = there.copy()
        for name, polygon in parts:
            colour = _PART_BGR.get(name, _TORSO_BGR)
            cv2.fillConvexPoly(tint, _subpixels(polygon, corner), colour, cv2.LINE_AA, _SHIFT)
        there[:] = cv2.addWeighted(tint, _FILL, there, 1.0 - _FILL, 0.0)
    thickness = max(1, round(camera.width / 400))
    draw_outline(canvas, camera, patches, outline_bgr, thickness)
    _draw_skeleton(canvas, frames, camera, thickness, states)
    return frames


def draw_outline(
    canvas: ImageArray,
    camera: Camera,
    patches: FloatArray,
    colour: tuple[int, int, int],
    thickness: int,
) -> None:
    """Draw the common outline of ``patches`` (15, 4, 3), ``thickness`` px wide, in place."""
    shift = int(camera.width < _FINE_PX)
    fine = camera.scaled(*(size << shift for size in (camera.width, camera.height)))
    parts = list(_polygons(fine, patches))
    # A patch seen edge-on is a thin line that does not show the extent of the part.
    whisker = max(3, fine.width // 128)
    region, corner = _region_of(parts, whisker + _EDGE_PX)
    model = np.zeros((fine.height, fine.width), np.uint8)[region]
    if not model.size:
        return
    for _, polygon in parts:
        cv2.fillConvexPoly(model, _subpixels(polygon, corner), 255, cv2.LINE_8, _SHIFT)
    opened = cv2.morphologyEx(model, cv2.MORPH_OPEN, np.ones((whisker, whisker), np.uint8))
    found, _ = cv2.findContours(opened, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE, offset=corner)
    outlines = [np.asarray(cv2.approxPolyDP(one, 1.0, True), np.int32) for one in found]
    cv2.polylines(canvas, outlines, True, colour, thickness, cv2.LINE_AA, shift)


def _draw_skeleton(
    canvas: ImageArray,
    frames: PosedBodies,
    camera: Camera,
    thickness: int,
    states: Sequence[KeypointState] | None,
) -> None:
    arms = list(states or [KeypointState.TRACKED] * 6)
    trunk = [KeypointState.TRACKED] * 3
    chains = [
        ([frames.hip, frames.neck, frames.head], trunk),
        ([frames.neck, *frames.left[:3]], [KeypointState.TRACKED, *arms[:3]]),
        ([frames.neck, *frames.right[:3]], [KeypointState.TRACKED, *arms[3:]]),
    ]
    joints = []
    for chain, reached in chains:
        pixels = pixels_of(camera, np.array(chain))
        if pixels is None:
            continue
        for begin, end, state in zip(pixels[:-1], pixels[1:], reached[1:], strict=True):
            _draw_bone(canvas, begin, end, state, thickness + 1)
        joints.extend(_subpixels(pixels).tolist())
    for colour, rim in (((0, 0, 0), 1), (JOINT_BGR, 0)):
        radius = (thickness + 1 + rim) << _SHIFT
        for joint in joints:
            cv2.circle(canvas, joint, radius, colour, -1, cv2.LINE_AA, _SHIFT)


def _draw_bone(
    canvas: ImageArray, begin: FloatArray, end: FloatArray, state: KeypointState, thickness: int
) -> None:
    """Draw a line between two pixels, with dashes if the keypoint at its end is hidden."""
    colour = _BONE_BGR.get(state, SKELETON_BGR)
    shares = np.array([[0.0, 1.0]])
    if state is KeypointState.HIDDEN:
        dashes = max(2, round(float(np.linalg.norm(end - begin)) / (6 * thickness)))
        shares = (np.arange(dashes)[:, None] + [0.0, 0.5]) / dashes
    lines = [*_subpixels(begin + shares[..., None] * (end - begin))]
    cv2.polylines(canvas, lines, False, colour, thickness, cv2.LINE_AA, _SHIFT)


def _draw_gaze(canvas: ImageArray, camera: Camera, line_m: FloatArray) -> None:
    """Draw a line (2, 3), metres in the reference frame, with a dot at its end."""
    ends = pixels_of(camera, line_m)
    if ends is None:
        return
    pixels, thickness = _subpixels(ends), max(1, round(camera.width / 400))
    cv2.polylines(canvas, [pixels], False, GAZE_BGR, thickness + 1, cv2.LINE_AA, _SHIFT)
    radius = (thickness + 1) << _SHIFT
    cv2.circle(canvas, pixels[1].tolist(), radius, GAZE_BGR, -1, cv2.LINE_AA, _SHIFT)


def _draw_hands(canvas: ImageArray, camera: Camera, estimate: Estimate) -> None:
    """Draw a ring around an open hand, a disc over a closed one, and a half disc between."""
    for hand, keypoint in zip(estimate.hands or (), HANDS, strict=False):
        if hand is None or hand.open is None or estimate.keypoints_m is None:
            continue
        u, v = camera.project(estimate.keypoints_m[keypoint]).tolist()
        centre, radius = (round(u), round(v)), max(4, round(camera.width / 50))
        thickness = max(1, round(camera.width / 400))
        filled = 0 if hand.open > OPEN else 360 if hand.open < CLOSED else 180
        cv2.ellipse(canvas, centre, (radius, radius), 0, 0, filled, HAND_BGR, -1, cv2.LINE_AA)
        cv2.circle(canvas, centre, radius, HAND_BGR, thickness, cv2.LINE_AA)


def _draw_legs(canvas: ImageArray, camera: Camera, estimate: Estimate) -> None:
    if estimate.legs is None or not in_front(estimate.legs.points_m).all():
        return
    pixels = camera.project(estimate.legs.points_m)
    thickness = max(1, round(camera.width / 400))
    for end in (1, 2, 4, 5):
        state = estimate.legs.states[end]
        _draw_bone(canvas, pixels[end - 1], pixels[end], state, thickness + 1)
    for joint in _subpixels(pixels).tolist():
        cv2.circle(canvas, joint, (thickness + 1) << _SHIFT, JOINT_BGR, -1, cv2.LINE_AA, _SHIFT)


def _draw_text(canvas: ImageArray, text: str, colour: tuple[int, int, int] = TEXT_BGR) -> None:
    """Write ``text`` into the upper left corner of ``canvas``, in place."""
    scale = canvas.shape[1] / 700
    font, size, thickness = cv2.FONT_HERSHEY_SIMPLEX, 0.75 * scale, max(1, round(1.5 * scale))
    (width, height), below = cv2.getTextSize(text, font, size, thickness)
    margin = round(8 * scale)
    left, bottom = margin, margin + height
    # A dark background makes the text readable before any wall.
    corner = (left + width + margin // 2, bottom + below)
    cv2.rectangle(
        canvas, (left - margin // 2, bottom - height - margin // 2), corner, (0, 0, 0), -1
    )
    cv2.putText(canvas, text, (left, bottom), font, size, colour, thickness, cv2.LINE_AA)


def pixels_of(camera: Camera, points_m: FloatArray) -> FloatArray | None:
    """Return pixels (n, 2) of points (n, 3), m in the reference frame; None if one is behind."""
    points = camera.reference_to_optical(points_m)
    return camera.project(points) if in_front(points).all() else None


def _polygons(camera: Camera, patches: FloatArray) -> Iterator[tuple[str, FloatArray]]:
    """Yield the side (left, right or another word) and the pixels (n, 2) of each visible patch."""
    optical = camera.reference_to_optical(patches)
    for name, corners in zip(PATCH_NAMES, optical, strict=True):
        polygon = corners if in_front(corners).all() else clip_near(corners)
        if len(polygon) > 2:
            yield name.split("_")[0], camera.project(polygon)


def readable_scale(image: ImageArray) -> int:
    """Return the whole factor from which lines and text over ``image`` (H, W, ...) are readable."""
    longer_px = int(max(image.shape[:2]))
    return -(-_READABLE_PX // longer_px)


def enlarged(image: ImageArray, scale: int) -> ImageArray:
    """Return an enlarged bgr copy, (scale H, scale W, 3), of an image (H, W) or (H, W, 3)."""
    height, width = image.shape[:2]
    size = (scale * width, scale * height)
    bgr = image if image.ndim == 3 else cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)
    large = bgr if scale == 1 else cv2.resize(bgr, size, interpolation=cv2.INTER_LINEAR)
    return np.array(large, np.uint8)


def _subpixels(pixels: FloatArray, corner: tuple[int, int] = (0, 0)) -> NDArray[np.int32]:
    """Return pixels from ``corner`` (column, row) on in OpenCV's format of ``_SHIFT`` bits."""
    clipped = np.clip(pixels, -30_000, 30_000)
    placed = np.asarray(np.round(clipped * (1 << _SHIFT)), dtype=np.int32)
    return placed - (np.asarray(corner, np.int32) << _SHIFT)


def _region_of(
    parts: Sequence[tuple[str, FloatArray]], margin_px: float
) -> tuple[tuple[slice, slice], tuple[int, int]]:
    """Return rows and columns of polygons with a margin, and their first column and row."""
    if not parts:
        return np.s_[:0, :0], (0, 0)
    return _around(np.concatenate([polygon for _, polygon in parts]), margin_px)


def _around(pixels: FloatArray, margin_px: float) -> tuple[tuple[slice, slice], tuple[int, int]]:
    """Return rows and columns around pixels (N, 2), and the first column and row."""
    low = np.trunc(pixels.min(axis=0) - margin_px)
    high = np.ceil(pixels.max(axis=0) + margin_px)
    (left, top), (right, bottom) = np.maximum((low, high), 0).astype(int).tolist()
    return np.s_[top:bottom, left:right], (left, top)


def with_hidden_faces(
    image: ImageArray, camera: Camera, people: Iterable[ImagePoints]
) -> ImageArray:
    """Return a copy of an image in which coarse pixels cover all faces that a detector shows.

    The image is (H, W) or (H, W, 3), of any size; the points of ``people`` are px of the camera.
    """
    hidden = image.copy()
    for one in people:
        px = image.shape[1] / camera.width * one.px
        face, beside = (px[rows][np.isfinite(px[rows]).all(axis=1)] for rows in (_FACE, _WIDTH))
        if len(face):
            _make_coarse(hidden[_around(face, _AROUND_FACE * np.ptp(beside, axis=0).max())[0]])
    return hidden


def with_hidden_head(
    image: ImageArray, body: BodyModel, camera: Camera, estimate: Estimate
) -> ImageArray:
    """Return a copy of an image in which coarse pixels make the head unrecognizable.

    The image is (H, W) or (H, W, 3), of the size of the camera, which has the pitch of the body
    model. Without a posture, or with the head behind the camera, all of it becomes coarse.
    """
    hidden = image.copy()
    _make_coarse(hidden[_head_region(body, camera, estimate)])
    return hidden


def _make_coarse(part: ImageArray) -> None:
    if part.size:
        high, wide = part.shape[:2]
        blocks = (_BLOCKS, max(1, round(_BLOCKS * high / wide)))
        coarse = cv2.resize(part, blocks, interpolation=cv2.INTER_AREA)
        part[:] = cv2.resize(coarse, (wide, high), interpolation=cv2.INTER_NEAREST)


def _head_region(body: BodyModel, camera: Camera, estimate: Estimate) -> tuple[slice, slice]:
    """Return rows and columns of the head with its margin; the whole image if it is unknown."""
    if estimate.posture is None:
        return np.s_[:, :]
    patches = cardbox_patches(estimate.placed(body), estimate.posture)[_HEAD]
    visible = [clip_near(corners) for corners in camera.reference_to_optical(patches)]
    corners: list[FloatArray] = [camera.project(polygon) for polygon in visible if len(polygon)]
    if not corners:
        return np.s_[:, :]
    head = np.concatenate(corners)
    return _around(head, _MARGIN * np.ptp(head, axis=0).max())[0]
