"""2D points of a person's joints in an image, as a detector finds them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from operator import index
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.errors import quoted
from cardbox_tracker.common.settings import of_kind
from cardbox_tracker.person.sizes import FloatArray

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

COCO_NAMES = (*POINT_NAMES[:13], "left_knee", "right_knee", "left_ankle", "right_ankle")
"""The 17 points of COCO in its order."""

_FARTHEST = 1e6
CERTAIN = 0.5
"""Score from which a point is certain."""
# Share of certain points that shows a person.
_SHARE = 0.5

POINT_INDEX = {name: index for index, name in enumerate(POINT_NAMES)}

LEG_POINT_NAMES: tuple[str, ...] = (
    *("left_knee", "right_knee", "left_ankle", "right_ankle"),
    *("left_heel", "right_heel", "left_foot", "right_foot"),
)
"""Points of the legs beyond the hips; ``foot`` is its front end."""

_OTHER_SIDE = [
    POINT_INDEX[name.replace("left", "right") if "left" in name else name.replace("right", "left")]
    for name in POINT_NAMES
]


class LegPoints(NamedTuple):
    """The points ``LEG_POINT_NAMES`` of one person in one image."""

    px: FloatArray  #: column and row, (8, 2), as in :class:`ImagePoints`; nan if it is not known
    scores: FloatArray  #: chance that the point is in the image and visible, 0 to 1, (8,)
    #: the points in space, (8, 3), with the axes, origin and scale of ``ImagePoints.spatial_m``;
    #: None without it.
    spatial_m: FloatArray | None = None

    @property
    def are_certain(self) -> bool:
        """Whether a knee and an ankle are."""
        return bool((self.scores[:4].reshape(2, 2).max(axis=1) >= CERTAIN).all())

    def exchanged(self) -> LegPoints:
        """Return the points with left and right exchanged."""
        other = np.arange(len(LEG_POINT_NAMES)) ^ 1
        spatial_m = None if self.spatial_m is None else self.spatial_m[other]
        return LegPoints(self.px[other], self.scores[other], spatial_m)


@dataclass(frozen=True, eq=False)
class ImagePoints:
    """The points of one person in one image.

    Raises:
        ValueError: an array has another shape or is not numeric, or the stamp is no whole number.
    """

    #: column and row of each of ``POINT_NAMES``, (17, 2); (0, 0) is the centre of the first pixel.
    #: A point that is not known is nan, as is one a million pixels away.
    px: FloatArray
    #: chance that the point is right, 0 to 1, (17,); 0 for a point that is not known
    scores: FloatArray
    #: stamp of the image, ns; points may be older than the image they are used with. None if they
    #: are of the same image.
    stamp_ns: int | None = None
    #: the points in space as the detector estimates them, (17, 3), up to a common scale: x right, y
    #: down, z away from the camera, in a level frame; None without it, nan where one is missing.
    #: Only directions between the points are used.
    spatial_m: FloatArray | None = None
    #: the points of the legs; None without them
    legs: LegPoints | None = None

    def __post_init__(self) -> None:
        """Check the types; points that are not finite get the score 0, and others 0 to 1."""
        count = len(POINT_NAMES)
        px, scores = _array("px", self.px, (count, 2)), _array("scores", self.scores, (count,))
        known = _is_finite(px) & (scores > 0.0)
        px[~known] = np.nan
        object.__setattr__(self, "px", px)
        object.__setattr__(self, "scores", np.where(known, np.clip(scores, 0.0, 1.0), 0.0))
        if self.spatial_m is not None:
            spatial_m = _array("spatial_m", self.spatial_m, (count, 3))
            spatial_m[~_is_finite(spatial_m)] = np.nan
            object.__setattr__(self, "spatial_m", spatial_m)
        if self.legs is not None:
            given, count = of_kind("legs", self.legs, LegPoints), len(LEG_POINT_NAMES)
            shapes = {"px": (count, 2), "scores": (count,), "spatial_m": (count, 3)}
            for name, values in given._asdict().items():
                if values is not None or name != "spatial_m":
                    _array(f"{name} of legs", values, shapes[name], "LEG_POINT_NAMES")
        object.__setattr__(self, "stamp_ns", whole_ns(self.stamp_ns, "points"))

    @classmethod
    def of(cls, found: Mapping[str, Sequence[float]], stamp_ns: int | None = None) -> ImagePoints:
        """Return the points of some names; others are not used.

        Each has column, row and score, and may have x, y and z as in ``spatial_m``.
        """
        if not isinstance(found, Mapping):
            raise ValueError(f"points are {quoted(found)}; expected them by their names")

        def known(names: Sequence[str]) -> tuple[FloatArray, FloatArray, FloatArray | None]:
            values = np.full((len(names), 6), np.nan)
            values[:, 2] = 0.0
            for number, name in enumerate(names):
                given = found.get(name, ())
                try:
                    values[number, : len(given)] = given
                except Exception:  # of what programs give
                    raise ValueError(
                        f"{name} is {quoted(given)}; expected column, row and score, or these and "
                        "x, y and z"
                    ) from None
            space = values[:, 3:]
            return values[:, :2], values[:, 2], space if np.isfinite(space).any() else None

        (px, scores, spatial_m), legs = known(POINT_NAMES), LegPoints(*known(LEG_POINT_NAMES))
        return cls(px, scores, stamp_ns, spatial_m, legs if legs.scores.any() else None)

    @classmethod
    def from_coco17(cls, points: FloatArray, stamp_ns: int | None = None) -> ImagePoints:
        """Return the points of COCO, which most detectors have.

        ``points``, (17, 3), are column, row (px) and score, 0 to 1, of each of ``COCO_NAMES``; nan
        or the score 0 where one is missing. Raises ValueError for another shape or type.
        """
        found = _array("points", points, (len(COCO_NAMES), 3), "COCO_NAMES")
        return cls.of(dict(zip(COCO_NAMES, found.tolist(), strict=True)), stamp_ns)

    def exchanged(self) -> ImagePoints:
        """Return the points with left and right exchanged."""
        return replace(
            self,
            px=self.px[_OTHER_SIDE],
            scores=self.scores[_OTHER_SIDE],
            spatial_m=None if self.spatial_m is None else self.spatial_m[_OTHER_SIDE],
            legs=None if self.legs is None else self.legs.exchanged(),
        )

    def beside(self, pixels: NDArray[np.uint8]) -> ImagePoints:
        """Return the points with nan for those on pixels (H, W) that are not 0.

        Those of legs keep their scores: they were guessed, and not left out.
        """

        def seen(px: FloatArray) -> FloatArray:
            ends = np.array(pixels.shape)[::-1] - 1
            columns, rows = np.clip(np.nan_to_num(px).round(), 0, ends).astype(int).T
            return np.where(pixels[rows, columns, None] > 0, np.nan, px)

        legs = None if self.legs is None else self.legs._replace(px=seen(self.legs.px))
        return replace(self, px=seen(self.px), legs=legs)

    def apart_px(self, other: ImagePoints) -> float:
        """Return the mean distance of points that are certain in both; infinite without any."""
        is_certain = np.minimum(self.scores, other.scores) >= CERTAIN
        away_px = np.linalg.norm(self.px - other.px, axis=1)[is_certain]
        return float(away_px.mean()) if len(away_px) else float("inf")

    def moved_on(self, before: ImagePoints, share: float) -> ImagePoints:
        """Return the points after ``share`` of the time since ``before``, in even motion.

        Those that are not certain in both stay.
        """

        def moved(points: Any, others: Any) -> FloatArray:
            is_certain = np.minimum(points.scores, others.scores) >= CERTAIN
            step = np.where(is_certain[:, None], points.px - others.px, 0.0)
            return np.asarray(points.px + share * step)

        legs = self.legs
        if legs is not None and before.legs is not None:
            legs = legs._replace(px=moved(legs, before.legs))
        return replace(self, px=moved(self, before), legs=legs)

    @property
    def are_certain(self) -> bool:
        """Whether at least half of the points are certain."""
        return float(np.mean(self.scores >= CERTAIN)) >= _SHARE

    @property
    def is_empty(self) -> bool:
        """Whether no point is known."""
        return not self.scores.any()


def whole_ns(stamp_ns: Any, of: str) -> int | None:
    """Return a stamp, ns; ValueError if it is neither a whole number nor None."""
    try:
        return None if stamp_ns is None else index(stamp_ns)
    except TypeError:
        raise ValueError(
            f"stamp_ns of {of} is {quoted(stamp_ns)}; expected a whole number of nanoseconds, "
            "or None"
        ) from None


def _array(
    name: str, values: FloatArray, shape: tuple[int, ...], order: str = "POINT_NAMES"
) -> FloatArray:
    """Return a copy of ``values`` if it has the expected shape."""
    try:
        if np.iscomplexobj(values):
            raise TypeError
        array = np.array(values, np.float64)
    except Exception:  # of what programs give
        raise ValueError(
            f"{name} of points is {quoted(values)}; expected numbers of the shape {shape}, ordered "
            f"as {order}"
        ) from None
    if array.shape != shape:
        raise ValueError(
            f"{name} of points has the shape {array.shape}; expected {shape}, ordered as {order}"
        )
    return array


def _is_finite(points: FloatArray) -> NDArray[np.bool_]:
    """Return whether all coordinates of each point are finite and below a million, (N,)."""
    return np.asarray((np.abs(points) < _FARTHEST).all(axis=1))
