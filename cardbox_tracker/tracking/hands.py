"""Measures the hands of a tracked person: open or closed, the palm's direction, the wrist.

A silhouette shows no fingers. A network finds 21 points of a hand in a square of the image, which
the wrist and the knuckles of a detector place. One hand an image is looked at, in turn, so that the
time for an image does not grow with the number of hands; a hand keeps its result until its turn.

The angles are those between the forearm, from the detector's elbow and wrist and the depth of the
tracked arm, and the palm. With the forearm along ``f``, the normal out of the palm ``n``, and the
fingers' direction ``h``:

- the wrist's flexion bends the palm towards the forearm's inner side, ``sin(flexion) = -n f``;
- its deviation bends the hand towards the little finger, from ``f`` in the plane of the palm;
- the forearm's rotation is its pronation: 0 with the palm towards the body while the elbow is bent
  (thumb up), positive as the thumb turns inwards. It is relative to the plane of the bent arm,
  which a straight arm does not have.

The network's points are good in the image and bad in depth: in films, its fingers are off by 50
degrees, more than those of a wrist that is taken as straight. So a grid of turns, flexions and
deviations is rated: by where each of them puts the bases of the fingers in the image, by how far
people bend their wrists, and by the side to which the network's palm faces. The length of the palm
is that of the body model.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import exp, hypot
from typing import Protocol

import cv2
import numpy as np

from cardbox_tracker.camera.camera import NEAREST_M, Camera
from cardbox_tracker.detectors.detector import color
from cardbox_tracker.detectors.hand_network import FINGERS, WRIST, HandPoints
from cardbox_tracker.detectors.image_points import POINT_INDEX, ImagePoints
from cardbox_tracker.detectors.pose_network import ColorImage, Square
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.proportions import WRIST_SHARE
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import FRAME_NAMES, KeypointState, turn_of
from cardbox_tracker.search.doubt import HANDS
from cardbox_tracker.tracking.estimate import KEPT_S, Estimate, Hand

# A finger is open if its end is bent by less than the first angle from the direction of its base,
# and closed if by more than the second, with their spread, rad.
_OPEN, _CLOSED, _SPREAD = np.radians([80.0, 45.0, 8.0])
# The thumb is open if its end is farther from the base of the little finger, and no part of a fist
# if it is farther from that of the middle finger; lengths of the palm, and their spread.
_THUMB_FAR, _THUMB_OUT, _THUMB_SPREAD = 0.78, 0.74, 0.057
# A hand whose points have a smaller longer side is neither open nor closed for the network, px.
_LEAST_PX = 12.6

# Points at the bases of index, middle and little finger.
_INDEX, _MIDDLE, _LITTLE = 5, 9, 17
_SIDES = ("left", "right")
_KEYPOINTS = dict(zip(_SIDES, HANDS, strict=True))
_ELBOWS = {"left": slice(6, 8), "right": slice(10, 12)}

# Side of the square around a hand, in lengths from the wrist to the knuckles, and that length, m.
_SQUARE, _PALM_M = 2.4, 0.09
# Least score of the points that place the square.
_LEAST_SCORE = 0.3
# Bases of index, middle, ring and little finger from the wrist, in lengths of the palm: aside to
# the little finger, and ahead. They are means of the network's own points.
_BASES = [*range(_INDEX, _LITTLE + 1, 4)]
_PALM = np.array([(-0.15, 1.02), (0.0, 1.0), (0.15, 0.97), (0.27, 0.81)])
# Deviations of these points in lengths of the palm, and of that length as a share.
_POINT, _LENGTH = 0.25, 0.15
# Turns about the forearm, flexions and deviations of the hands that are rated, rad.
_STEPS = np.arange(0, 360, 15), np.arange(-75, 91, 15), np.arange(-36, 37, 12)
_TURNS, _FLEXIONS, _DEVIATIONS = (
    one.ravel() for one in np.meshgrid(*map(np.radians, _STEPS), indexing="ij")
)
# Deviations of the flexion and deviation of people's wrists, and of the side to which the network's
# palm faces, rad.
_FLEXED_RAD, _DEVIATED_RAD, _FACING_RAD = np.radians([20.0, 10.0, 35.0])
# A palm's normal shows the turn if its part across the forearm is larger; a smaller one shows less.
_SHOWS = 0.5
# Deviation of the forearm, rad.
_FOREARM_RAD = np.radians(10.0)
# Logarithm of the odds of fingers that bend to the palm, for a length of the palm.
_CURL = 4.65
# Sine of the least bend of an elbow whose plane is known.
_LEAST_BEND = float(np.sin(np.radians(20.0)))


class Look(Protocol):
    """Finds the points of a hand in a square of an image (H, W, 3), bgr."""

    def __call__(self, image: ColorImage, square: Square) -> HandPoints | None:
        """Return the points; None if there is no hand."""


class HandReader:
    """Adds the hands to the estimates of one person, from the first camera's images."""

    def __init__(self, look: Look) -> None:
        """Start without a hand."""
        self._look = look
        self._looked_s: dict[str, float] = {}
        self._seen: dict[str, tuple[float, Hand]] = {}

    def see(
        self,
        picture: Callable[[], ColorImage] | None,
        points: ImagePoints | None,
        estimate: Estimate,
        body: BodyModel,
        camera: Camera,
        time_s: float,
    ) -> Estimate:
        """Return the ``estimate`` of an image with the hands that are known.

        ``picture`` returns the image (H, W, 3), bgr, or (H, W) at any resolution; ``points`` are
        those of the person for the working ``camera``, which has the pitch of the body model.
        """
        tracked = [side for side in _SIDES if is_tracked(estimate, side)]
        if tracked and points is not None and picture is not None:
            image = color(picture())
            view = camera.scaled(image.shape[1], image.shape[0])
            scale = np.array([view.width / camera.width, view.height / camera.height])
            placed = replace(points, px=(points.px + 0.5) * scale - 0.5)
            squares = {side: hand_square(side, placed, estimate, view) for side in tracked}
            shown = {side: square for side, square in squares.items() if square is not None}
            if shown:
                side = min(shown, key=lambda one: self._looked_s.get(one, -np.inf))
                self._looked_s[side] = time_s
                found = self._look(image, shown[side])
                if found is not None:
                    hand = measured(side, found, placed, estimate, view)
                    self._seen[side] = time_s, _turned(hand, side, estimate, body, camera)
        hands = [self._kept(side, estimate, time_s) for side in _SIDES]
        return replace(estimate, hands=(hands[0], hands[1]))

    def _kept(self, side: str, estimate: Estimate, time_s: float) -> Hand | None:
        seen_s, hand = self._seen.get(side, (-np.inf, None))
        is_new = 0.0 <= time_s - seen_s <= KEPT_S
        return hand if is_new and is_tracked(estimate, side) else None


