"""Measurement of arms, span and widths in a person's outline.

All lengths are metres along Y and Z of the reference frame, in the upright plane through the
person. Silhouettes are (H, W), 0 or 255, as :func:`filled` returns them; cameras are working
cameras including the pitch.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.measuring.references import Silhouette
from cardbox_tracker.person.sizes import FloatArray

_HEAD_ABOVE = 0.07
"""Height above the arms' axis, in spans, above which rows show the head."""
_EVEN = 0.015
"""Largest distance in spans between the middles of span and head if the arms are equally long."""
_GAP = 20
"""Image heights per gap over which parts of a person are joined."""
_FEWEST_COLUMNS = 20
"""Least width of a silhouette with arms, px."""
_TRUNK = 2.2
"""Height of a column, in arm thicknesses, at which the trunk begins."""
_HAND, _ARMPIT = 0.30, 0.97
"""Range of the arm without hand, in fractions of the distance from fingertips to armpit."""
_HANGING_WIDTH = 1.06
"""Width of an arm that hangs 20 degrees away from the body, in thicknesses."""
_HANGING = (0.02, 0.27)
"""Range between armpit and wrist of hanging arms, in spans below the axis of the level arms."""


@dataclass(frozen=True)
class LevelArm:
    """One arm in the reference ``arms``, in the upright plane."""

    tip_m: float  #: Y of the fingertips
    armpit_m: float  #: Y of the trunk's edge
    slope: float  #: slope of the axis, Z = slope Y + height
    height_m: float  #: height of the axis at Y = 0
    thickness_m: float  #: median height of the arm's outline between elbow and wrist

    @property
    def reach_m(self) -> float:
        """Distance from armpit to fingertips."""
        return abs(self.tip_m - self.armpit_m)

    def axis_m(self, y_m: float) -> float:
        """Height of the axis at ``y_m``."""
        return self.slope * y_m + self.height_m


def plane_points_m(
    camera: Camera, columns: NDArray[Any], rows: NDArray[Any], distance_m: float
) -> FloatArray:
    """Return the points (n, 2), Y and Z, of an upright plane at a level distance at pixels (n,)."""
    points = camera.optical_to_reference(camera.rays(np.column_stack([columns, rows])))
    scaled: FloatArray = points[:, 1:] * (-distance_m / points[:, :1])
    return scaled


