"""Learns the colours of a person's parts from the images of the references ``front`` and ``arms``.

1. The actual posture is searched near the reference by the outline.
2. Each part is drawn smaller than it is and inside of the outline, so that its pixels are certain.
   Forearm and hand are measured from the outline's tip, because an error of the measured length
   would move the wrist into the hand. Both are learned from ``arms`` only, because in ``front``
   the hands hang beside or in front of the trousers.
3. Histograms are smoothed over neighbouring colours and mixed with a uniform distribution.
4. Half of the hand's histogram is the face's, because hands are often missing in the outline.
5. A part with too few pixels gets the colours of a similar part: legs and forearms (sleeves) those
   of the torso, hands those of the face.

Without references, one image of any posture teaches the colours of head, torso and legs. Forearms
are then half bare and half in sleeves, until tracking tells
(:mod:`cardbox_tracker.terms.inner_cue`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import NEAREST_M, Camera
from cardbox_tracker.person.appearance import (
    COLOR_STEPS,
    FOREARM,
    GREY_STEPS,
    HAND,
    HEAD,
    LEGS,
    PARTS,
    TORSO,
    UNSEEN,
    Appearance,
    bins_of,
    steps_of_levels,
)
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import (
    ELBOW_ABDUCTION,
    FIRST_ANGLES,
    N_JOINTS,
    ROLL,
    SHOULDER_ABDUCTION,
    TORSO_Y,
    reference_posture,
)
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.terms.compiled import CompiledSilhouette
from cardbox_tracker.terms.term import Image, Silhouette

LEARNED_FROM = ("front", "arms")
"""References whose images are needed."""

# Additional label for the skin of the face, and its share in the histogram of the hand.
_FACE = len(PARTS)
_FACE_SHARE = 0.5
# Least number of pixels from which a part is learned.
_MIN_PX = 40
# Factors on the light in which one image of a part is counted, because limbs that move are lit
# otherwise than in that image, and the forearm otherwise than the face.
_LIGHTS = (0.7, 0.85, 1.0, 1.2, 1.4)
SHRINK = 0.7
"""Factor of the noise of a search after a round."""
# Search of the posture: rounds, postures in a round, and initial noise.
_ROUNDS, _POSTURES = 8, 300
_PLACE_M, _ROLL_RAD, _ABDUCTION_RAD = 0.03, np.radians(4.0), np.radians(10.0)


def can_learn(images: Mapping[str, Sequence[Image]], references: Mapping[str, Silhouette]) -> bool:
    """Return whether there are images of all ``LEARNED_FROM``, of one kind and size."""
    needed = [image for name in LEARNED_FROM for image in images.get(name, ())]
    size = references[LEARNED_FROM[0]].shape
    one_kind = len({image.shape for image in needed}) == 1 and needed[0].shape[:2] == size
    return one_kind and all(images.get(name) for name in LEARNED_FROM)


def learn_appearance(
    images: Mapping[str, Sequence[Image]],
    references: Mapping[str, Silhouette],
    body: BodyModel,
    camera: Camera,
    seed: int = 0,
) -> Appearance:
    """Learn the colours of the parts from images and silhouettes of each of ``LEARNED_FROM``.

    All images are (H, W, 3) bgr or (H, W). The camera has the pitch of the body model.
    """
    labels = {}
    for name in LEARNED_FROM:
        posture = fit_posture(body, camera, references[name], name, seed)
        labels[name] = part_labels(body, camera, posture, references[name])
    channels = 1 if images[LEARNED_FROM[0]][0].ndim == 2 else 3
    torso = [
        image.reshape(-1, channels)[labels[name].ravel() == TORSO]
        for name in LEARNED_FROM
        for image in images[name]
    ]
    brightness = np.median(np.concatenate(torso), axis=0)
    counts = np.zeros((len(PARTS) + 1, bins_of(channels)))
    for name in LEARNED_FROM:
        for image in images[name]:
            bins = _bins(image, steps_of_levels(brightness, brightness))
            for part in range(len(counts)):
                if name == "arms" or part not in (HAND, FOREARM):
                    counts[part] += np.bincount(bins[labels[name] == part], minlength=len(counts.T))
    return Appearance.of(_histograms(counts, channels), brightness)


def seen_appearance(
    image: Image, silhouette: Silhouette, body: BodyModel, camera: Camera, posture: FloatArray
) -> Appearance | None:
    """Learn colours from one image (H, W, 3), bgr, or (H, W) of a posture (12,), or return None.

    Each part of a colour image is counted as it looks in less and in more light. The hands get the
    colours of the face, and the forearms those of face and torso in equal parts. Head and torso
    must be visible. The camera has the pitch of the body model.
    """
    labels = part_labels(body, camera, posture, silhouette)
    channels = 1 if image.ndim == 2 else 3
    torso = image.reshape(-1, channels)[labels.ravel() == TORSO]
    if len(torso) < _MIN_PX or np.count_nonzero(labels == _FACE) < _MIN_PX:
        return None
    brightness = np.median(torso, axis=0)
    counts = np.zeros((len(PARTS) + 1, bins_of(channels)))
    # Grey parts differ by their brightness alone, which this would blur.
    lights = _LIGHTS if channels == 3 else (1.0,)
    for light in lights:
        bins = _bins(image, steps_of_levels(brightness / light, brightness))
        for part in range(len(counts)):
            # The arms' posture is not reliable yet, so a presumed forearm may be the torso.
            if part not in (HAND, FOREARM):
                seen = np.bincount(bins[labels == part], minlength=len(counts.T))
                counts[part] += seen / len(lights)
    histograms = _histograms(counts, channels)
    histograms[FOREARM] = (histograms[HAND] + histograms[TORSO]) / 2
    return Appearance.of(histograms, brightness)


def _histograms(counts: FloatArray, channels: int) -> FloatArray:
    """Return histograms (5, bins) from counts (6, bins); the last row counts the face."""
    counts[HEAD] += counts[_FACE]
    for part, instead in ((LEGS, TORSO), (_FACE, HEAD), (HAND, _FACE), (FOREARM, TORSO)):
        if counts[part].sum() < _MIN_PX:
            counts[part] = counts[instead]
    histograms = _smoothed(counts, channels)
    histograms[HAND] = (1 - _FACE_SHARE) * histograms[HAND] + _FACE_SHARE * histograms[_FACE]
    return histograms[: len(PARTS)]


def _bins(image: Image, steps: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the bin of each pixel (H, W); ``steps`` (channels, 256) maps levels to steps."""
    channels = image.reshape(*image.shape[:2], -1)
    bins = np.zeros(image.shape[:2], np.int32)
    for c, of_level in enumerate(steps):
        bins = bins * (COLOR_STEPS if len(steps) == 3 else GREY_STEPS) + of_level[channels[..., c]]
    return bins


