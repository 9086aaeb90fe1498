"""Epipolar tangency constraints on the relative pose of two cameras.

A plane through both camera centres that touches a person from above touches both silhouettes
(Cipolla, Astrom and Giblin, "Motion from the frontier of curved surfaces", 1995). So both
silhouettes have the same highest angle about the baseline. The constraint needs no body model,
hence hair and clothes cause no error.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from math import atan2, sqrt
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.extrinsics import Extrinsics
from cardbox_tracker.common.health import WATCHES, Verdict
from cardbox_tracker.common.least_squares import (
    DIFFERENCE,
    Residuals,
    geman_mcclure,
    minimize,
    rules_of,
)
from cardbox_tracker.detectors.image_points import CERTAIN, POINT_NAMES, ImagePoints
from cardbox_tracker.measuring.motion_lag import MotionLag
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.terms.term import Silhouette

# A point this close to the image border may belong to a part that is cut off.
_BORDER_PX = 4.0
# Standard deviation of a height, and the height with a quarter of the weight, px. The small
# deviation lets the tangents outweigh the outlines, which are biased.
_HEIGHT_PX, _HALF_PX = 0.1, 4.0
# Largest effective number of frames, since neighbouring frames are correlated.
_COUNTED = 150
# Most steps to a roll, and fewest heights that show one.
_ROLL_STEPS, _FEWEST = 4, 8

# Images as they come, mirrored, and upside down: what becomes of columns and rows about the middle.
_FLIPS = np.array([np.diag((1.0, 1.0)), np.diag((-1.0, 1.0)), np.diag((-1.0, -1.0))])

_Hull = tuple[FloatArray, NDArray[np.bool_]]


class Pencil(NamedTuple):
    """The planes through both cameras of a pose."""

    along: FloatArray  #: direction of the baseline in the other camera's frame, (3,)
    #: directions up and ahead across the baseline, (2, 3), in the first camera's frame.
    here: FloatArray
    there: FloatArray  #: the same in the other camera's frame


class TopTangents:
    """The convex hulls of two cameras' silhouettes, which determine their tangent planes."""

    def __init__(
        self,
        first: Camera,
        other: Camera,
        pairs: Iterable[tuple[Silhouette, Silhouette]] = (),
        most: int | None = None,
    ) -> None:
        """Add silhouettes (H, W), 0 or 255, of both cameras, of which the latest frames are kept.

        The first camera includes its pitch.
        """
        self._first, self._other = first, other
        self._up = first.reference_to_optical_rotation() @ np.array([0.0, 0.0, 1.0])
        self._hulls: deque[tuple[_Hull, _Hull]] = deque(maxlen=most)
        for one, two in pairs:
            self.add(one, two)

    def add(self, one: Silhouette, two: Silhouette) -> bool:
        """Add the silhouettes of a frame and return True, unless one of them is empty."""
        hulls = _hull(one, self._first), _hull(two, self._other)
        is_there = all(len(rays) for rays, _ in hulls)
        if is_there:
            self._hulls.append(hulls)
        return is_there

    def copy(self) -> TopTangents:
        """Return a copy for use in another thread."""
        now = TopTangents(self._first, self._other)
        now._hulls.extend(list(self._hulls))
        return now

    def pencil(self, extrinsics: Extrinsics) -> Pencil:
        """Return the planes of a pose, for several calls of :meth:`heights`."""
        along = extrinsics.translation_m / np.linalg.norm(extrinsics.translation_m)
        up = extrinsics.rotation @ self._up
        ahead = np.cross(along, up)
        ahead /= np.linalg.norm(ahead)
        # The person is in front of the other camera.
        ahead *= 1.0 if ahead[2] > 0.0 else -1.0
        axes = np.array([up - (up @ along) * along, ahead])
        axes[0] /= np.linalg.norm(axes[0])
        return Pencil(along, axes @ extrinsics.rotation, axes)

    def heights(self, pose: Extrinsics | Pencil) -> FloatArray:
        """Return the height of the first camera's tangent above the other camera's, (n,), px.

        It is in pixels of the other camera; NaN if a silhouette is cut off at the border.
        """
        pencil = self.pencil(pose) if isinstance(pose, Extrinsics) else pose
        found = [_height_of(*pair, pencil) for pair in self._hulls]
        return np.array(found, np.float64) * self._other.fx

    def residuals(self, heights: FloatArray, slopes: FloatArray) -> Residuals:
        """Return the residuals of :meth:`heights` (n,) with their derivatives (n, k)."""
        known = np.isfinite(heights) & np.isfinite(slopes).all(axis=1)
        weight = min(1.0, _COUNTED / max(1, int(np.count_nonzero(known))))
        return geman_mcclure(
            heights[known][None], slopes[known][None], _HALF_PX, _HEIGHT_PX, weight
        )


