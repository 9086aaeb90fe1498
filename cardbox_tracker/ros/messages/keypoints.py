"""Conversion of 2D keypoints between messages and :class:`ImagePoints`.

Points are pixels of the camera's own image, at the size that its CameraInfo has. Messages of other
packages are read by the names of their fields, so that no package has to be installed.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Header

from cardbox_tracker.common.errors import CardboxError, reason_of
from cardbox_tracker.detectors.image_points import COCO_NAMES, POINT_NAMES, ImagePoints
from cardbox_tracker.detectors.point_checks import NamedPoint, Size, person_of
from cardbox_tracker.detectors.pose_network import LANDMARKS, Detection
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.ros.messages.types import optional_class

_FIELDS = dict.fromkeys(("u", "v", "score", "x", "y", "z"), PointField.FLOAT32)
_FIELDS |= dict.fromkeys(("landmark", "person"), PointField.UINT32)
_KINDS = {
    PointField.INT8: "i1",
    PointField.UINT8: "u1",
    PointField.INT16: "i2",
    PointField.UINT16: "u2",
    PointField.INT32: "i4",
    PointField.UINT32: "u4",
    PointField.FLOAT32: "f4",
    PointField.FLOAT64: "f8",
}
MESSAGE_NAMES = (*COCO_NAMES, *POINT_NAMES[13:])
"""The points of a PolygonStamped: those of COCO, then the knuckles, which may be left out."""
SKELETON_NAMES = (
    "nose",
    "neck",
    *("right_shoulder", "right_elbow", "right_wrist"),
    *("left_shoulder", "left_elbow", "left_wrist"),
    *("right_hip", "right_knee", "right_ankle"),
    *("left_hip", "left_knee", "left_ankle"),
    *("left_eye", "right_eye", "left_ear", "right_ear"),
)
"""The points of hri_msgs/Skeleton2D in its order."""

POINT_CLOUD = "sensor_msgs/msg/PointCloud2"
"""Type of the detector's messages."""

_MOST_PERSONS = 100

Convert = Callable[[Any, Size], list[ImagePoints]]
"""Takes a message; returns the points of each person. Raises CardboxError if it is malformed."""


def people_message(header: Header, people: Sequence[Detection]) -> PointCloud2:
    """Return the message of all points of some people, a row a person; their masks are not sent."""
    kind = np.dtype([(name, "<" + _KINDS[field]) for name, field in _FIELDS.items()])
    points = np.zeros((len(people), len(LANDMARKS)), kind)
    for number, (row, one) in enumerate(zip(points, people, strict=True)):
        row["u"], row["v"], row["score"] = *one.points_px.T, one.scores
        row["landmark"], row["person"] = range(len(LANDMARKS)), number
        unknown = np.full(3, np.nan)
        row["x"], row["y"], row["z"] = unknown if one.spatial_m is None else one.spatial_m.T
    return PointCloud2(
        header=header,
        height=len(people),
        width=len(LANDMARKS),
        fields=[
            PointField(name=name, offset=4 * number, datatype=field, count=1)
            for number, (name, field) in enumerate(_FIELDS.items())
        ],
        point_step=kind.itemsize,
        row_step=kind.itemsize * len(LANDMARKS),
        data=array("B", points.tobytes()),
    )


def persons_of_cloud(message: Any, size: Size) -> list[ImagePoints]:
    """Return the people of a PointCloud2.

    Its fields are those of :func:`people_message`, of any type and order; without ``x``, ``y`` and
    ``z`` the points are in the image only, and without ``person`` they are of one. Points that a
    detector guesses far outside of the image are missing. Raises CardboxError for other fields.
    """
    count = message.width * message.height
    if not count:
        return []
    given = {field.name: field for field in message.fields if field.name in _FIELDS}
    space = [name for name in ("x", "y", "z") if name in given]
    names = ["u", "v", "score", *(space if len(space) == 3 else ())]
    lacking = [name for name in (*names, "landmark") if name not in given]
    if lacking or count > len(LANDMARKS) * _MOST_PERSONS:
        raise CardboxError(
            f"{count} points with the fields {', '.join(given) or 'of another kind'}; expected u, "
            f"v, score and landmark, a number from 0 to {len(LANDMARKS) - 1}, of at most "
            f"{_MOST_PERSONS} persons (docs/detectors.md)"
        )
    order = ">" if message.is_bigendian else "<"
    try:
        kind = np.dtype(
            {
                "names": list(given),
                "formats": [order + _KINDS[field.datatype] for field in given.values()],
                "offsets": [field.offset for field in given.values()],
                "itemsize": message.point_step,
            }
        )
        rows = np.frombuffer(message.data, np.uint8).reshape(message.height, message.row_step)
        rows = np.ascontiguousarray(rows[:, : message.width * message.point_step])
        points = rows.view(kind).ravel()
        if len(points) != count:
            raise ValueError("its rows are shorter than its points")
    except (KeyError, ValueError, TypeError) as error:
        raise CardboxError(f"the points cannot be read: {reason_of(error)}") from None
    if not 0 <= points["landmark"].min() <= points["landmark"].max() < len(LANDMARKS):
        raise CardboxError(f"a landmark is not a number from 0 to {len(LANDMARKS) - 1}")
    away_px = np.hypot(points["u"], points["v"])
    far = np.isfinite(away_px) & (away_px > 2 * max(size))
    people: dict[int, list[NamedPoint]] = {}
    for point in points[~far]:
        u, v, score, *space_m = (float(point[name]) for name in names)
        person = int(point["person"]) if "person" in given else 0
        named: NamedPoint = LANDMARKS[int(point["landmark"])], u, v, score, *space_m
        people.setdefault(person, []).append(named)
    return [person_of(of, size) for of in people.values()]


