"""MediaPipe's pose networks on LiteRT: 33 points and a person mask from one colour image.

1. A detector (224x224) finds the person: hip centre, size and direction of the body.
2. A landmark network (256x256) on that turned square gives points, heat maps and the mask.
3. While the person stays in view, the square of the next image follows from the points of the last
   one, so step 1 runs only for a new person.

Both networks are files of the wheel ``mediapipe`` 0.10.21 (Apache-2.0), see :mod:`.model_files`.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from math import atan2, cos, hypot, pi, sin
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.extensions import optional
from cardbox_tracker.detectors.figure import Figure
from cardbox_tracker.detectors.identity import Identity, colours_in
from cardbox_tracker.detectors.image_points import (
    LEG_POINT_NAMES,
    POINT_NAMES,
    ImagePoints,
    LegPoints,
)

FloatArray = NDArray[np.float64]
ColorImage = NDArray[np.uint8]

LANDMARKS = (
    "nose",
    *("left_eye_inner", "left_eye", "left_eye_outer"),
    *("right_eye_inner", "right_eye", "right_eye_outer"),
    *("left_ear", "right_ear", "mouth_left", "mouth_right"),
    *(
        f"{side}_{name}"
        for name in (
            *("shoulder", "elbow", "wrist", "little_finger", "index", "thumb"),
            *("hip", "knee", "ankle", "heel", "foot"),
        )
        for side in ("left", "right")
    ),
)
"""``left`` is the person's left; fingers are their knuckles at the base."""
POINTS = len(LANDMARKS)
"""Points of a person."""

_DETECTOR_PX, _LANDMARK_PX = 224, 256
# Cells of the detector's feature maps: pixels a cell, anchors a cell.
_LAYERS = ((8, 2), (16, 2), (32, 6))
_LEAST_DETECTION, _LEAST_PRESENCE = 0.5, 0.5
_SAME_PERSON_IOU = 0.3
# Hips of two people are at least this share of a square apart.
_LEAST_APART = 0.2
# Images between those that are also searched for further people, and usual time between images.
_LOOK_AROUND, _USUAL_NS = 30, 33_333_333
# A chance of one half.
_LEAST_MASK = 128
# Grey of pixels that the landmark network does not see.
_UNSEEN = np.float32(0.5)
# The square around the person is this much larger than the circle through the detected points.
_SQUARE_SCALE = 1.25
# Two further outputs of the landmark network say where the next square is: centre and scale.
_CENTRE, _SCALE = 33, 34
_OUTPUTS = 39
# With two threads, a network takes two thirds of the time.
_THREADS = 2
# A point moves to the centroid of its heat map in a window of this many cells.
_HEAT_WINDOW, _LEAST_HEAT = 7, 0.5
_CELLS = np.indices((_HEAT_WINDOW, _HEAT_WINDOW))[::-1].reshape(2, -1).T


class Square(NamedTuple):
    """A turned square of the image."""

    u: float  #: column of its centre, px
    v: float  #: row of its centre, px
    side: float  #: px
    angle_rad: float  #: by which it is turned clockwise in the image

    def to_image(self, points: FloatArray) -> FloatArray:
        """Return points (N, 2) of the square, 0 to 1, in pixels of the image."""
        x, y = self.side * (points[:, 0] - 0.5), self.side * (points[:, 1] - 0.5)
        c, s = cos(self.angle_rad), sin(self.angle_rad)
        return np.column_stack([self.u + c * x - s * y, self.v + s * x + c * y])


class Detection(NamedTuple):
    """One person in one image."""

    points_px: FloatArray  #: (33, 2), column and row; (0, 0) is the centre of the first pixel
    scores: FloatArray  #: (33,), chance that the point is in the image and visible, 0 to 1
    mask: NDArray[np.uint8]  #: (H, W) uint8, 255 times the chance that a pixel shows the person
    #: the points in space relative to the hips, (33, 3), metres for an average person: x right, y
    #: down, z away from the camera; None if it is unknown. The network takes the camera for level.
    spatial_m: FloatArray | None = None

    def silhouette(self) -> NDArray[np.uint8]:
        """Return the silhouette (H, W), 255 where a pixel more likely shows the person, else 0."""
        return np.asarray(np.uint8(255) * (self.mask >= _LEAST_MASK))


