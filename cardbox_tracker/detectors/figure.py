"""The figure of a person whose joints are known in an image: its size, its pixels, its likeness."""

from __future__ import annotations

from collections.abc import Mapping

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.detectors.image_points import POINT_NAMES, ImagePoints
from cardbox_tracker.person.sizes import FloatArray

Joints = Mapping[str, FloatArray]
"""Column and row (2,) of joints by name, px; nan or missing where they are not known."""

_SIDES = "left", "right"
# Widths of limbs in lengths of the trunk.
_WIDTHS = (("shoulder", "elbow", 0.28), ("elbow", "wrist", 0.24), ("wrist", "index", 0.24))
_LEGS = (("hip", "knee", 0.36), ("knee", "ankle", 0.28))
_HEAD, _TRUNK, _FLANK = 0.45, 0.75, 0.3
# Length of legs in lengths of the trunk.
_LEG = 1.6
_COMPARED = [f"{side}_{name}" for name in ("shoulder", "elbow", "wrist", "hip") for side in _SIDES]
_EXCHANGED = [name for i in range(0, len(_COMPARED), 2) for name in _COMPARED[i : i + 2][::-1]]
_FARTHEST_PX = 4000.0
_UNKNOWN = np.full(2, np.nan)


class Figure:
    """A person in an image.

    Attributes:
        middle_px: middle of the trunk, (2,).
        trunk_px: length of the trunk, or its breadth if that is larger; nan if no trunk is known.
    """

    def __init__(self, joints: Joints) -> None:
        self._at = joints
        shoulders, hips = self._pair("shoulder"), self._pair("hip")
        self._neck, self._hips = np.mean(shoulders, axis=0), np.mean(hips, axis=0)
        if not np.isfinite(self._hips).all():
            # The hips are often outside of the image.
            breadth_px = float(np.linalg.norm(shoulders[0] - shoulders[1]))
            self._hips = self._neck + np.array([0.0, 1.4 * breadth_px])
        sides = np.linalg.norm([self._neck - self._hips, shoulders[0] - shoulders[1]], axis=1)
        self.trunk_px = max(float(sides.max()), 1.0) if np.isfinite(sides).all() else np.nan
        self.middle_px = (self._neck + self._hips) / 2

    def _pair(self, name: str) -> list[FloatArray]:
        return [self._at.get(f"{side}_{name}", _UNKNOWN) for side in _SIDES]

    def apart(self, other: Figure) -> float:
        """Return the mean distance of the joints of trunk and arms, in lengths of the larger trunk.

        A detector that takes left for right has found the same person. It is infinite if too few
        joints are known.
        """
        own = np.array([self._at.get(name, _UNKNOWN) for name in _COMPARED])
        means = []
        for names in (_COMPARED, _EXCHANGED):
            there = np.array([other._at.get(name, _UNKNOWN) for name in names])
            distances = np.linalg.norm(own - there, axis=1)
            known = np.isfinite(distances)
            means.append(float(distances[known].mean()) if known.sum() >= 2 else np.inf)
        return min(means) / float(np.nanmax([self.trunk_px, other.trunk_px, 1.0]))

    def drawn(self, shape: tuple[int, ...]) -> NDArray[np.uint8]:
        """Return the pixels (H, W) of limbs, trunk and head of usual width, 255, else 0."""
        image = np.zeros(shape[:2], np.uint8)
        lines = [(self._at.get("nose", _UNKNOWN), self._neck, _HEAD)]
        lines.append((self._neck, self._hips, _TRUNK))
        for side in _SIDES:
            at = {name: self._at.get(f"{side}_{name}", _UNKNOWN) for name in _NAMES}
            lines += [(at[begin], at[end], width) for begin, end, width in _WIDTHS]
            lines.append((at["shoulder"], at["hip"], _FLANK))
            if np.isfinite(at["knee"]).all():
                lines += [(at[begin], at[end], width) for begin, end, width in _LEGS]
            else:
                lines.append(
                    (at["hip"], at["hip"] + np.array([0.0, _LEG * self.trunk_px]), _LEGS[0][2])
                )
        for begin, end, width in lines:
            if np.isfinite([*begin, *end, self.trunk_px]).all():
                ends = (np.rint(np.clip(at, -_FARTHEST_PX, _FARTHEST_PX)) for at in (begin, end))
                first, last = (tuple(int(value) for value in at) for at in ends)
                cv2.line(image, first, last, 255, min(max(round(width * self.trunk_px), 1), 255))
        return image

    def trunk(self, shape: tuple[int, ...]) -> NDArray[np.uint8]:
        """Return the pixels (H, W) of the middle of the trunk, 255, else 0."""
        image = np.zeros(shape[:2], np.uint8)
        corners = np.array([*self._pair("shoulder"), *self._pair("hip")[::-1]])
        if np.isfinite(corners).all():
            inside = self.middle_px + 0.7 * (corners - self.middle_px)
            clipped = np.clip(np.rint(inside), -_FARTHEST_PX, _FARTHEST_PX).astype(np.int32)
            cv2.fillConvexPoly(image, cv2.convexHull(clipped), 255)
        return image


_NAMES = tuple(dict.fromkeys(name for limb in (*_WIDTHS, *_LEGS) for name in limb[:2]))


def figure_of_points(points: ImagePoints) -> Figure:
    """Return the figure of a person's points."""
    return Figure(dict(zip(POINT_NAMES, points.px, strict=True)))