def skeleton_class() -> Any:
    """Return hri_msgs/Skeleton2D; None if it is not installed, or has other points."""
    kind = optional_class("hri_msgs", "Skeleton2D")
    if kind is None or len(getattr(kind(), "skeleton", ())) != len(SKELETON_NAMES):
        return None
    return kind


def skeleton_message(
    kind: Any, header: Header, px: FloatArray, scores: FloatArray, size: Size
) -> Any:
    """Return the message ``kind``, hri_msgs/Skeleton2D, of landmarks as above."""
    message = kind(header=header)
    shoulders = [LANDMARKS.index(f"{side}_shoulder") for side in ("left", "right")]
    for point, name in zip(message.skeleton, SKELETON_NAMES, strict=True):
        of = shoulders if name == "neck" else [LANDMARKS.index(name)]
        # Its coordinates are 0 and 1 at the edges of the image, not at the centres of pixels.
        column, row = (px[of].mean(axis=0) + 0.5) / size
        point.x, point.y, point.c = float(column), float(row), float(scores[of].min())
    return message


def persons_of_polygon(message: Any, size: Size) -> list[ImagePoints]:
    """Return the people of a PolygonStamped, each with all points of ``MESSAGE_NAMES``.

    One person may lack the knuckles. Raises CardboxError if the number of points is wrong, or a
    point is impossible.
    """
    points = message.polygon.points
    if not points:
        return []
    each = len(COCO_NAMES) if len(points) == len(COCO_NAMES) else len(MESSAGE_NAMES)
    if len(points) % each or len(points) > each * _MOST_PERSONS:
        raise CardboxError(
            f"a person has {len(points)} points; expected the {len(COCO_NAMES)} of COCO in its "
            f"order, or {len(MESSAGE_NAMES)} with four knuckles, once for each person "
            "(docs/detectors.md)"
        )
    return [
        person_of(
            (
                (name, p.x, p.y, p.z)
                for name, p in zip(MESSAGE_NAMES, points[begin : begin + each], strict=False)
            ),
            size,
        )
        for begin in range(0, len(points), each)
    ]


def persons_of_skeleton(message: Any, size: Size) -> list[ImagePoints]:
    """Return the person of a Skeleton2D, or raise CardboxError for wrong points."""
    points, (width, height) = message.skeleton, size
    if len(points) != len(SKELETON_NAMES):
        raise CardboxError(
            f"a Skeleton2D has {len(points)} points; expected the {len(SKELETON_NAMES)} of REP-155"
        )
    named = zip(SKELETON_NAMES, points, strict=True)
    placed = ((name, p.x * width - 0.5, p.y * height - 0.5, p.c) for name, p in named)
    return [person_of(placed, size)]


def persons_of_detections(message: Any, size: Size) -> list[ImagePoints]:
    """Return the persons with keypoints of yolo_msgs' DetectionArray, or raise CardboxError."""
    found = message.detections
    if len(found) > _MOST_PERSONS:
        raise CardboxError(f"{len(found)} detections; expected at most {_MOST_PERSONS}")
    persons = []
    for one in found:
        points = one.keypoints.data
        if one.class_name not in ("", "person") or not points:
            continue
        if len(points) > len(COCO_NAMES) or not all(1 <= p.id <= len(COCO_NAMES) for p in points):
            raise CardboxError(
                f"a person has {len(points)} keypoints, or other numbers than 1 to "
                f"{len(COCO_NAMES)}; expected those of COCO, as YOLO's pose models have them"
            )
        placed = ((COCO_NAMES[p.id - 1], p.point.x, p.point.y, p.score) for p in points)
        persons.append(person_of(placed, size))
    return persons


CONVERSIONS: dict[str, Convert] = {
    POINT_CLOUD: persons_of_cloud,
    "geometry_msgs/msg/PolygonStamped": persons_of_polygon,
    "hri_msgs/msg/Skeleton2D": persons_of_skeleton,
    "yolo_msgs/msg/DetectionArray": persons_of_detections,
}
"""Conversion of each type of message that can be read."""