NOBODY = Detection(np.zeros((POINTS, 2)), np.zeros(POINTS), np.zeros((0, 0), np.uint8))
"""All points are missing."""


def figure_of(found: Detection) -> Figure:
    """Return the figure of a detection."""
    return Figure(dict(zip(LANDMARKS, found.points_px, strict=True)))


class PoseNetwork:
    """Finds one person in image after image, at first the most certain one.

    Attributes:
        several: number of images with several people, of those that were searched for them.
    """

    def __init__(self, detector: Path, landmarks: Path) -> None:
        """Load both networks; CardboxError without LiteRT, or if a file is missing or damaged."""
        self._detect = Network(detector)
        self._locate = Network(landmarks)
        self.forget()

    def forget(self) -> None:
        """Search the whole next image instead of around the last person, for whoever is there."""
        self._images = self._now_ns = self.several = 0
        self._identity = Identity()
        self.start_anew()

    def start_anew(self) -> None:
        """Do so in the same film, in which people were counted."""
        self._square: Square | None = None
        self._identity.forget()

    def __call__(self, image: ColorImage, stamp_ns: int | None = None) -> Detection | None:
        """Return the person in an image (H, W, 3), bgr; None where the followed one is not seen.

        Whom it found first it follows, and nobody else. The stamp is in ns; None is 1/30 s after
        the last.
        """
        rgb = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), np.uint8)
        self._images += 1
        self._now_ns = self._now_ns + _USUAL_NS if stamp_ns is None else stamp_ns
        identity, people = self._identity, None
        if self._square is not None:
            if self._images % _LOOK_AROUND == 0:
                people = self._people(rgb)
            located = self.located(rgb, self._square)
            if located is not None and self._is_same(image, located):
                if identity.is_doubtful and people is None:
                    people = self._people(rgb)
                if not identity.is_doubtful or not self.several:
                    return self._follow(located)
        people = self._people(rgb) if people is None else people
        self._square = None
        if not identity.is_known and people:
            identity.forget()
            people = people[:1]
        elif self.several:
            identity.lose()
        for square in people:
            located = self.located(rgb, square)
            if located is not None and self._is_same(image, located):
                return self._follow(located)
        if not people:
            identity.nobody(self._now_ns)
        return None

    def _follow(self, located: tuple[Detection, Square]) -> Detection:
        found, self._square = located
        return found

    def _is_same(self, image: ColorImage, located: tuple[Detection, Square]) -> bool:
        """Return whether somebody in a bgr image is the person who is followed."""
        found = located[0]
        figure = figure_of(found)
        trunk = figure.trunk(found.mask.shape) & found.silhouette()
        return self._identity.is_same(figure, colours_in(image, trunk), self._now_ns)

    def _people(self, image: ColorImage) -> list[Square]:
        """Return the squares around the people in an rgb image, the most certain one first."""
        height, width = image.shape[:2]
        people = self.detected(image, Square(width / 2, height / 2, max(height, width), 0.0))
        self.several += len(people) > 1
        return people

    def detected(self, image: ColorImage, view: Square) -> list[Square]:
        """Return squares around people in a view of an rgb image, the most certain one first."""
        cut = cut_out(image, view, _DETECTOR_PX, cv2.BORDER_CONSTANT)
        boxes, logits = self._detect(2.0 * cut - 1.0)
        scores = _chance(logits.ravel())
        likely = np.flatnonzero(scores >= _LEAST_DETECTION)
        decoded = boxes[0, likely].astype(np.float64) / _DETECTOR_PX
        anchors = _anchors()[likely]
        decoded.reshape(-1, 6, 2)[:, [0, 2, 3, 4, 5]] += anchors[:, None]
        people = list[Square]()
        for merged in _merged(decoded, scores[likely]):
            square = _square_of(*view.to_image(merged[4:8].reshape(2, 2)))
            least_px = _LEAST_APART * square.side
            if all(hypot(one.u - square.u, one.v - square.v) > least_px for one in people):
                people.append(square)
        return people

    def located(
        self, image: ColorImage, square: Square, others: NDArray[np.uint8] | None = None
    ) -> tuple[Detection, Square] | None:
        """Return the person in a square of an rgb image (H, W, 3), and the next square, or None.

        The network does not see pixels of others, (H, W), that are not 0.
        """
        cut = cut_out(image, square, _LANDMARK_PX, cv2.BORDER_REPLICATE)
        if others is not None:
            cut[_warped(others, square, _LANDMARK_PX, cv2.BORDER_CONSTANT) > 0] = _UNSEEN
        raw, presence, mask, heat, space = self._locate(cut)
        if float(presence[0, 0]) < _LEAST_PRESENCE:
            return None
        values = raw.reshape(_OUTPUTS, 5).astype(np.float64)
        points = values[:, :2] / _LANDMARK_PX
        points = _refined(points, heat[0])
        placed = square.to_image(points)
        visible, present = _chance(values[:POINTS, 3:5].T)
        found = Detection(
            placed[:POINTS] - 0.5,
            np.minimum(visible, present),
            _mask_in_image(mask[0, :, :, 0], square, image.shape[:2]),
            turned_points(space.reshape(_OUTPUTS, 3)[:POINTS].astype(np.float64), square.angle_rad),
        )
        return found, _square_of(placed[_CENTRE], placed[_SCALE])