def _smoothed(counts: FloatArray, channels: int) -> FloatArray:
    """Return counts (parts, bins) smoothed over neighbouring colours and normalized."""
    steps = GREY_STEPS if channels == 1 else COLOR_STEPS
    cube = counts.reshape(len(counts), *(steps,) * channels)
    for axis in range(1, channels + 1):
        borders = [(1, 1) if a == axis else (0, 0) for a in range(channels + 1)]
        padded = np.pad(cube, borders, "edge")
        before, same, after = (np.take(padded, range(o, o + steps), axis) for o in range(3))
        cube = (before + 2.0 * same + after) / 4.0
    flat = cube.reshape(len(counts), -1)
    flat = flat / np.maximum(flat.sum(axis=1, keepdims=True), 1e-9)
    result: FloatArray = (1 - UNSEEN) * flat + UNSEEN / flat.shape[1]
    return result


def fit_posture(
    body: BodyModel, camera: Camera, silhouette: Silhouette, name: str, seed: int = 0
) -> FloatArray:
    """Return the posture (12,) near the reference ``name`` with the best outline."""
    rng = np.random.default_rng(seed)
    seen = CompiledSilhouette(body, camera).look(silhouette)
    best = reference_posture(name)
    best[TORSO_Y] = body.placement.lateral_m
    sigma = np.zeros(N_JOINTS)
    sigma[TORSO_Y], sigma[ROLL] = _PLACE_M, _ROLL_RAD
    for first in FIRST_ANGLES:
        sigma[[first + SHOULDER_ABDUCTION, first + ELBOW_ABDUCTION]] = _ABDUCTION_RAD
    for _ in range(_ROUNDS):
        postures = best + sigma * rng.standard_normal((_POSTURES, N_JOINTS))
        postures[0] = best
        best = postures[np.argmin(seen.postures(postures))]
        sigma = SHRINK * sigma
    return best