def _turned(hand: Hand, side: str, estimate: Estimate, body: BodyModel, camera: Camera) -> Hand:
    """Return the hand with its turn about the forearm's frame."""
    assert estimate.posture is not None
    posed = pose(body, estimate.posture, camera.pitch_rad)
    forearm = posed.rotations[FRAME_NAMES.index(f"{side}_forearm")]
    return hand._replace(turn=turn_of(hand.palm, forearm, 1.0 if side == "left" else -1.0))


def is_tracked(estimate: Estimate, side: str) -> bool:
    """Return whether the hand of a side is ``tracked``."""
    states = estimate.keypoint_states
    return states is not None and states[_KEYPOINTS[side]] == KeypointState.TRACKED


def hand_square(
    side: str, points: ImagePoints, estimate: Estimate, camera: Camera
) -> Square | None:
    """Return the square around a hand, px of ``camera``; None if its points are not known."""
    assert estimate.keypoints_m is not None
    names = [f"{side}_{name}" for name in ("elbow", "wrist", "index", "little_finger")]
    chosen = [POINT_INDEX[name] for name in names]
    elbow, wrist, *knuckles = points.px[chosen]
    if points.scores[chosen[1]] < _LEAST_SCORE or not np.isfinite(points.px[chosen]).all():
        return None
    hand = np.mean(knuckles, axis=0) - wrist
    depth_m = float(estimate.keypoints_m[_KEYPOINTS[side], 2])
    palm_px = max(hypot(*hand), camera.fx * _PALM_M / max(depth_m, NEAREST_M))
    # A hand that points to the camera has no direction in the image.
    along = hand + 0.2 * (wrist - elbow)
    angle = float(np.arctan2(along[0], -along[1]))
    u, v = wrist + hand + 0.5
    return Square(float(u), float(v), _SQUARE * palm_px, angle)