class Network:
    """One network file."""

    def __init__(self, path: Path) -> None:
        """Load it; CardboxError without LiteRT, or if the file is missing or damaged."""
        needed = "ai_edge_litert.interpreter", "the detector needs ai-edge-litert", "detector"
        Interpreter = optional(*needed).Interpreter
        try:
            with _silent():
                # A process that has others beside it limits OpenCV to one thread.
                threads = min(_THREADS, cv2.getNumThreads())
                self._run: Any = Interpreter(str(path), num_threads=threads)
                self._run.allocate_tensors()
        except (ValueError, OSError, RuntimeError) as error:
            raise CardboxError(
                f"{path} is no network that LiteRT can run ({error}); run "
                "'cardbox detector --install'"
            ) from None
        self._input = self._run.get_input_details()[0]["index"]
        self._outputs = [detail["index"] for detail in self._run.get_output_details()]

    def __call__(self, image: NDArray[np.float32]) -> list[NDArray[np.float32]]:
        """Return the outputs for one square image (N, N, 3)."""
        self._run.set_tensor(self._input, image[None])
        self._run.invoke()
        return [self._run.get_tensor(index) for index in self._outputs]


@contextmanager
def _silent() -> Iterator[None]:
    """Discard what the library writes to the terminal by itself; its exceptions have the faults."""
    sys.stderr.flush()
    terminal = os.dup(2)
    try:
        with open(os.devnull, "wb") as nothing:
            os.dup2(nothing.fileno(), 2)
        yield
    finally:
        os.dup2(terminal, 2)
        os.close(terminal)


def _anchors() -> FloatArray:
    """Centres of the detector's anchors, 0 to 1, (2254, 2)."""
    rows = []
    for stride, count in _LAYERS:
        cells = _DETECTOR_PX // stride
        centres = (np.arange(cells) + 0.5) / cells
        x, y = np.meshgrid(centres, centres)
        rows.append(np.repeat(np.column_stack([x.ravel(), y.ravel()]), count, axis=0))
    return np.concatenate(rows)


def _merged(decoded: FloatArray, scores: FloatArray) -> list[FloatArray]:
    """Weighted means (12,) of the detections that overlap the most certain one of the rest."""
    found = []
    while len(scores):
        centre, size = decoded[:, 0:2], decoded[:, 2:4]
        low, high = centre - size / 2, centre + size / 2
        best = int(np.argmax(scores))
        both = np.minimum(high, high[best]) - np.maximum(low, low[best])
        shared = np.prod(np.maximum(both, 0.0), axis=1)
        iou = shared / (np.prod(size, axis=1) + np.prod(size[best]) - shared)
        same = iou > _SAME_PERSON_IOU
        # A detection without an area overlaps nothing.
        same[best] = True
        found.append(np.average(decoded[same], axis=0, weights=scores[same]))
        decoded, scores = decoded[~same], scores[~same]
    return found


def _square_of(centre: FloatArray, rim: FloatArray) -> Square:
    """Square whose centre is ``centre`` and whose upward axis points to ``rim``, px."""
    du, dv = rim - centre
    angle = pi / 2 - atan2(-dv, du)
    turn = angle - 2 * pi * np.floor((angle + pi) / (2 * pi))
    return Square(float(centre[0]), float(centre[1]), 2 * _SQUARE_SCALE * hypot(du, dv), turn)


