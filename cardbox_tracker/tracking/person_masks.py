"""Masks of the image regions in which a person is expected, from the last posture.

The masks are drawn on a grid of square cells, about 80 in a row of the image.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import NEAREST_M, Camera
from cardbox_tracker.measuring.references import COARSE_PX
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import N_STATE, TORSO_X
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import POINT_NAMES

HIP, NECK, HEAD_CENTRE, LEFT, RIGHT = (
    POINT_NAMES.index(name) for name in ("hip", "neck", "head", "left_shoulder", "right_shoulder")
)
"""Rows of :meth:`PersonPoints.of`; an arm has three: shoulder, elbow, fingertips."""
# Length of the fingers in forearm lengths.
_FINGERS = 0.15


class PersonPoints:
    """Projects the joints of one body into the image of one camera."""

    def __init__(self, body: BodyModel, camera: Camera) -> None:
        """Prepare for ``body`` before ``camera``, which includes the pitch."""
        self._body, self._camera = body, camera

    def of(self, posture: FloatArray) -> FloatArray:
        """Return column and row, px, and pixels per metre of hip, neck, head and arms, (9, 3).

        The posture is (12,) or (14,), rad and metres. Rows are as :data:`HIP` and the names beside
        it. Points nearer than :data:`NEAREST_M` are treated as if they were so far away.
        """
        camera, state = self._camera, np.zeros(N_STATE)
        state[: len(posture)] = posture
        state[TORSO_X] = min(state[TORSO_X], self._body.placement.distance_m - NEAREST_M)
        points_m = pose(self._body, state, camera.pitch_rad).points_m
        for arm in (LEFT, RIGHT):
            points_m[arm + 2] += _FINGERS * (points_m[arm + 2] - points_m[arm + 1])
        x, y, z = points_m.T
        scale = camera.fx / np.maximum(z, NEAREST_M)
        column, row = scale * x + camera.cx, camera.fy / camera.fx * scale * y + camera.cy
        return np.stack([column, row, scale], axis=1)


Mask = NDArray[np.uint8]
Point = tuple[float, float, float]
"""Column and row in cells, and cells per metre at the point's depth."""

# Clothes are added to the widths of the body model.
_CLOTHES_M = 0.02
# All foreground within this distance of the last posture belongs to the person.
_BAND_M = 0.1
# Distance from the fist to the fingertips, plus the error of keypoints.
_BEYOND_HAND_M = 0.25
# Width of the background ring around head and shoulders.
_RING_M = 0.2


@dataclass(frozen=True)
class PersonMasks:
    """Regions of the expected person on the grid, each (h, w), 0 or 1."""

    core: Mask  #: the body in the last posture
    near: Mask  #: cells that the person can occupy in the next frame
    reach: Mask  #: cells that the arms can reach
    hip: tuple[float, float]  #: column and row of mid-hip, cells
    cells_per_m: float  #: scale at the hips

    def band(self) -> Mask:
        """Return all cells (h, w) within 10 cm of the body, 0 or 1."""
        return grown(self.core, self.cells_per_m * _BAND_M)