def measured(
    side: str, found: HandPoints, points: ImagePoints, estimate: Estimate, camera: Camera
) -> Hand:
    """Return what the ``found`` points of a hand tell; all points are px of ``camera``."""
    assert estimate.keypoints_m is not None
    sign = 1.0 if side == "left" else -1.0
    arm = np.asarray(estimate.keypoints_m)[_KEYPOINTS[side] - 2 :][:3]
    upper_arm, forearm = _unit(arm[1] - arm[0]), _forearm(side, arm, points, camera)
    plane = sign * np.cross(upper_arm, forearm)
    bend = float(np.linalg.norm(plane))
    # The turns of a straight arm may count from any direction.
    if bend < _LEAST_BEND:
        plane = np.cross(forearm, np.eye(3)[np.argmin(np.abs(forearm))])
    inner = _unit(plane)
    axes = np.column_stack([inner, sign * np.cross(forearm, inner), forearm])
    palm_m = (1.0 - WRIST_SHARE) * float(np.linalg.norm(arm[2] - arm[1]))
    bases = (found.px[_BASES] - found.px[WRIST]) / (camera.fx, camera.fy) * arm[2, 2] / palm_m
    weights = _rated(bases, found, _ray_rotation(found.px[WRIST], camera).T @ axes, sign)
    best = int(np.argmax(weights))
    # A hand that faces the other way is another answer, and no part of the mean.
    near = np.where(np.abs(_wrapped(_TURNS - _TURNS[best])) < np.pi / 3, weights, 0.0)
    near /= near.sum()
    turn = _TURNS[best] + float(near @ _wrapped(_TURNS - _TURNS[best]))
    flexion, deviation = float(near @ _FLEXIONS), float(near @ _DEVIATIONS)
    away = _FLEXIONS - flexion, _DEVIATIONS - deviation, _wrapped(_TURNS - turn)
    stddev = np.sqrt(np.square(away) @ weights + _FOREARM_RAD**2)
    turn_stddev, rotation = float(stddev[2]), np.nan
    if bend < _LEAST_BEND:
        stddev[2] = np.nan
    else:
        rotation = float(_wrapped(turn))
        if estimate.posture_stddev is not None:
            elbow = np.asarray(estimate.posture_stddev)[_ELBOWS[side]]
            stddev[2] = hypot(turn_stddev, *(elbow / bend))
    palm = axes @ directions(turn, flexion, deviation)[0]
    wrist = np.array([flexion, deviation, rotation])
    return Hand(opened(found), palm, wrist, stddev, turn_stddev=turn_stddev)


def _wrapped(angles: FloatArray | float) -> FloatArray:
    """Return angles between -pi and pi."""
    return np.asarray(np.remainder(np.asarray(angles) + np.pi, 2.0 * np.pi) - np.pi)


def directions(
    turn: FloatArray | float, flexion: FloatArray | float, deviation: FloatArray | float
) -> FloatArray:
    """Return palm, fingers, and the direction to the little finger, (3, 3, ...), unit vectors.

    The axes are the direction to which the palm faces without a turn, the one to which it faces
    after a quarter of a turn, and the forearm.
    """
    inner = np.array([np.cos(turn), np.sin(turn), np.zeros_like(turn)])
    forearm = np.array([np.zeros_like(turn), np.zeros_like(turn), np.ones_like(turn)])
    palm = np.cos(flexion) * inner - np.sin(flexion) * forearm
    straight = np.cos(flexion) * forearm + np.sin(flexion) * inner
    aside = np.array([-np.sin(turn), np.cos(turn), np.zeros_like(turn)])
    fingers = np.cos(deviation) * straight + np.sin(deviation) * aside
    return np.array([palm, fingers, np.cos(deviation) * aside - np.sin(deviation) * straight])


_RATED = directions(_TURNS, _FLEXIONS, _DEVIATIONS)
_UNUSUAL = 0.5 * ((_FLEXIONS / _FLEXED_RAD) ** 2 + (_DEVIATIONS / _DEVIATED_RAD) ** 2)


def _rated(bases: FloatArray, found: HandPoints, to_ray: FloatArray, sign: float) -> FloatArray:
    """Return the probability of each hand of the grid, (n,).

    ``bases`` of four fingers from the wrist in the image, (4, 2), are in lengths of the palm;
    ``to_ray`` (3, 3) turns the axes of :func:`directions` to those of the ray to the hand; ``sign``
    is 1 for a left hand, -1 for a right one.
    """
    ahead, aside = (np.tensordot(to_ray[:2], one, 1) for one in _RATED[1:])
    at = _PALM[:, 0, None, None] * aside + _PALM[:, 1, None, None] * ahead
    agrees, size = np.einsum("ki,kin->n", bases, at), np.einsum("kin,kin->n", at, at)
    # The scale that fits best, given the usual one of 1.
    scale = (agrees / _POINT**2 + 1.0 / _LENGTH**2) / (size / _POINT**2 + 1.0 / _LENGTH**2)
    differs = float(np.sum(bases**2)) - 2.0 * scale * agrees + scale**2 * size
    chances = -_UNUSUAL - 0.5 * (differs / _POINT**2 + ((scale - 1.0) / _LENGTH) ** 2)
    # The network does not know which hand it sees, and may give the depth of the mirror image,
    # whose fingers would bend backwards.
    faces = []
    for mirror in (1.0, -1.0):
        spatial = found.spatial_m * (1.0, 1.0, mirror)
        normal = _palm(spatial, sign)
        x, y, _ = to_ray.T @ normal
        away = _wrapped(_TURNS - np.arctan2(y, x)) * min(hypot(x, y) / _SHOWS, 1.0)
        faces.append(_CURL * _curl(spatial, normal) - 0.5 * (away / _FACING_RAD) ** 2)
    chances += np.logaddexp(*faces)
    weights = np.exp(chances - chances.max())
    return np.asarray(weights / weights.sum())


