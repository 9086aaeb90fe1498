"""2D points of a person's joints in an image, as a detector finds them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cardbox_tracker.body.sizes import FloatArray

POINT_NAMES: tuple[str, ...] = (
    "nose",
    "left_eye",
    "right_eye",
    "left_ear",
    "right_ear",
    "left_shoulder",
    "right_shoulder",
    "left_elbow",
    "right_elbow",
    "left_wrist",
    "right_wrist",
    "left_hip",
    "right_hip",
    "left_little_finger",
    "right_little_finger",
    "left_index",
    "right_index",
)
"""``left`` is the person's left. The first 13 are those of COCO, in its order; fingers are the
knuckles at the base."""

POINT_INDEX = {name: index for index, name in enumerate(POINT_NAMES)}


@dataclass(frozen=True, eq=False)
class ImagePoints:
    """The points of one person in one image.

    Attributes:
        px: column and row of each of ``POINT_NAMES``, (17, 2); (0, 0) is the centre of the first
            pixel. A point that is not known is nan.
        scores: chance that the point is right, 0 to 1, (17,); 0 for a point that is not known.
        stamp_ns: stamp of the image, ns; points may be older than the image they are used with.
            None if they are of the same image.
        spatial_m: the points in space as the detector estimates them, (17, 3), up to a common
            scale: x right, y down, z away from the camera, in a level frame; None without it. Only
            directions between the points are used.

    Raises:
        ValueError: the arrays have another shape.
    """

    px: FloatArray
    scores: FloatArray
    stamp_ns: int | None = None
    spatial_m: FloatArray | None = None

    def __post_init__(self) -> None:
        """Check the shapes; points that are not finite get the score 0, and others 0 to 1."""
        if self.spatial_m is not None and np.shape(self.spatial_m) != (len(POINT_NAMES), 3):
            raise ValueError(
                f"points in space have the shape {np.shape(self.spatial_m)}; expected "
                f"{(len(POINT_NAMES), 3)}"
            )
        px, scores = np.array(self.px, np.float64), np.array(self.scores, np.float64)
        expected = (len(POINT_NAMES), 2), (len(POINT_NAMES),)
        if (px.shape, scores.shape) != expected:
            raise ValueError(
                f"points have the shape {px.shape} and scores {scores.shape}; expected "
                f"{expected[0]} and {expected[1]}, ordered as POINT_NAMES"
            )
        known = np.isfinite(px).all(axis=1) & (scores > 0.0)
        px[~known] = np.nan
        object.__setattr__(self, "px", px)
        object.__setattr__(self, "scores", np.where(known, np.clip(scores, 0.0, 1.0), 0.0))

    @classmethod
    def of(
        cls, found: Mapping[str, tuple[float, float, float]], stamp_ns: int | None = None
    ) -> ImagePoints:
        """Return the points with column, row and score by name; other names are not used."""
        px, scores = np.full((len(POINT_NAMES), 2), np.nan), np.zeros(len(POINT_NAMES))
        for name, (column, row, score) in found.items():
            if name in POINT_INDEX:
                index = POINT_INDEX[name]
                px[index], scores[index] = (column, row), score
        return cls(px, scores, stamp_ns)

    @property
    def is_empty(self) -> bool:
        """Whether no point is known."""
        return not self.scores.any()
