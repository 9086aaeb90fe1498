"""Conversion of 2D points between messages and the core."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Point32, Polygon, PolygonStamped
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Header

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.detectors.image_points import POINT_INDEX
from cardbox_tracker.detectors.pose_network import LANDMARKS, NOBODY, image_points
from cardbox_tracker.ros.messages.keypoints import (
    COCO_NAMES,
    SKELETON_NAMES,
    people_message,
    persons_of_cloud,
    persons_of_detections,
    persons_of_polygon,
    persons_of_skeleton,
    skeleton_message,
)

SIZE = (640, 480)


def polygon(*points: tuple[float, float, float]) -> PolygonStamped:
    return PolygonStamped(polygon=Polygon(points=[Point32(x=x, y=y, z=z) for x, y, z in points]))


def coco() -> list[tuple[float, float, float]]:
    """Return 17 points; the place and the score say which one it is."""
    return [(10.0 * i, 5.0 * i, 0.01 * (i + 1)) for i in range(17)]


def detection(points: list[Any], name: str = "person") -> SimpleNamespace:
    return SimpleNamespace(class_name=name, keypoints=SimpleNamespace(data=points))


def yolo(number: int, x: float, y: float, score: float) -> SimpleNamespace:
    return SimpleNamespace(id=number, point=SimpleNamespace(x=x, y=y), score=score)


class Skeleton2D:
    """Replaces the message of hri_msgs, which has 18 points from the start."""

    def __init__(self, header: Header) -> None:
        self.header = header
        self.skeleton = [SimpleNamespace(x=0.0, y=0.0, c=0.0) for _ in range(18)]


def test_the_order_is_that_of_coco() -> None:
    assert len(COCO_NAMES) == 17 and COCO_NAMES[5] == "left_shoulder"
    assert COCO_NAMES[10] == "right_wrist" and COCO_NAMES[16] == "right_ankle"
    (person,) = persons_of_polygon(polygon(*coco()), SIZE)
    for name in ("nose", "left_shoulder", "right_wrist", "right_hip"):
        place = COCO_NAMES.index(name)
        assert tuple(person.px[POINT_INDEX[name]]) == (10.0 * place, 5.0 * place)
    assert person.scores[POINT_INDEX["left_index"]] == 0.0


def test_points_of_the_detector_come_back() -> None:
    rng = np.random.default_rng(0)
    px, scores = rng.uniform(0, 400, (33, 2)), rng.uniform(0.1, 1.0, 33)
    one = NOBODY._replace(points_px=px, scores=scores, spatial_m=rng.normal(size=(33, 3)))
    message = people_message(Header(frame_id="eye"), [one, one._replace(spatial_m=None)])
    assert message.header.frame_id == "eye"
    assert (message.height, message.width) == (2, len(LANDMARKS))
    found, expected = persons_of_cloud(message, SIZE), image_points(one)
    for person, spatial_m in zip(found, (expected.spatial_m, None), strict=True):
        np.testing.assert_allclose(person.px, expected.px, atol=1e-3)
        np.testing.assert_allclose(person.scores, expected.scores, atol=1e-6)
        assert person.legs is not None and expected.legs is not None
        np.testing.assert_allclose(person.legs.px, expected.legs.px, atol=1e-3)
        assert (person.spatial_m is None) == (spatial_m is None)
        if person.spatial_m is not None:
            np.testing.assert_allclose(person.spatial_m, spatial_m, atol=1e-6)


def cloud(kinds: dict[str, str], rows: list[tuple[float, ...]], order: str = "<") -> PointCloud2:
    """Return a cloud of another program, with a gap after each point."""
    numbers = {"u1": PointField.UINT8, "i2": PointField.INT16, "f8": PointField.FLOAT64}
    kind = np.dtype([(name, order + of) for name, of in kinds.items()] + [("", "u1", 3)])
    fields = [
        PointField(name=name, offset=kind.fields[name][1], datatype=numbers[of], count=1)  # type: ignore[index]
        for name, of in kinds.items()
    ]
    data = np.zeros(len(rows), kind)
    for name, column in zip(kinds, zip(*rows, strict=True), strict=True):
        data[name] = column
    return PointCloud2(
        height=1,
        width=len(rows),
        fields=fields,
        is_bigendian=order == ">",
        point_step=kind.itemsize,
        row_step=kind.itemsize * len(rows),
        data=data.tobytes(),
    )


@pytest.mark.parametrize("order", ["<", ">"])
def test_a_cloud_of_another_program_is_read_by_its_fields(order: str) -> None:
    kinds = {"landmark": "u1", "score": "f8", "v": "i2", "u": "f8", "person": "i2"}
    rows = [(11.0, 0.9, 60.0, 50.5, 3.0), (16.0, 0.8, 80.0, 70.0, 3.0), (25.0, 0.7, 9.0, 8.0, 5.0)]
    first, second = persons_of_cloud(cloud(kinds, rows, order), SIZE)
    assert first.px[POINT_INDEX["left_shoulder"]].tolist() == [50.5, 60.0]
    assert first.px[POINT_INDEX["right_wrist"]].tolist() == [70.0, 80.0]
    assert first.spatial_m is None and first.legs is None
    assert second.legs is not None and second.legs.px[0].tolist() == [8.0, 9.0]
    with pytest.raises(CardboxError, match="a landmark is not a number from 0 to 32"):
        persons_of_cloud(cloud(kinds, [(33.0, *rows[0][1:])], order), SIZE)
    short = cloud(kinds, rows, order)
    short.row_step, short.data = 0, b""
    with pytest.raises(CardboxError, match="its rows are shorter than its points"):
        persons_of_cloud(short, SIZE)


def test_an_image_without_a_person_gives_an_empty_person_or_none() -> None:
    (person,) = persons_of_cloud(people_message(Header(), [NOBODY]), SIZE)
    assert person.is_empty
    assert persons_of_cloud(people_message(Header(), []), SIZE) == []
    assert persons_of_polygon(polygon(), SIZE) == []
    assert persons_of_detections(SimpleNamespace(detections=[]), SIZE) == []


def test_a_skeleton_has_places_between_the_edges_of_the_image() -> None:
    px, scores = np.full((33, 2), 100.0), np.full(33, 0.5)
    px[LANDMARKS.index("left_shoulder")] = -0.5, -0.5
    px[LANDMARKS.index("right_shoulder")] = 639.5, 479.5
    scores[LANDMARKS.index("right_shoulder")] = 0.25
    message = skeleton_message(Skeleton2D, Header(frame_id="eye"), px, scores, SIZE)
    points = dict(zip(SKELETON_NAMES, message.skeleton, strict=True))
    assert (points["left_shoulder"].x, points["left_shoulder"].y) == (0.0, 0.0)
    assert (points["right_shoulder"].x, points["right_shoulder"].y) == (1.0, 1.0)
    assert (points["neck"].x, points["neck"].c) == (0.5, 0.25)
    assert message.skeleton[4] is points["right_wrist"]
    (person,) = persons_of_skeleton(message, SIZE)
    assert tuple(person.px[POINT_INDEX["right_shoulder"]]) == (639.5, 479.5)
    assert person.scores[POINT_INDEX["left_little_finger"]] == 0.0


def test_every_person_of_a_detection_array_is_read() -> None:
    points = [yolo(6, 50.0, 60.0, 0.9), yolo(11, 70.0, 80.0, 0.8)]
    found = [detection(points), detection([], "chair"), detection([]), detection([points[0]])]
    both = persons_of_detections(SimpleNamespace(detections=found), SIZE)
    assert len(both) == 2
    assert tuple(both[0].px[POINT_INDEX["left_shoulder"]]) == (50.0, 60.0)
    assert tuple(both[0].px[POINT_INDEX["right_wrist"]]) == (70.0, 80.0)
    assert np.count_nonzero(both[0].scores) == 2


def with_point(x: float, y: float, score: float) -> PolygonStamped:
    return polygon((x, y, score), *coco()[1:])


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        (polygon(*coco()[:16]), "16 points; expected the 17 of COCO"),
        (polygon(*coco() * 600), "10200 points"),
        (with_point(math.nan, 5.0, 0.5), "nose is at .*expected a place"),
        (with_point(5.0, math.inf, 0.5), "nose is at"),
        (with_point(1e30, 5.0, 0.5), "640x480"),
        (with_point(5.0, 5.0, math.nan), "score nan"),
        (with_point(5.0, 5.0, 97.0), "a chance from 0 to 1"),
        (with_point(5.0, 5.0, -1.5), "a chance from 0 to 1"),
    ],
)
def test_impossible_polygons_are_refused(message: Any, expected: str) -> None:
    with pytest.raises(CardboxError, match=expected):
        persons_of_polygon(message, SIZE)


@pytest.mark.parametrize("score", [0.0, -0.1])
def test_a_missing_point_may_be_anywhere(score: float) -> None:
    (person,) = persons_of_polygon(with_point(math.nan, -1e9, score), SIZE)
    assert person.scores[POINT_INDEX["nose"]] == 0.0
    assert person.scores[POINT_INDEX["left_eye"]] > 0.0


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        ([detection([yolo(0, 5.0, 5.0, 0.5)])], "other numbers than 1 to 17"),
        ([detection([yolo(18, 5.0, 5.0, 0.5)])], "other numbers than 1 to 17"),
        ([detection([yolo(1, 5.0, 5.0, 0.5)] * 10_000)], "10000 keypoints"),
        ([detection([yolo(1, 5.0, 5.0, 0.5)])] * 10_000, "10000 detections"),
        ([detection([yolo(1, math.nan, 5.0, 0.5)])], "nose is at"),
    ],
)
def test_impossible_detections_are_refused(found: list[Any], expected: str) -> None:
    with pytest.raises(CardboxError, match=expected):
        persons_of_detections(SimpleNamespace(detections=found), SIZE)


def test_a_skeleton_of_another_length_is_refused() -> None:
    message = Skeleton2D(Header())
    message.skeleton.pop()
    with pytest.raises(CardboxError, match="17 points; expected the 18"):
        persons_of_skeleton(message, SIZE)
