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
from cardbox_tracker.common.health import Verdict
from cardbox_tracker.common.least_squares import Residuals, geman_mcclure
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.terms.term import Silhouette

# A point this close to the image border may belong to a part that is cut off.
_BORDER_PX = 4.0
# Standard deviation of a height, and the height with a quarter of the weight, px. The small
# deviation lets the tangents outweigh the outlines, which are biased.
_HEIGHT_PX, _HALF_PX = 0.1, 4.0
# Largest effective number of frames, since neighbouring frames are correlated.
_COUNTED = 150
# Roll: Gauss-Newton steps, step of the differences, height with a quarter of the weight, least
# noise; fewest heights and largest condition number.
_ROLL_STEPS, _TRIED_RAD, _ROLL_HALF_PX, _LEAST_NOISE_PX = 4, 0.003, 2.0, 0.3
_FEWEST, _LARGEST_CONDITION = 8, 1e6

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
        along, axes_here, axes = self.pencil(pose) if isinstance(pose, Extrinsics) else pose
        found = np.full(len(self._hulls), np.nan)
        for number, (one, two) in enumerate(self._hulls):
            here, is_whole = _highest(one, axes_here)
            there, is_whole_there = _highest(two, axes)
            if is_whole and is_whole_there:
                angles = [atan2(*(axes_here @ here)), atan2(*(axes @ there))]
                across = sqrt(1.0 - float(there @ along) ** 2)
                found[number] = (angles[0] - angles[1]) * across * self._other.fx
        return found

    def residuals(self, heights: FloatArray, slopes: FloatArray) -> Residuals:
        """Return the residuals of :meth:`heights` (n,) with their derivatives (n, k)."""
        known = np.isfinite(heights) & np.isfinite(slopes).all(axis=1)
        weight = min(1.0, _COUNTED / max(1, int(np.count_nonzero(known))))
        return geman_mcclure(
            heights[known][None], slopes[known][None], _HALF_PX, _HEIGHT_PX, weight
        )


def roll_of(tangents: TopTangents, extrinsics: Extrinsics) -> tuple[float, float]:
    """Return the roll of the other camera against ``extrinsics``, and its standard deviation, rad.

    Pitch changes all heights equally, while the effect of roll depends on the column; both are
    estimated by weighted least squares. So the highest points (head, raised hands) must lie at
    different columns; if they do not, the deviation is inf.
    """
    turn = np.zeros(2)
    for _ in range(_ROLL_STEPS):
        now = _turned(extrinsics, turn)
        heights = tangents.heights(now)
        slopes = np.array(
            [
                tangents.heights(_turned(now, change)) - tangents.heights(_turned(now, -change))
                for change in _TRIED_RAD * np.eye(2)
            ]
        ) / (2.0 * _TRIED_RAD)
        known = np.isfinite(heights) & np.isfinite(slopes).all(axis=0)
        heights, slopes = heights[known], slopes[:, known]
        weighted = slopes * (1.0 + (heights / _ROLL_HALF_PX) ** 2) ** -2.0
        matrix = weighted @ slopes.T
        if len(heights) < _FEWEST or np.linalg.cond(matrix) > _LARGEST_CONDITION:
            return 0.0, float("inf")
        turn -= np.linalg.solve(matrix, weighted @ heights)
    noise_px = max(_LEAST_NOISE_PX, 1.48 * float(np.median(np.abs(heights))))
    return float(turn[1]), noise_px * float(np.sqrt(np.linalg.inv(matrix)[1, 1]))


def _turned(extrinsics: Extrinsics, turn: FloatArray) -> Extrinsics:
    """Return the pose after a pitch and a roll, (2,), rad."""
    vector = np.array([turn[0], 0.0, turn[1]])
    matrix = np.asarray(cv2.Rodrigues(vector)[0], np.float64)
    return Extrinsics(matrix @ extrinsics.rotation, matrix @ extrinsics.translation_m)