def cut_out(image: ColorImage, square: Square, size: int, border: int) -> NDArray[np.float32]:
    """Return a square of the image at ``size`` pixels, values 0 to 1."""
    cut = _warped(image, square, size, border).astype(np.float32)
    cut /= 255.0
    return cut


def _warped(image: ColorImage, square: Square, size: int, border: int) -> NDArray[np.uint8]:
    """Return a square of an image (H, W, ...) at ``size`` pixels."""
    turned = cv2.warpAffine(
        image,
        _to_image(square, size),
        (size, size),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=border,
    )
    return np.asarray(turned, np.uint8)


def _to_image(square: Square, size: int) -> FloatArray:
    """Matrix (2, 3) from pixels of a square of ``size`` to pixels of the image."""
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    there = square.to_image(corners).astype(np.float32)
    matrix = cv2.getAffineTransform(size * corners.astype(np.float32), there)
    return matrix.astype(np.float64)


def _refined(points: FloatArray, heat: NDArray[Any]) -> FloatArray:
    """Move each point (N, 2) to the centroid of its heat map, logits (H, W, N), around it."""
    size, number = np.array(heat.shape[1::-1]), np.arange(len(points))[:, None]
    middles = (points * size).astype(int)
    corners = middles - _HEAT_WINDOW // 2
    cells = corners[:, None] + _CELLS
    is_in = ((cells >= 0) & (cells < size)).all(axis=-1)
    column, row = np.moveaxis(cells.clip(0, size - 1), -1, 0)
    chances = np.where(is_in, _chance(heat[row, column, number]), 0.0)
    is_clear = ((middles >= 0) & (middles < size)).all(axis=1)
    is_clear &= chances.max(axis=1) >= _LEAST_HEAT
    total = np.where(is_clear, chances.sum(axis=1), 1.0)
    inside = np.column_stack([(chances * one).sum(axis=1) / total for one in _CELLS.T])
    return np.where(is_clear[:, None], (corners + inside) / size, points)


def turned_points(points: FloatArray, angle_rad: float) -> FloatArray:
    """Return points (N, 3) of a turned square in the axes of the image."""
    c, s = cos(angle_rad), sin(angle_rad)
    x, y, z = points.T
    turned: FloatArray = np.column_stack([c * x - s * y, s * x + c * y, z])
    return turned


def _mask_in_image(
    logits: NDArray[np.float32], square: Square, shape: tuple[int, ...]
) -> NDArray[np.uint8]:
    """Return the network's mask, whose values are logits, in the image, (H, W)."""
    matrix = _to_image(square, len(logits))
    mask = np.asarray(cv2.warpAffine(_chance(logits), matrix, (shape[1], shape[0])), np.float64)
    # In place, since large arrays take long to be made.
    mask *= 255.0
    return np.rint(mask, out=mask).astype(np.uint8)


def _chance(logits: NDArray[Any]) -> FloatArray:
    """Logistic function, without overflow."""
    chances: FloatArray = 1.0 / (1.0 + np.exp(-np.clip(logits.astype(np.float64), -60.0, 60.0)))
    return chances


_USED = np.array([LANDMARKS.index(name) for name in POINT_NAMES])
_LEGS = np.array([LANDMARKS.index(name) for name in LEG_POINT_NAMES])


def silhouette_of(found: Iterable[Detection], shape: tuple[int, ...]) -> NDArray[np.uint8]:
    """Return the silhouette (H, W) of all these people in an image of this shape, 0 or 255."""
    silhouette = np.zeros(shape[:2], np.uint8)
    for one in found:
        silhouette |= one.silhouette()
    return silhouette


def image_points(found: Detection) -> ImagePoints:
    """Return the points of a detection that the tracker uses."""
    (pixels, scores, spatial_m), legs = (
        (
            found.points_px[used],
            found.scores[used],
            None if found.spatial_m is None else found.spatial_m[used],
        )
        for used in (_USED, _LEGS)
    )
    return ImagePoints(pixels, scores, spatial_m=spatial_m, legs=LegPoints(*legs))