def _height_of(one: _Hull, two: _Hull, pencil: Pencil) -> float:
    """Return the angle of the first camera's tangent above the other's, rad; nan if one is cut."""
    (here, is_whole), (there, is_whole_there) = (
        _highest(one, pencil.here),
        _highest(two, pencil.there),
    )
    if not (is_whole and is_whole_there):
        return float("nan")
    angle = atan2(*(pencil.here @ here)) - atan2(*(pencil.there @ there))
    return angle * sqrt(1.0 - float(there @ pencil.along) ** 2)


def roll_of(tangents: TopTangents, extrinsics: Extrinsics) -> tuple[float, float]:
    """Return the roll of the other camera against ``extrinsics``, and its standard deviation, rad.

    Pitch changes all heights equally, while the effect of roll depends on the column; both are
    estimated by weighted least squares. So the highest points (head, raised hands) must lie at
    different columns; if they do not, the deviation is inf.
    """

    def tops(turn: FloatArray) -> Residuals:
        now = _turned(extrinsics, turn[0])
        heights = tangents.heights(now)
        moved = [tangents.heights(_turned(now, step)) for step in DIFFERENCE * np.eye(2)]
        slopes = (np.column_stack(moved) - heights[:, None]) / DIFFERENCE
        known = np.isfinite(slopes).all(axis=1)
        return geman_mcclure(heights[known][None], slopes[known][None], _HALF_PX)

    found = minimize({"tops": tops}, np.zeros((1, 2)), rules_of(2), _ROLL_STEPS)
    turn, information = found.values[0], found.information[0]
    heights = tangents.heights(_turned(extrinsics, turn))
    heights = heights[np.isfinite(heights)]
    if len(heights) < _FEWEST or np.linalg.matrix_rank(information) < len(information):
        return 0.0, float("inf")
    noise_px = max(_HEIGHT_PX, 1.48 * float(np.median(np.abs(heights))))
    return float(turn[1]), noise_px * float(np.sqrt(np.linalg.inv(information)[1, 1]))


def _turned(extrinsics: Extrinsics, turn: FloatArray) -> Extrinsics:
    """Return the pose after a pitch and a roll, (2,), rad."""
    vector = np.array([turn[0], 0.0, turn[1]])
    matrix = np.asarray(cv2.Rodrigues(vector)[0], np.float64)
    return Extrinsics(matrix @ extrinsics.rotation, matrix @ extrinsics.translation_m)


def _hull(mask: Silhouette, camera: Camera) -> _Hull:
    """Return the convex hull as unit rays (n, 3), and whether each is inside the image, (n,)."""
    px = _outline(mask)
    return _hull_of(px, camera) if len(px) else (np.empty((0, 3)), np.empty(0, np.bool_))


def _outline(mask: Silhouette) -> FloatArray:
    """Return columns and rows of the convex hull (n, 2), px."""
    left, top, width, height = cv2.boundingRect(mask)
    if not width:
        return np.empty((0, 2))
    seen = mask[top : top + height, left : left + width] != 0
    # The ends of the rows have the same hull as all pixels, and are a hundredth of them.
    starts, ends = seen.argmax(axis=1), width - 1 - seen[:, ::-1].argmax(axis=1)
    rows = np.flatnonzero(seen[np.arange(height), starts])
    columns = np.concatenate([starts[rows], ends[rows]]) + left
    points = np.column_stack([columns, np.concatenate([rows, rows]) + top]).astype(np.int32)
    return cv2.convexHull(points).reshape(-1, 2).astype(np.float64)


