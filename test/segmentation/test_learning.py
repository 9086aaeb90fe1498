"""Nobody is learned in: learning waits for a still scene, or goes around the person."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest

from cardbox_tracker.segmentation.background import SilhouetteExtractor
from cardbox_tracker.segmentation.background_config import BackgroundConfig
from cardbox_tracker.segmentation.learning import (
    WAYS,
    Learning,
    PersonInViewLearning,
    StillLearning,
)

IMAGES = 12
# The light is not followed, so that the rooms' errors show.
CONFIG = BackgroundConfig(follow=False)


def learned(way: type[Learning], images: list[Any]) -> Learning:
    learning = way(IMAGES)
    for image in images:
        assert not learning.has_enough()
        learning.add(image)
    return learning


def iou(learning: Learning, room: Any, at: float, image: Any) -> float:
    found = SilhouetteExtractor(learning.model(), CONFIG)(image) > 0
    truth = room.person(at)
    return float(np.count_nonzero(found & truth) / np.count_nonzero(found | truth))


def check_alike(learning: Learning, room: Any, at: float) -> None:
    """The silhouette is that before a scene that was learned empty, within 0.02 of IoU."""
    empty = learned(Learning, [room.image() for _ in range(IMAGES)])
    image = room.image(at, sway_px=0)
    expected = iou(empty, room, at, image)
    assert expected > 0.9
    assert iou(learning, room, at, image) == pytest.approx(expected, abs=0.02)


def test_a_still_scene_is_learned_as_it_always_was(room: Any) -> None:
    images = [room.image() for _ in range(IMAGES)]
    plain, still = learned(Learning, images), learned(StillLearning, images)
    assert plain.has_enough() and still.has_enough()
    np.testing.assert_array_equal(still.model().mean, plain.model().mean)
    np.testing.assert_array_equal(still.model().stddev, plain.model().stddev)


def test_somebody_who_walks_through_is_not_learned_in(room: Any) -> None:
    """The issue's case: afterwards the silhouette is that of an empty scene."""
    images = [room.image() for _ in range(IMAGES // 2)]
    images += [room.image(at) for at in np.linspace(0, 159, 15)]
    learning = learned(StillLearning, images)
    assert "moves" in learning.waits_for("/image_raw")
    assert float(learning.values()["moved while learning (% of the image)"]) > 0.6
    for _ in range(4 * IMAGES):
        learning.add(room.image())
        if learning.has_enough():
            break
    check_alike(learning, room, 75.0)


def test_somebody_who_stays_is_waited_for(room: Any) -> None:
    learned(StillLearning, [room.image(80 + 0.4 * (k // 5 % 3)) for k in range(8 * IMAGES)])


def test_always_learns_whatever_moves(room: Any) -> None:
    learning = learned(Learning, [room.image(80 + k) for k in range(IMAGES)])
    assert learning.has_enough()
    assert iou(learning, room, 85, room.image(85)) < 0.5


@pytest.mark.parametrize("color", [False, True])
def test_a_person_in_view_is_left_out_and_completed(room: Any, color: bool) -> None:
    def image(at: float | None) -> Any:
        made = room.image(at)
        return cv2.cvtColor(made, cv2.COLOR_GRAY2BGR) if color else made

    learning = PersonInViewLearning(IMAGES)
    assert "stand" in learning.waits_for("/image_raw")
    for k in range(2 * IMAGES):
        learning.add(image(40 + 0.4 * (k // 3 % 3)))
    assert not learning.has_enough()
    assert "step aside" in learning.waits_for("/image_raw")
    assert 10 < float(learning.values()["hidden by the person (% of the image)"]) < 40
    with pytest.raises(ValueError, match="not seen"):
        learning.model()
    for k in range(8 * IMAGES):
        learning.add(image(min(40 + 4 * k, 125) + 0.4 * (k // 3 % 3)))
        if learning.has_enough():
            break
    model = learning.model()
    assert (model.chroma is not None) == color
    assert np.abs(model.mean - room.wall).mean() < 1.5
    for at in (40.0, 80.0, 125.0):
        check_alike(learning, room, at)


def test_a_person_who_leaves_in_other_light_leaves_no_mark(room: Any) -> None:
    learning = PersonInViewLearning(IMAGES)
    for k in range(2 * IMAGES):
        learning.add(room.image(40 + 0.4 * (k // 3 % 3)))
    for _ in range(4 * IMAGES):
        learning.add(room.image(gain=1.1))
        if learning.has_enough():
            break
    assert np.abs(learning.model().mean - room.wall).max() < 15


def test_an_empty_scene_is_learned_at_once_around_nobody(room: Any) -> None:
    learning = learned(PersonInViewLearning, [room.image() for _ in range(IMAGES)])
    assert learning.has_enough()


def test_the_default_is_the_still_scene() -> None:
    assert next(iter(WAYS)) == "still"
    assert WAYS["always"] is Learning
