"""Conversion of 2D keypoints between messages and :class:`ImagePoints`.

Points are pixels of the camera's own image, at the size that its CameraInfo has. Messages of other
packages are read by the names of their fields, so that no package has to be installed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from geometry_msgs.msg import Point32, Polygon, PolygonStamped
from std_msgs.msg import Header

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.detectors.image_points import COCO_NAMES, POINT_NAMES, ImagePoints
from cardbox_tracker.detectors.point_checks import Size, person_of
from cardbox_tracker.detectors.pose_network import LANDMARKS
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.ros.messages.types import optional_class

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

POLYGON_STAMPED = "geometry_msgs/msg/PolygonStamped"
"""Type of the messages that need no further package."""

_MOST_PERSONS = 100

Convert = Callable[[Any, Size], list[ImagePoints]]
"""Takes a message; returns the points of each person. Raises CardboxError if it is malformed."""


def people_message(
    header: Header, people: Sequence[tuple[FloatArray, FloatArray]]
) -> PolygonStamped:
    """Return the message of ``LANDMARKS``, (33, 2), px, and scores, (33,), of each person."""
    points = [
        Point32(x=float(px[i, 0]), y=float(px[i, 1]), z=float(scores[i]))
        for px, scores in people
        for i in map(LANDMARKS.index, MESSAGE_NAMES)
    ]
    return PolygonStamped(header=header, polygon=Polygon(points=points))


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
    POLYGON_STAMPED: persons_of_polygon,
    "hri_msgs/msg/Skeleton2D": persons_of_skeleton,
    "yolo_msgs/msg/DetectionArray": persons_of_detections,
}
"""Conversion of each type of message that can be read."""
