"""Residuals of the silhouette's outline: how far the model's outline is from it.

The search counts pixels, so hair, clothes and fingers, which the model lacks, have the same weight
as an error of the torso's distance. Distances between outlines with robust weights separate both.
The model's outline consists of points on the edges of its patches that no other patch covers. Each
has a signed distance r, px, from the outline of the silhouette, which costs (Geman & McClure)

    INFORMATION * length * r^2 / (1 + r^2 / HALF^2)
"""

from __future__ import annotations

from math import sqrt

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.compiling import inlined_kernel, kernel
from cardbox_tracker.common.least_squares import Residuals
from cardbox_tracker.person.kinematics import TWIST, moves, state_twists
from cardbox_tracker.person.posture import N_STATE
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.segmentation.regions import SQUARE
from cardbox_tracker.terms.body_outline import (
    BODY_PATCHES,
    LIMB_PATCHES,
    TRUNK_PATCHES,
    new_scratch,
    place_patches,
)
from cardbox_tracker.terms.distance_field import FAR, padded_width, signed_distances_of
from cardbox_tracker.terms.kernel_arguments import BodyTuple, Floats, body_of
from cardbox_tracker.terms.outline_distances import ABOVE_HIPS_PX, HALF_PX, comparing
from cardbox_tracker.terms.outline_points import (
    POINTS,
    distance_at,
    find_outline,
    point_on_edge,
    project_corners,
)
from cardbox_tracker.terms.term import Posed, Silhouette, TermObservation

INFORMATION = 0.01
"""Weight of a pixel of outline, 1 / px^2; it is low because errors of neighbours are correlated."""
_PER_HALF = HALF_PX**-2
# Half of the stretch over which the distance's gradient is taken; shorter ones suffer from pixels.
# So near to the border of window or image, or to another person, no point of the outline counts.
_APART_PX = 3
# Margin around the silhouette, larger than the limit of the distances.
_MARGIN_PX = FAR + 2

SeenTuple = tuple[Floats, NDArray[np.float32], Floats]
"""fx, fy, cx, cy of the image of the distances, (4,); signed distances, (H, W), px, negative
inside; first and last column, first and end row of the part that counts, (4,), px."""
Found = tuple[Floats, Floats, Floats]
"""Values, Jacobian and costs of :class:`~cardbox_tracker.common.least_squares.Residuals`."""


class Outline(TermObservation):
    """The outline of one silhouette before one camera; it has residuals only.

    Attributes:
        is_empty: whether there is no foreground above the hips.
    """

    def __init__(
        self,
        silhouette: Silhouette,
        camera: Camera,
        hips: tuple[float, float],
        covered: Silhouette | None = None,
    ) -> None:
        """Compute the distances of a silhouette (H, W), 0 or 255, of the camera's size.

        ``hips`` are y and z of their middle in the optical frame, metres; legs, which the model
        lacks, do not count. At ``covered`` pixels (H, W) of other people no outline is known.
        """
        if covered is not None:
            silhouette = silhouette | covered
        small = comparing(camera)
        if silhouette.shape != (small.height, small.width):
            size = small.width, small.height
            silhouette = np.asarray(
                cv2.resize(silhouette, size, interpolation=cv2.INTER_AREA), np.uint8
            )
        down_m, ahead_m = hips
        row = small.fy * down_m / max(ahead_m, 1e-3) + small.cy
        left, top, field, within = signed_distances(silhouette, row - ABOVE_HIPS_PX)
        if covered is not None and field.size:
            _forget(field, left, top, covered, small)
        lens = np.array([small.fx, small.fy, small.cx - left, small.cy - top])
        self._seen: SeenTuple = lens, field, within
        self.is_empty = not field.size

    def residuals(self, posed: Posed) -> Residuals | None:
        """Return the distances of the visible outline; rows of hidden points are 0."""
        if self.is_empty:
            return None
        count = len(posed)
        found = np.zeros((count, POINTS)), np.zeros((count, POINTS, N_STATE)), np.zeros(count)
        _residuals(posed.states, posed.body, self._seen, found)
        return Residuals(*found)


def _forget(
    field: NDArray[np.float32], left: int, top: int, covered: Silhouette, small: Camera
) -> None:
    """Set the distances at and near ``covered`` pixels to 0, so that no outline pulls there."""
    pixels = cv2.resize(covered, (small.width, small.height), interpolation=cv2.INTER_NEAREST)
    near = np.asarray(cv2.dilate(pixels, SQUARE, iterations=_APART_PX))
    first = max(left, 0)
    window = near[top : top + len(field), first : left + field.shape[1]] > 0
    field[: window.shape[0], first - left : first - left + window.shape[1]][window] = 0.0