def _hull_of(px: FloatArray, camera: Camera, flip: FloatArray = _FLIPS[0]) -> _Hull:
    """Return :func:`_hull` of an outline (n, 2), px, in a flipped image: ``flip`` is (2, 2)."""
    middle = 0.5 * np.array([camera.width - 1.0, camera.height - 1.0])
    px = (px - middle) @ flip.T + middle
    x, y = px.T
    inside = (x >= _BORDER_PX) & (x < camera.width - _BORDER_PX) & (y >= _BORDER_PX)
    rays = camera.rays(px)
    return rays / np.linalg.norm(rays, axis=1)[:, None], inside


def _highest(hull: _Hull, axes: FloatArray) -> tuple[FloatArray, bool]:
    """Return the ray with the largest angle in the plane of ``axes`` (2, 3): up, ahead."""
    rays, inside = hull
    up, ahead = axes @ rays.T
    number = int(np.argmax(np.arctan2(up, ahead)))
    return rays[number], bool(inside[number])


EVERY = 6
"""Frames between samples of a model."""
# The same for tangents, after the first ones.
_EVERY, _FIRST = 2, 6
# A supposed fault leaves less than this share of the height that the given pose leaves; the most
# that counts of what it explains otherwise, degrees.
_BETTER, _REST = 0.4, 0.1
LEAST_POINTS = 4
"""Fewest joints that both cameras show for a comparison."""
# Tops that differ otherwise than joints that agree, by so much, are not both the person's, degrees.
_OTHER_TOP_DEG = 2.0


