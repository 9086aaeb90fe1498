"""A camera that repeats its last image is not used while the others see that the person moves."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from cardbox_tracker.tracking.frozen import FrozenCameras
from cardbox_tracker.tracking.observation import Observation


def seen(at: int, noise: int | None = None) -> Observation:
    """Return a person at a column; with ``noise``, an image with noise of this seed."""
    mask = np.zeros((60, 80), np.uint8)
    mask[10:50, at : at + 20] = 255
    if noise is None:
        return Observation(mask)
    return Observation(mask, np.random.default_rng(noise).integers(0, 255, mask.shape, np.uint8))


def used(first: list[Observation], second: list[Observation | None]) -> tuple[str, FrozenCameras]:
    """Return for each time which of two cameras was used: 1, 2 or b for both."""
    cameras = FrozenCameras(2)
    found = ""
    for both in zip(first, second, strict=True):
        kept = [number for number, one in enumerate(cameras.without(both), 1) if one is not None]
        found += {(1,): "1", (2,): "2", (1, 2): "b"}[tuple(kept)]
    return found, cameras


@pytest.mark.parametrize("has_image", [True, False])
def test_a_frozen_camera_is_left_out_until_it_goes_on(has_image: bool) -> None:
    first = [seen(10 + 2 * i, i if has_image else None) for i in range(10)]
    second: list[Observation | None] = [
        seen(30 + min(i, 3) + max(i - 7, 0), (min(i, 3) + max(i - 7, 0)) if has_image else None)
        for i in range(10)
    ]
    found, cameras = used(first, second)
    assert found == "bbbbb111bb"
    assert cameras.left_out == [0, 3]
    (remark,) = cameras.remarks()
    assert "camera 2 of 2 shows the same image again and again" in remark
    assert "3 of its images are not used" in remark
    exchanged, _ = used([one for one in second if one is not None], list(first))
    assert exchanged == "bbbbb222bb"


def test_every_image_may_come_twice_and_a_person_may_stand_still() -> None:
    moving = [seen(10 + 2 * i, i) for i in range(12)]
    assert set(used(moving, [seen(30 + i // 2, i // 2) for i in range(12)])[0]) == {"b"}
    still = [seen(10, i) for i in range(12)]
    assert set(used(still, [seen(30, 0) for i in range(12)])[0]) == {"b"}
    assert set(used([seen(10, 0)] * 30, [seen(30, 0)] * 30)[0]) == {"b"}


def test_a_camera_frozen_for_long_is_noticed_by_little_changes() -> None:
    rng = np.random.default_rng(0)
    first = []
    for _ in range(25):
        mask = np.array(seen(10).silhouette)
        cv2.circle(mask, (int(rng.integers(10, 28)), 53), 1, 255, -1)
        first.append(Observation(mask))
    found, _ = used(first, [seen(30, 0)] * 25)
    assert found[:15] == "b" * 15 and found[-1] == "1"


def test_a_camera_that_sees_nobody_is_not_frozen() -> None:
    nobody = Observation(np.zeros((60, 80), np.uint8))
    moving = [seen(10 + 2 * i) for i in range(20)]
    found, cameras = used(moving, [nobody] * 20)
    assert set(found) == {"b"} and cameras.remarks() == []


def test_cameras_without_data_are_no_frozen_ones() -> None:
    cameras = FrozenCameras(3)
    for i in range(5):
        kept = cameras.without([seen(10 + 3 * i, i), None])
        assert [one is not None for one in kept] == [True, False, False]
    assert cameras.remarks() == []