def filled(silhouette: Silhouette) -> Silhouette:
    """Return the person of a silhouette (H, W): the largest region after gaps are closed.

    Regions belong together if the gap between them is narrower than about an arm. Holes smaller
    than the square of that gap are filled.
    """
    seen = (silhouette > 0).astype(np.uint8)
    gap = max(3, silhouette.shape[0] // _GAP | 1)  # odd, so that closing removes no pixel
    joined = cv2.morphologyEx(seen, cv2.MORPH_CLOSE, np.ones((gap, gap), np.uint8))
    _, labels, statistics, _ = cv2.connectedComponentsWithStats(joined, connectivity=8)
    if len(statistics) < 2:
        return np.zeros_like(silhouette)
    person = seen * (labels == 1 + np.argmax(statistics[1:, cv2.CC_STAT_AREA]))
    # The rim of a hole may be broken by a pixel or two. Larger holes are gaps between trunk and
    # arm, if a hand touches the hips.
    rim = cv2.morphologyEx(person, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    _, labels, statistics, _ = cv2.connectedComponentsWithStats(1 - rim, connectivity=4)
    small = np.nonzero(statistics[:, cv2.CC_STAT_AREA] < gap * gap)[0]
    holes = np.isin(labels, small[small > 0]).astype(np.uint8)
    whole = person | cv2.dilate(holes, np.ones((3, 3), np.uint8))
    return np.asarray(whole * np.uint8(255), dtype=np.uint8)


def level_arm(
    silhouette: Silhouette, camera: Camera, distance_m: float, side: int
) -> LevelArm | None:
    """Trace one arm of the silhouette (H, W) of ``arms`` from fingertips to trunk, or return None.

    ``side`` is 1 for the arm at the image's right, -1 for the other arm.
    """
    used = np.nonzero(silhouette.any(axis=0))[0]
    if len(used) < _FEWEST_COLUMNS:
        return None
    order = used[::-1] if side > 0 else used
    order = order[: (used[-1] - used[0] + 1) // 2]
    n = len(order)
    top = np.argmax(silhouette[:, order] > 0, axis=0)
    below = np.arange(silhouette.shape[0])[:, None] >= top
    # The uppermost run of each column is the arm; lower runs are, for example, a skirt.
    gap = below & (silhouette[:, order] == 0)
    end = np.where(gap.any(axis=0), np.argmax(gap, axis=0), silhouette.shape[0])
    thickness = (end - top).astype(np.float64)
    typical = float(np.median(thickness[n // 5 : 3 * n // 5]))
    trunk = np.nonzero(thickness[n // 3 :] > _TRUNK * typical)[0]
    armpit = n // 3 + int(trunk[0]) if len(trunk) else int(0.75 * n)
    # The upper edge of a sleeve lies on the arm, and the lower edge hangs.
    middle = top + (np.minimum(thickness, typical) - 1.0) / 2.0
    points = plane_points_m(camera, order[:armpit], middle[:armpit], distance_m)
    hand = int(_HAND * armpit)
    arm = points[hand : max(int(_ARMPIT * armpit), hand + 5)]
    if len(arm) < 5:
        return None
    slope, height = _line(arm[:, 0], arm[:, 1])
    tip = plane_points_m(
        camera, np.array([order[0] + 0.5 * side]), np.array([np.median(middle[:4])]), distance_m
    )
    per_px = distance_m / camera.fx
    return LevelArm(float(tip[0, 0]), float(points[-1, 0]), slope, height, typical * per_px)


def span_m(
    arms: Silhouette, camera: Camera, distance_m: float, left: LevelArm, right: LevelArm
) -> float:
    """Return the distance from fingertip to fingertip in the silhouette ``arms`` (H, W).

    If the middle of the span is not below the head, a part of one arm is missing in the silhouette,
    and the span is twice the reach of the longer arm.
    """
    span = left.tip_m - right.tip_m
    centre = (left.tip_m + right.tip_m) / 2.0
    axis = (left.axis_m(centre) + right.axis_m(centre)) / 2.0
    head = arms[row_heights_m(arms, camera, distance_m) > axis + _HEAD_ABOVE * span] > 0
    if not head.any():
        return span
    counts = head.sum(axis=0).cumsum()
    column = np.searchsorted(counts, counts[-1] / 2.0)
    middle = plane_points_m(camera, np.array([column]), np.array([camera.cy]), distance_m)[0, 0]
    uneven = abs(centre - middle) / span
    trust = float(np.clip(uneven / _EVEN - 1.0, 0.0, 1.0))
    return float(span * (1.0 + 2.0 * trust * uneven))


def _line(x: FloatArray, y: FloatArray) -> tuple[float, float]:
    """Return slope and offset of a line fitted with Cauchy weights."""
    weights = np.ones(len(x))
    slope = offset = 0.0
    for _ in range(8):
        slope, offset = (float(c) for c in np.polyfit(x, y, 1, w=np.sqrt(weights)))
        off = np.abs(y - slope * x - offset)
        weights = 1.0 / (1.0 + (off / max(2.0 * float(np.median(off)), 1e-4)) ** 2)
    return slope, offset


def _runs(row: NDArray[np.uint8]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the first columns of a row's foreground runs, and the columns after their ends."""
    steps = np.diff(np.concatenate([[0], (row > 0).astype(np.int8), [0]]))
    return np.nonzero(steps == 1)[0], np.nonzero(steps == -1)[0]


def row_heights_m(silhouette: Silhouette, camera: Camera, distance_m: float) -> FloatArray:
    """Return the height (H,) of each row at the column of the principal point."""
    rows = np.arange(silhouette.shape[0], dtype=np.float64)
    return plane_points_m(camera, np.full(len(rows), camera.cx), rows, distance_m)[:, 1]


def width_m(front: Silhouette, camera: Camera, distance_m: float, height_m: float) -> float:
    """Return the width from edge to edge at a height; NaN if the row is empty."""
    row = int(np.argmin(np.abs(row_heights_m(front, camera, distance_m) - height_m)))
    columns = np.nonzero(front[row])[0]
    if len(columns) < 2:
        return float("nan")
    ends = np.array([columns[0] - 0.5, columns[-1] + 0.5])
    points = plane_points_m(camera, ends, np.full(2, float(row)), distance_m)
    return float(points[1, 0] - points[0, 0])


def axes_distance_m(
    front: Silhouette,
    camera: Camera,
    distance_m: float,
    axis_m: float,
    joint_m: float,
    span_m: float,
    arm: LevelArm,
) -> float:
    """Return the distance between the axes of hanging arms at the height of the shoulder joints.

    ``axis_m`` is the height of the axes of the level arms, of which ``arm`` gives the thickness.
    NaN if the arms are separate from the trunk in too few rows.
    """
    heights = row_heights_m(front, camera, distance_m)
    thickness_px = arm.thickness_m * camera.fx / distance_m
    below = (axis_m - heights) / span_m
    rows = np.nonzero((below > _HANGING[0]) & (below < _HANGING[1]))[0]
    ends = []
    for side in (-1, 0):
        middle, kept, last = [], [], None
        for row in rows:
            starts, stops = _runs(front[row])
            # Between armpit and wrist, a hanging arm is separate from the trunk.
            if len(starts) < 2:
                continue
            width = stops[side] - starts[side]
            # A sleeve hangs from the outer side of the arm.
            bare = min(float(width), _HANGING_WIDTH * thickness_px)
            column = stops[-1] - (bare + 1) / 2.0 if side else starts[0] + (bare - 1) / 2.0
            if not 0.4 * thickness_px < width < 1.8 * thickness_px:
                continue
            if last is None or abs(column - last) <= 4:
                middle.append(column)
                kept.append(float(row))
                last = column
        if len(kept) < 6:
            return float("nan")
        points = plane_points_m(camera, np.array(middle), np.array(kept), distance_m)
        slope, offset = _line(points[:, 1], points[:, 0])
        ends.append(slope * joint_m + offset)
    return ends[0] - ends[1]