class PoseDirection:
    """Compares the heights of one further camera's tangents for its pose and for usual faults.

    An error of the heights by degrees shows a wrong pose within seconds, also while no posture
    fits. If they agree for the inverse pose, the pose is inverted or the images are exchanged; if
    they do for flipped images, one of the cameras is mirrored or upside down. The joints that a
    detector finds in both images have heights, too.
    """

    def __init__(self, first: Camera, other: Camera, given: Extrinsics, roll_rad: float) -> None:
        """Begin without samples; ``given`` is the pose of ``other``, turned upright by the roll."""
        self._cameras, tangents = (first, other), TopTangents(first, other)
        # The images have been turned by the roll of the given pose, even if that pose is inverted.
        c, s = np.cos(roll_rad), np.sin(roll_rad)
        roll = np.array([(c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)])
        raw = Extrinsics(roll @ given.rotation, roll @ given.translation_m).inverse()
        inverse = Extrinsics(roll.T @ raw.rotation, roll.T @ raw.translation_m)
        self._given = pencil = tangents.pencil(given)
        # Cameras flip their images before these are turned upright.
        self._flips = _FLIPS, roll[:2, :2].T @ _FLIPS @ roll[:2, :2]
        # Usual faults: pose, and which of ``_FLIPS`` each camera's images would be.
        self._supposed = [
            (Verdict("inverted", _explained), tangents.pencil(inverse), 0, 0),
            (Verdict("mirrored", _explained), pencil, 0, 1),
            (Verdict("mirrored", _explained), pencil, 1, 0),
            (Verdict("upside down", _explained), pencil, 0, 2),
            (Verdict("upside down", _explained), pencil, 2, 0),
        ]
        self._frames = 0
        self._wrong, self.height = Verdict("contradicted"), Verdict("height")
        self.joints, self.lag = Verdict("joints"), MotionLag()

    @property
    def fault(self) -> Verdict | None:
        """The error according to the latest samples; None for a pose without a gross error."""
        explained = [one for one, *_ in self._supposed if one.holds]
        best = min(explained, key=lambda one: one.medians[1], default=self._wrong)
        return best if best.holds else None

    @property
    def is_suspected(self) -> bool:
        """Whether too few samples for a verdict show any of the errors."""
        supposed = (one for one, *_ in self._supposed)
        verdicts = (self.height, self.joints, *supposed)
        return self.lag.is_suspected or any(one.is_suspected for one in verdicts)

    def see(
        self,
        first: Silhouette,
        other: Silhouette,
        points: tuple[ImagePoints | None, ImagePoints | None] = (None, None),
        stamp_ns: int | None = None,
    ) -> None:
        """Add a frame with silhouettes (H, W), 0 or 255, whether a posture fits them or not.

        ``points`` are those of a detector in both images. Without a stamp, no lag is looked for.
        """
        joints = self._see_joints(*points)
        heights = joints, self._see_silhouettes(first, other, _lower_deg(joints))
        if stamp_ns is not None:
            self.lag.add(stamp_ns, *np.hstack(heights))

    def _see_silhouettes(
        self, first: Silhouette, other: Silhouette, joints_deg: float | None
    ) -> FloatArray:
        """Return the height of the top in both cameras, (2, 1), rad; nan where it is unknown.

        ``joints_deg`` is how much lower joints are in the other camera.
        """
        tops = np.full((2, 1), np.nan)
        self._frames += 1
        if self._frames > _FIRST and self._frames % _EVERY:
            return tops
        hulls = [
            [_hull_of(px, camera, flip) for flip in flips]
            for mask, camera, flips in zip((first, other), self._cameras, self._flips, strict=True)
            if len(px := _outline(mask))
        ]
        if len(hulls) < len(self._cameras):
            return tops
        for number, ((hull, *_), axes) in enumerate(zip(hulls, self._given[1:], strict=True)):
            ray, is_whole = _highest(hull, axes)
            tops[number] = np.arctan2(*(axes @ ray)) if is_whole else np.nan
        lower_deg = np.degrees(_height_of(hulls[0][0], hulls[1][0], self._given))
        given = abs(lower_deg)
        if np.isfinite(given):
            self._wrong.see(given)
            # A mask may have a thing above the head; then the joints agree.
            is_agreed = joints_deg is not None and not self.joints.watch.is_beyond(abs(joints_deg))
            if not is_agreed or abs(lower_deg - joints_deg) < _OTHER_TOP_DEG:
                self.height.see(given)
        for verdict, pencil, here, there in self._supposed:
            supposed = abs(np.degrees(_height_of(hulls[0][here], hulls[1][there], pencil)))
            if np.isfinite(given) or np.isfinite(supposed):
                # A supposed fault is none if it does not even show the top, as is the given pose.
                verdict.see(*(float(np.nan_to_num(one, nan=np.inf)) for one in (given, supposed)))
        return tops

    def _see_joints(self, one: ImagePoints | None, other: ImagePoints | None) -> FloatArray:
        """Return heights of the joints that both show, (2, n), rad; nan for others."""
        angles = self._heights(one, other)
        apart_deg = _apart_deg(angles)
        if apart_deg is not None:
            self.joints.see(apart_deg)
        return angles

    def joints_deg(self, one: ImagePoints | None, other: ImagePoints | None) -> float | None:
        """Return the median angle between the planes of the same joints; None if few are known."""
        return _apart_deg(self._heights(one, other))

    def _heights(self, one: ImagePoints | None, other: ImagePoints | None) -> FloatArray:
        angles = np.full((2, len(POINT_NAMES)), np.nan)
        if one is not None and other is not None:
            known = (one.scores >= CERTAIN) & (other.scores >= CERTAIN)
            pairs = zip(self._given[1:], self._cameras, (one, other), strict=True)
            for number, (axes, camera, points) in enumerate(pairs):
                angles[number, known] = np.arctan2(*(axes @ camera.rays(points.px[known]).T))
        return angles


def _lower_deg(angles: FloatArray) -> float | None:
    lower = angles[0] - angles[1]
    known = np.isfinite(lower)
    is_enough = np.count_nonzero(known) >= LEAST_POINTS
    return float(np.degrees(np.median(lower[known]))) if is_enough else None


def _apart_deg(angles: FloatArray) -> float | None:
    return _lower_deg(np.array([np.abs(angles[0] - angles[1]), np.zeros(angles.shape[1])]))


def _explained(given: float, supposed: float) -> float:
    """Return the height that the given pose leaves if a supposed fault explains it, else a rest.

    The rest is below the limit, and more than 0 if the fault still explains more than the pose.
    """
    given = min(given, WATCHES["contradicted"].limit)
    return given if supposed < _BETTER * given else min(max(given - supposed, 0.0), _REST)