def signed_distances(
    silhouette: Silhouette, end_row: float
) -> tuple[int, int, NDArray[np.float32], FloatArray]:
    """Return the distances of pixels from the outline of a silhouette (H, W), negative inside.

    They are limited to ``FAR``. First come column and row of the window around the foreground
    above ``end_row``, then the distances there, px; empty without foreground, or with a single row
    above ``end_row``. Last come first and last column, first and end row of the window's part that
    counts, (4,), px.
    """
    rows = silhouette[: int(min(max(end_row + _MARGIN_PX, 0), len(silhouette)))]
    # The interpolation between pixels needs two rows.
    box = cv2.boundingRect(rows) if len(rows) > 1 else (0, 0, 0, 0)
    left, top, width, height = box
    if not width:
        return 0, 0, np.zeros((0, 0), np.float32), np.zeros(4)
    first = max(left - _MARGIN_PX, 0) + _APART_PX
    last = min(left + width + _MARGIN_PX, rows.shape[1]) - 1 - _APART_PX
    top, bottom = max(top - _MARGIN_PX, 0), top + height + _MARGIN_PX
    # The kernel continues the mask beside its border, which is background where there is some.
    beside = _MARGIN_PX - FAR
    left, right = max(left - beside, 0), left + width + beside
    _, inside = cv2.threshold(rows[top:bottom, left:right], 127, 1, cv2.THRESH_BINARY)
    distances = np.empty((len(inside), padded_width(inside.shape[1])), np.float32)
    signed_distances_of(np.asarray(inside, np.uint8), distances)
    left -= FAR
    end = min(end_row - top, len(inside) - _APART_PX)
    within = np.array([first - left, last - left, _APART_PX, end], np.float64)
    return left, top, distances, within


@inlined_kernel
def _segment_of(patch: int) -> int:
    """Return the segment of a patch, see :func:`~cardbox_tracker.person.kinematics.moves`."""
    return 0 if patch < TRUNK_PATCHES else 1 + (patch - TRUNK_PATCHES) // LIMB_PATCHES


@kernel
def _residuals(states: Floats, body: BodyTuple, seen: SeenTuple, found: Found) -> None:
    """Write residuals, their Jacobian and costs of states (N, 14); see ``Residuals``.

    With the gradient (a, b) of the distance, px / px, and the line of sight (u, v, 1) of a point X
    at the depth z, force f = d(distance)/dX and torque X x f are

        f = (fx a, fy b, -fx a u - fy b v) / z,    X x f = (u, v, 1) x z f

    and the distance changes by f . v + (X x f) . w with a segment's twist (v, w). To first order a
    point of the outline moves with its segment: where a round limb turns towards the camera, its
    outline moves along the line of sight only.
    """
    of = body_of(body)
    lens, field, within = seen
    values, jacobian, costs = found
    work, arm = new_scratch()
    corners_px, twists = np.empty((BODY_PATCHES, 4, 3)), np.empty((N_STATE, TWIST))
    edges, points, slope = np.empty((POINTS, 2), np.int64), np.empty((POINTS, 2)), np.empty(TWIST)
    per_x, per_y = lens[0] / (2.0 * _APART_PX), lens[1] / (2.0 * _APART_PX)
    wide, high = 1.0 / lens[0], 1.0 / lens[1]
    for n in range(states.shape[0]):
        place_patches(states[n], of, work, arm)
        project_corners(work.corners, lens, corners_px)
        count = find_outline(corners_px, within, edges, points)
        state_twists(states[n], of, twists)
        for i in range(count):
            p = edges[i, 0]
            x, y, inverse = point_on_edge(corners_px, p, edges[i, 1], points[i, 0])
            distance = distance_at(field, x, y)
            a = distance_at(field, x + _APART_PX, y) - distance_at(field, x - _APART_PX, y)
            b = distance_at(field, x, y + _APART_PX) - distance_at(field, x, y - _APART_PX)
            a, b = per_x * a, per_y * b
            u, v = (x - lens[2]) * wide, (y - lens[3]) * high
            c = -a * u - b * v
            slope[0], slope[1], slope[2] = a * inverse, b * inverse, c * inverse
            slope[3], slope[4], slope[5] = v * c - b, a - u * c, u * b - v * a
            outlying = 1.0 + distance**2 * _PER_HALF
            information = INFORMATION * points[i, 1]
            costs[n] += information * distance**2 / outlying
            root, segment = sqrt(information) / outlying, _segment_of(p)
            values[n, i] = root * distance
            for d in range(N_STATE):
                if moves(d, segment):
                    total = 0.0
                    for k in range(TWIST):
                        total += slope[k] * twists[d, k]
                    jacobian[n, i, d] = root * total