def _hull(mask: Silhouette, camera: Camera) -> _Hull:
    """Return the convex hull as unit rays (n, 3), and whether each is inside the image, (n,)."""
    left, top, width, height = cv2.boundingRect(mask)
    if not width:
        return np.empty((0, 3)), np.empty(0, np.bool_)
    seen = mask[top : top + height, left : left + width] != 0
    # The ends of the rows have the same hull as all pixels, and are a hundredth of them.
    starts, ends = seen.argmax(axis=1), width - 1 - seen[:, ::-1].argmax(axis=1)
    rows = np.flatnonzero(seen[np.arange(height), starts])
    columns = np.concatenate([starts[rows], ends[rows]]) + left
    points = np.column_stack([columns, np.concatenate([rows, rows]) + top]).astype(np.int32)
    hull = cv2.convexHull(points).reshape(-1, 2).astype(np.float64)
    x, y = hull.T
    inside = (x >= _BORDER_PX) & (x < camera.width - _BORDER_PX) & (y >= _BORDER_PX)
    rays = camera.rays(hull)
    return rays / np.linalg.norm(rays, axis=1)[:, None], inside


def _highest(hull: _Hull, axes: FloatArray) -> tuple[FloatArray, bool]:
    """Return the ray with the largest angle in the plane of ``axes`` (2, 3): up, ahead."""
    rays, inside = hull
    up, ahead = axes @ rays.T
    number = int(np.argmax(np.arctan2(up, ahead)))
    return rays[number], bool(inside[number])


EVERY = 6
"""Frames between samples."""
# The same for the first frames, whose number follows, so that a verdict comes early.
_EVERY_AT_FIRST, _FIRST = 2, 60
# An inverted pose's height is more than that of its inverse divided by this.
_BETTER = 0.25


class PoseDirection:
    """Compares the heights of one further camera's tangents for its pose and the inverse pose.

    An error of the heights by degrees shows a wrong pose within seconds, also while no posture
    fits. If they agree for the inverse pose, the pose is inverted or the images are exchanged.
    """

    def __init__(self, first: Camera, other: Camera, given: Extrinsics, roll_rad: float) -> None:
        """Begin without samples; ``given`` is the pose of ``other``, turned upright by the roll."""
        self._tangents = TopTangents(first, other, most=1)
        # The images have been turned by the roll of the given pose, even if that pose is inverted.
        c, s = np.cos(roll_rad), np.sin(roll_rad)
        roll = np.array([(c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)])
        raw = Extrinsics(roll @ given.rotation, roll @ given.translation_m).inverse()
        inverse = Extrinsics(roll.T @ raw.rotation, roll.T @ raw.translation_m)
        self._pencils = [self._tangents.pencil(pose) for pose in (given, inverse)]
        self._per_px = np.degrees(1.0 / other.fx)
        self._frames = 0
        self._inverted, self._wrong = Verdict("inverted", _explained), Verdict("contradicted")

    @property
    def fault(self) -> Verdict | None:
        """The error according to the latest samples; None for a pose without a gross error."""
        return next((one for one in (self._inverted, self._wrong) if one.holds), None)

    @property
    def height_deg(self) -> float:
        """Median angle between both cameras' tangent planes, degrees; 0 while unknown."""
        return self._wrong.value

    def see(self, first: Silhouette, other: Silhouette) -> None:
        """Add a frame with silhouettes (H, W), 0 or 255, whether a posture fits them or not."""
        self._frames += 1
        # An error that is over is forgotten as soon as it was found.
        is_often = self._frames <= _FIRST or self.fault is not None
        if self._frames % (_EVERY_AT_FIRST if is_often else EVERY):
            return
        if not self._tangents.add(first, other):
            return
        heights = [float(self._tangents.heights(pencil)[0]) for pencil in self._pencils]
        given, inverse = (abs(height) * self._per_px for height in heights)
        if not np.isfinite(given):
            return
        # The inverse pose is no better if it does not even show the top.
        self._inverted.see(given, inverse if np.isfinite(inverse) else np.inf)
        self._wrong.see(given)


def _explained(given: float, inverse: float) -> float:
    """Return the height that the given pose leaves and the inverse one explains, or 0."""
    return given if inverse < _BETTER * given else 0.0