class PersonDrawer:
    """Draws the masks of one body for one camera.

    Attributes:
        cell_px: side of a cell, px.
        shape: rows and columns of the grid.
        front: state (14,) of the front reference at the measured place.
        cells_per_m: scale at the person's distance in the body model.
    """

    def __init__(self, body: BodyModel, camera: Camera) -> None:
        """Set up the grid; ``camera`` includes the pitch."""
        self._body = body
        self.cell_px = cell = max(1, round(camera.width / COARSE_PX))
        self.shape = -(-camera.height // cell), -(-camera.width // cell)
        self._camera = replace(
            camera,
            width=self.shape[1],
            height=self.shape[0],
            fx=camera.fx / cell,
            fy=camera.fy / cell,
            cx=(camera.cx + 0.5) / cell - 0.5,
            cy=(camera.cy + 0.5) / cell - 0.5,
        )
        self.cells_per_m = self._camera.fx / body.placement.distance_m
        self._places = PersonPoints(body, self._camera)
        self.front = body.reference_state()

    def masks(self, posture: FloatArray, near_m: float) -> PersonMasks:
        """Return the masks of a person for their last posture, (12,) or (14,), rad and metres.

        ``near_m`` is the largest movement of a body part until the next frame.
        """
        points = self._points(posture)
        core: Mask = np.zeros(self.shape, np.uint8)
        self._draw_head(core, points, _CLOTHES_M)
        self._draw_torso(core, points, _CLOTHES_M)
        size = self._body.size
        thick_m = size("upper_arm_width") + 2 * _CLOTHES_M
        for first in (LEFT, RIGHT):
            for start in (first, first + 1):
                nearest = max(points[start][2], points[start + 1][2])
                _line(core, points[start], points[start + 1], nearest * thick_m)
        scale = points[HIP][2]
        near = grown(core, scale * near_m)
        reach = near.copy()
        length_m = size("upper_arm_length") + size("forearm_length") + _BEYOND_HAND_M
        for first in (LEFT, RIGHT):
            depth_m = self._camera.fx / points[first][2]
            radius_m = min(length_m, 0.9 * depth_m)
            # The silhouette of a sphere is wider than a disc of its radius.
            radius_m *= depth_m / float(np.sqrt(depth_m**2 - radius_m**2))
            _disc(reach, points[first], radius_m * points[first][2])
        return PersonMasks(core, near, reach, points[HIP][:2], scale)

    def head_and_shoulders(self) -> tuple[list[NDArray[np.float32]], tuple[int, int]]:
        """Return a head kernel, a trunk kernel, and column and row of the hips in them.

        A kernel's product with a silhouette on the grid is the foreground share of head or trunk,
        minus the foreground share of the ring around head and shoulders.
        """
        points = self._points(self.front)
        head, trunk, ring = (np.zeros(self.shape, np.uint8) for _ in range(3))
        self._draw_head(head, points, 0.0)
        self._draw_torso(trunk, points, 0.0)
        self._draw_head(ring, points, _RING_M)
        self._draw_torso(ring, points, _RING_M)
        hip, shoulder = points[HIP], points[LEFT]
        rows = np.arange(self.shape[0])
        around = (ring > 0) & (head == 0) & (trunk == 0) & (rows < shoulder[1])[:, None]
        trunk[rows > hip[1]] = 0
        kernels = []
        for inside in (head > 0, trunk > 0):
            kernel = np.zeros(self.shape, np.float32)
            kernel[around] = -1.0 / max(int(np.count_nonzero(around)), 1)
            kernel[inside] = 1.0 / max(int(np.count_nonzero(inside)), 1)
            kernels.append(kernel)
        column, row = (
            int(np.clip(round(place), 0, length - 1))
            for place, length in zip(hip[:2], self.shape[::-1], strict=True)
        )
        return kernels, (column, row)

    def _points(self, posture: FloatArray) -> list[Point]:
        """Return hip, neck, head, then shoulder, elbow and fingertips of each arm."""
        points: list[list[float]] = self._places.of(posture).tolist()
        return [(column, row, scale) for column, row, scale in points]

    def _draw_head(self, mask: Mask, points: list[Point], grow_m: float) -> None:
        """Draw head and neck, widened by ``grow_m``."""
        size, neck, head = self._body.size, points[NECK], points[HEAD_CENTRE]
        _line(mask, neck, head, 2 * head[2] * (0.3 * size("head_width") + grow_m))
        _disc(mask, head, head[2] * (0.5 * size("head_height") + grow_m))

    def _draw_torso(self, mask: Mask, points: list[Point], grow_m: float) -> None:
        """Draw the torso and the region below the hips, widened by ``grow_m``."""
        size, hip, neck = self._body.size, points[HIP], points[NECK]
        half_m = 0.5 * max(size("torso_top_width"), size("torso_bottom_width"))
        wide = 2 * hip[2] * (half_m + grow_m)
        floor = (hip[0], self.shape[0] + wide, hip[2])
        middle = (0.5 * (hip[0] + neck[0]), 0.5 * (hip[1] + neck[1]), hip[2])
        _line(mask, middle, hip, wide)
        _line(mask, hip, floor, wide)
        arm = 2 * hip[2] * (0.5 * size("upper_arm_width") + grow_m)
        _line(mask, points[LEFT], points[RIGHT], arm)
        for shoulder in (points[LEFT], points[RIGHT]):
            _line(mask, shoulder, hip, 2 * hip[2] * (0.5 * half_m + grow_m))


def grown(mask: Mask, cells: float) -> Mask:
    """Return a mask (h, w), 0 or 1, dilated by a disc whose radius is ``cells``."""
    wide = 2 * max(0, min(round(cells), sum(mask.shape))) + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (wide, wide))
    return np.asarray(cv2.dilate(mask, disc), np.uint8)


def _whole(place: Point) -> tuple[int, int]:
    column, row, _ = place
    return round(min(max(column, -1000.0), 1000.0)), round(min(max(row, -1000.0), 1000.0))


def _line(mask: Mask, start: Point, end: Point, wide: float) -> None:
    cv2.line(mask, _whole(start), _whole(end), 1, min(max(1, round(wide)), 255))


def _disc(mask: Mask, middle: Point, radius: float) -> None:
    cv2.circle(mask, _whole(middle), min(max(0, round(radius)), 1000), 1, cv2.FILLED)
