"""A camera that repeats its last image is not used while the others see that the person moves."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.extrinsics import Extrinsics
from cardbox_tracker.camera.view import OtherCamera, View
from cardbox_tracker.detectors.image_points import POINT_NAMES, ImagePoints
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.terms.term import Frame
from cardbox_tracker.tracking.camera_agreement import CameraAgreement
from cardbox_tracker.tracking.camera_faults import CameraFaults, likeness
from cardbox_tracker.tracking.observation import Observation


def seen(at: int, noise: int | None = None) -> Observation:
    """Return a person at a column; with ``noise``, an image with noise of this seed."""
    mask = np.zeros((60, 80), np.uint8)
    mask[10:50, at : at + 20] = 255
    if noise is None:
        return Observation(mask)
    return Observation(mask, np.random.default_rng(noise).integers(0, 255, mask.shape, np.uint8))


def used(first: list[Observation], second: list[Observation | None]) -> tuple[str, CameraFaults]:
    """Return for each time which of two cameras was used: 1, 2 or b for both."""
    cameras = CameraFaults(2)
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


def test_a_camera_that_sees_nobody_is_not_frozen() -> None:
    nobody = Observation(np.zeros((60, 80), np.uint8))
    moving = [seen(10 + 2 * i) for i in range(20)]
    found, cameras = used(moving, [nobody] * 20)
    assert set(found) == {"b"} and cameras.remarks() == []


def test_cameras_without_data_are_no_frozen_ones() -> None:
    cameras = CameraFaults(3)
    for i in range(5):
        kept = cameras.without([seen(10 + 3 * i, i), None])
        assert [one is not None for one in kept] == [True, False, False]
    assert cameras.remarks() == []


def test_a_silhouette_that_fills_the_image_needs_points_and_is_forgotten_after_a_second() -> None:
    cameras, white = CameraFaults(2), np.full((60, 80), 255, np.uint8)
    points = ImagePoints.of({"nose": (40.0, 20.0, 0.9)})
    kept = cameras.without([seen(10), Observation(white)], 0)
    assert [one is not None for one in kept] == [True, False]
    kept = cameras.without([seen(12), Observation(white, points=points)], 10)
    assert [one is not None for one in kept] == [True, True]
    assert "silhouette of right fills 2 of its images" in cameras.remarks(["left", "right"])[0]
    for stamp_ns, count in ((900_000_000, 1), (1_100_000_000, 0)):
        cameras.without([seen(14), seen(16)], stamp_ns)
        assert len(cameras.remarks()) == count
    assert len(cameras.remarks(is_all=True)) == 1


ASIDE = np.array([[1.0, 0.0, 11.0], [0.0, 1.0, 0.0]])
"""Two degrees are 11 of 320 pixels."""
ROLLED = cv2.getRotationMatrix2D((159.5, 119.5), 2.0, 1.0)


@pytest.mark.parametrize(("camera", "bump"), [(0, ASIDE), (1, ASIDE), (1, ROLLED)])
def test_a_camera_that_is_bumped_is_told_within_two_seconds_and_nobody_is_sure(
    camera: int, bump: np.ndarray
) -> None:
    """The person walks before the wall meanwhile."""
    tiles = np.random.default_rng(0).integers(0, 255, (2, 48, 64), np.uint8)
    walls = [np.kron(one, np.ones((5, 5), np.uint8)) for one in tiles]
    cameras = CameraFaults(2)
    for number in range(60):
        mask = np.zeros((240, 320), np.uint8)
        mask[40:, 40 + 2 * number : 80 + 2 * number] = 255
        pair = [Observation(mask, np.where(mask, np.uint8(number), wall)) for wall in walls]
        if number >= 30:
            seen = pair[camera].image
            assert seen is not None
            pair[camera] = Observation(mask, cv2.warpAffine(seen, bump, (320, 240)))
        kept = cameras.without(pair, number * 66_666_667)
        if number < 30:
            assert None not in kept and cameras.remarks() == []
    assert kept[camera] is None and kept[1 - camera] is not None
    assert "has moved" in cameras.remarks()[0]
    lens, beside = Camera(320, 240, 300.0, 300.0, 159.5, 119.5), np.array([-0.5, 0.0, 0.0])
    other = OtherCamera(lens, Extrinsics(np.eye(3), beside))
    agreement = CameraAgreement(BodyModel(), lens, [View.of(BodyModel(), lens, other)])
    cameras.agreeing([Frame(lens, {"silhouette": mask}, 240, 1)] * 2, agreement)
    assert cameras.is_contradicted


def test_who_sways_before_a_plain_wall_moves_no_camera() -> None:
    """The silhouette lacks five pixels of a person in a bright pattern."""
    rng, cameras = np.random.default_rng(0), CameraFaults(2)
    wall = np.kron(rng.integers(80, 120, (12, 16)), np.ones((20, 20))).astype(np.uint8)
    shirt = np.kron(rng.integers(0, 255, (36, 12)), np.ones((5, 5))).astype(np.uint8)
    for number in range(60):
        image, mask, left = wall.copy(), np.zeros((240, 320), np.uint8), 130 + min(number, 12)
        image[60:, left : left + 60] = shirt
        mask[65:, left + 5 : left + 55] = 255
        cameras.without([Observation(mask, image), None], number * 66_666_667)
    assert cameras.remarks() == []


def test_a_mirrored_person_in_space_is_unlike() -> None:
    """The first camera sees the person from the front, the other one from their left."""
    px = np.full((17, 2), 40.0)
    names = "left_shoulder", "right_shoulder", "left_elbow", "right_elbow", "nose"
    at = [POINT_NAMES.index(name) for name in names]
    # Right, down and away: the left arm points at the first camera.
    front = [(0.2, 0, 0), (-0.2, 0, 0), (0.2, 0, -0.3), (-0.2, 0.3, 0), (0, -0.2, -0.1)]
    spatial_m = np.zeros((2, 17, 3))
    spatial_m[0, at] = front
    spatial_m[1, at] = [(away, down, -right) for right, down, away in front]
    scores = np.isin(np.arange(17), at).astype(float)
    ahead, aside = (ImagePoints(px, scores, spatial_m=one) for one in spatial_m)
    assert likeness(ahead, ahead, 0.0) == pytest.approx(1.0)
    assert likeness(ahead, aside, np.radians(90.0)) == pytest.approx(1.0)
    assert likeness(ahead, aside, np.radians(30.0)) < 0.8
    swapped = np.arange(17)
    swapped[at] = np.array(at)[[1, 0, 3, 2, 4]]
    mirrored = ImagePoints(px, scores, spatial_m=spatial_m[1, swapped] * (-1.0, 1.0, 1.0))
    assert likeness(ahead, mirrored, np.radians(90.0)) < 0.5
    assert np.isnan(likeness(None, aside, 0.0))
    assert np.isnan(likeness(ahead, ImagePoints(px, scores), 0.0))