def part_labels(
    body: BodyModel, camera: Camera, posture: FloatArray, silhouette: Silhouette
) -> NDArray[np.int8]:
    """Return the part of each pixel (H, W), or -1 if it is not certain."""
    # The outline that gave the posture has rigid shoulders.
    frames = pose(body.rigid, posture)
    labels = np.full(silhouette.shape, -1, np.int8)
    size = body.size

    def pixels(points_m: FloatArray) -> FloatArray:
        optical = camera.reference_to_optical(np.asarray(points_m, dtype=np.float64))
        # An estimated hand can be at the lens or behind it.
        optical[..., 2] = np.maximum(optical[..., 2], NEAREST_M)
        return np.asarray(camera.project(optical))

    def upright(
        part: int, low: float, high: float, half_low: float, half_high: float, x: float = 0.0
    ) -> None:
        """Label a trapezoid in the torso frame from height ``low`` to ``high``, metres."""
        corners = np.array(
            [(x, -half_low, low), (x, half_low, low), (x, half_high, high), (x, -half_high, high)]
        )
        area = np.zeros(silhouette.shape, np.uint8)
        placed = pixels(frames.hip + corners @ frames.torso_rotation.T)
        cv2.fillConvexPoly(area, np.round(placed).astype(np.int32), 1)
        labels[area > 0] = part

    waist, top = size("waist_height"), size("waist_height") + size("torso_height")
    chin, head = top + size("neck_length"), size("head_height")
    half, forward = 0.4 * size("head_width"), size("head_offset")
    upright(TORSO, 0.5 * waist, top, 0.4 * size("waist_width"), 0.36 * size("torso_top_width"))
    upright(HEAD, chin + 0.02, chin + head, half, 0.8 * half, forward)
    # The neck is labelled as head, so that its skin is not taken for a hand before the torso.
    upright(HEAD, top + 0.01, chin + 0.02, 0.75 * half, 0.75 * half)
    upright(_FACE, chin + 0.2 * head, chin + 0.6 * head, 0.6 * half, 0.6 * half, forward)
    upright(LEGS, -0.3, -0.08, 0.42 * size("waist_width"), 0.42 * size("waist_width"))
    for arm in (frames.left, frames.right):
        elbow, hand = pixels(arm.elbow), pixels(arm.hand)
        length = size("forearm_length")
        per_m = (hand - elbow) / length
        tip_m = _tip_m(silhouette, elbow, per_m, length)
        thick = max(1, round(0.5 * size("forearm_width") * float(np.hypot(*per_m))))
        for part, begin_m, end_m in (
            (FOREARM, 0.15 * length, tip_m - 0.20),
            (HAND, tip_m - 0.13, tip_m - 0.05),
        ):
            if end_m > begin_m:
                a, b = (np.round(elbow + m * per_m).astype(int).tolist() for m in (begin_m, end_m))
                area = np.zeros(silhouette.shape, np.uint8)
                cv2.line(area, a, b, 1, thick)
                labels[area > 0] = part
    # Pixels at the outline are a mixture with the background.
    labels[cv2.erode(silhouette, np.ones((3, 3), np.uint8)) == 0] = -1
    return labels


def _tip_m(silhouette: Silhouette, elbow: FloatArray, per_m: FloatArray, length_m: float) -> float:
    """Return the distance from elbow to the arm's tip; ``length_m`` if no tip is near it."""
    height, width = silhouette.shape
    for metres in np.arange(length_m + 0.12, length_m - 0.12, -0.005):
        u, v = np.round(elbow + metres * per_m).astype(int)
        if 0 <= v < height and 0 <= u < width and silhouette[v, u]:
            return float(metres)
    return length_m
