"""Points of a person: unknown and impossible ones, and arrays that are refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cardbox_tracker.detectors.image_points import COCO_NAMES, POINT_INDEX, POINT_NAMES, ImagePoints
from cardbox_tracker.detectors.pose_network import Detection, image_points

COUNT = len(POINT_NAMES)
PX, SCORES = np.full((COUNT, 2), 7.0), np.full(COUNT, 0.5)
ANYTHING = st.floats(width=64, allow_nan=True, allow_infinity=True)


@given(
    arrays(np.float64, (COUNT, 2), elements=ANYTHING),
    arrays(np.float64, COUNT, elements=ANYTHING),
    arrays(np.float64, (COUNT, 3), elements=ANYTHING),
)
def test_whatever_comes_is_a_place_with_a_chance_or_unknown(
    px: np.ndarray, scores: np.ndarray, spatial_m: np.ndarray
) -> None:
    points = ImagePoints(px, scores, spatial_m=spatial_m)
    known = points.scores > 0.0
    assert ((points.scores >= 0.0) & (points.scores <= 1.0)).all()
    np.testing.assert_array_equal(points.px[known], px[known])
    assert np.isnan(points.px[~known]).all()
    assert points.is_empty == (not known.any())
    assert points.spatial_m is not None
    assert not np.isinf(points.spatial_m).any()


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e300, -1e300])
def test_a_place_beyond_any_image_is_unknown(value: float) -> None:
    points = ImagePoints.of({"nose": (value, 3.0, 0.9), "left_eye": (-20.0, 3.0, 0.9)})
    assert points.scores[POINT_INDEX["nose"]] == 0.0
    # A detector may guess a joint beyond the border.
    assert points.scores[POINT_INDEX["left_eye"]] == 0.9


@pytest.mark.parametrize(("score", "expected"), [(np.nan, 0), (-1, 0), (7.0, 1), (np.inf, 1)])
def test_a_chance_is_at_least_0_and_at_most_1(score: float, expected: float) -> None:
    assert ImagePoints(PX, np.full(COUNT, score)).scores.tolist() == [expected] * COUNT


def test_names_that_no_point_has_are_not_used() -> None:
    assert ImagePoints.of({"left_knee": (1.0, 2.0, 0.9)}).is_empty


def test_the_arrays_are_copies() -> None:
    px, scores = PX.copy(), SCORES.copy()
    points = ImagePoints(px, scores)
    px[:], scores[:] = 0.0, 0.0
    assert (points.px == 7.0).all() and (points.scores == 0.5).all()


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"px": np.zeros((13, 2))}, r"px .*\(13, 2\); expected \(17, 2\)"),
        ({"px": np.zeros((2, COUNT))}, r"px .*\(2, 17\)"),
        ({"px": None}, r"px .*\(\)"),
        ({"px": [[1.0, 2.0], [3.0]]}, r"px .*\[\[1.0, 2.0\], \[3.0\]\].*numbers"),
        ({"px": PX * 1j}, r"(?s)px .*7\.j.*numbers"),
        ({"px": "nose"}, r"px .*'nose'.*numbers"),
        ({"px": [[object()] * 2] * COUNT}, r"px .*object.*numbers"),
        ({"px": [[10**400] * 2] * COUNT}, r"px .*numbers"),
        ({"scores": np.zeros((COUNT, 1))}, r"scores .*\(17, 1\); expected \(17,\)"),
        ({"scores": 0.5}, r"scores .*\(\)"),
        ({"spatial_m": np.zeros((COUNT, 2))}, r"spatial_m .*\(17, 2\); expected \(17, 3\)"),
        ({"spatial_m": {"nose": 1}}, r"spatial_m .*nose.*numbers"),
        ({"stamp_ns": 1.5}, r"stamp_ns .*1\.5.*whole number"),
        ({"stamp_ns": "now"}, r"stamp_ns .*'now'.*whole number"),
    ],
)
def test_other_types_and_shapes_are_refused(values: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        ImagePoints(**({"px": PX, "scores": SCORES} | values))


def test_lists_and_whole_numbers_of_numpy_are_taken() -> None:
    lists: Any = PX.tolist(), SCORES.tolist(), np.int64(5), np.ones((COUNT, 3)).tolist()
    points = ImagePoints(*lists)
    assert points.spatial_m is not None
    assert points.spatial_m.shape == (COUNT, 3)
    assert points.stamp_ns == 5


def test_a_detection_has_the_points_of_the_legs_beside_the_others() -> None:
    numbers = np.arange(33.0)
    space = np.stack([numbers, numbers, numbers], axis=1)
    found = Detection(
        np.stack([numbers, 2 * numbers], axis=1), numbers / 33, np.zeros((4, 4), np.uint8), space
    )
    points = image_points(found)
    assert points.legs is not None and points.legs.spatial_m is not None
    # Knees, ankles, heels and the ends of the feet are MediaPipe's points 25 to 32.
    assert points.legs.px[:, 0].tolist() == list(range(25, 33))
    assert points.legs.spatial_m[0].tolist() == [25.0] * 3
    exchanged = points.exchanged().legs
    assert exchanged is not None
    assert exchanged.px[:, 0].tolist() == [26, 25, 28, 27, 30, 29, 32, 31]
    assert points.px.shape == (17, 2)


def test_points_of_coco_lose_knees_and_ankles() -> None:
    given = np.column_stack([np.arange(17.0), 100 + np.arange(17.0), np.full(17, 0.5)])
    given[COCO_NAMES.index("left_wrist"), 0] = np.nan
    found = ImagePoints.from_coco17(given, 7)
    assert found.stamp_ns == 7
    for name in POINT_NAMES:
        place = found.px[POINT_NAMES.index(name)]
        if name in COCO_NAMES and name != "left_wrist":
            assert place.tolist() == [COCO_NAMES.index(name), 100 + COCO_NAMES.index(name)]
        else:
            assert np.isnan(place).all()
    with pytest.raises(ValueError, match="COCO_NAMES"):
        ImagePoints.from_coco17(given[:13])