def _palm(at: FloatArray, sign: float) -> FloatArray:
    """Return the normal (3,) out of the palm; ``sign`` is 1 for a left hand, -1 for a right one."""
    return sign * _unit(np.cross(at[_LITTLE] - at[WRIST], at[_INDEX] - at[WRIST]))


def _curl(at: FloatArray, palm: FloatArray) -> float:
    """Return how far fingers and thumb are on the palm's side of their bases, in palm lengths."""
    ends = [at[base + 3] - at[base] for base in range(_INDEX, _LITTLE + 1, 4)]
    return float((np.mean(ends, axis=0) + 0.5 * (at[4] - at[_INDEX])) @ palm) / _length(at)


def _length(at: FloatArray) -> float:
    """Return the length of the palm, m."""
    return max(float(np.linalg.norm(at[_MIDDLE] - at[WRIST])), 1e-3)


def opened(found: HandPoints) -> float | None:
    """Return how open a hand is, see :class:`~.estimate.Hand`; None if it is too small."""
    at = found.spatial_m
    bends = [_finger_bend(at, 1 + 4 * number) for number in range(1, len(FINGERS))]
    far, out = (
        float(np.linalg.norm(at[4] - at[base])) / _length(at) for base in (_LITTLE, _MIDDLE)
    )
    far, out = (far - _THUMB_FAR) / _THUMB_SPREAD, (out - _THUMB_OUT) / _THUMB_SPREAD
    is_open = _chance(min((_OPEN - max(bends)) / _SPREAD, far))
    is_closed = _chance(min((min(bends) - _CLOSED) / _SPREAD, -out))
    value = (1.0 + is_open - is_closed) / 2
    return value if found.size_px >= _LEAST_PX else None


def _finger_bend(at: FloatArray, base: int) -> float:
    """Return the angle from the wrist and the base to the end of a finger, rad."""
    cosine = _unit(at[base] - at[WRIST]) @ _unit(at[base + 3] - at[base + 1])
    return float(np.arccos(np.clip(cosine, -1.0, 1.0)))


def _forearm(side: str, arm: FloatArray, points: ImagePoints, camera: Camera) -> FloatArray:
    """Return the forearm's direction (3,), optical frame, of the tracked arm only by its depth."""
    elbow, wrist = points.px[[POINT_INDEX[f"{side}_{name}"] for name in ("elbow", "wrist")]]
    depths_m = arm[1, 2] + np.array([0.0, WRIST_SHARE]) * (arm[2, 2] - arm[1, 2])
    rays = [
        _ray(px, camera) * depth_m for px, depth_m in zip((elbow, wrist), depths_m, strict=True)
    ]
    return _unit(rays[1] - rays[0])


def _ray(px: FloatArray, camera: Camera) -> FloatArray:
    """Return the point (3,) of a pixel's ray at the depth 1."""
    return np.array([(px[0] - camera.cx) / camera.fx, (px[1] - camera.cy) / camera.fy, 1.0])


def _ray_rotation(px: FloatArray, camera: Camera) -> FloatArray:
    """Return the least rotation (3, 3) that turns the camera's axis to the ray of a pixel."""
    ray = _unit(_ray(px, camera))
    across = np.array([-ray[1], ray[0], 0.0])
    sine = float(np.linalg.norm(across))
    turn = across * (float(np.arctan2(sine, ray[2])) / sine if sine > 0.0 else 0.0)
    return np.asarray(cv2.Rodrigues(turn)[0], np.float64)


def _unit(vector: FloatArray) -> FloatArray:
    return np.asarray(vector / max(float(np.linalg.norm(vector)), 1e-9))


def _chance(value: float) -> float:
    return 1.0 / (1.0 + exp(-min(max(value, -60.0), 60.0)))
