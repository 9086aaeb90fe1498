"""Arms, span and widths in outlines drawn by hand."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.measuring.outline import (
    axes_distance_m,
    filled,
    level_arm,
    plane_points_m,
    span_m,
    width_m,
)

# At 2 m a pixel is 1 cm.
CAMERA = Camera(320, 240, 200.0, 200.0, 159.5, 119.5)
DISTANCE_M = 2.0


@pytest.mark.parametrize(
    ("column", "row", "pitch_deg", "expected_m"),
    [
        (159.5, 119.5, 0.0, (0.0, 0.0)),
        (169.5, 119.5, 0.0, (0.1, 0.0)),
        (159.5, 129.5, 0.0, (0.0, -0.1)),
        # A camera that looks down by 45 degrees: the ray meets the plane 2 m below it, at a
        # distance of 2 sqrt(2) m, where a pixel is 1.41 cm.
        (159.5, 119.5, 45.0, (0.0, -2.0)),
        (169.5, 119.5, 45.0, (0.1 * np.sqrt(2), -2.0)),
    ],
)
def test_points_of_the_plane_by_hand(
    column: float, row: float, pitch_deg: float, expected_m: tuple[float, float]
) -> None:
    camera = CAMERA.with_pitch(np.radians(pitch_deg))
    points = plane_points_m(camera, np.array([column]), np.array([row]), DISTANCE_M)
    np.testing.assert_allclose(points, [expected_m], atol=1e-12)


def test_small_holes_are_filled_and_the_gap_at_an_arm_is_not(
    block: Callable[..., np.ndarray],
) -> None:
    image = block(20, 220, 100, 220)
    image[40:50, 110:120] = 0
    image[100:200, 180:190] = 0
    whole = filled(image)
    assert np.all(whole[40:50, 110:120] == 255)
    assert np.all(whole[102:198, 182:188] == 0)


def test_a_hand_torn_off_is_kept_and_a_thing_aside_is_not(block: Callable[..., np.ndarray]) -> None:
    image = block(40, 200, 140, 180) | block(100, 108, 180, 240) | block(20, 40, 10, 30)
    image[:, 220:226] = 0
    whole = filled(image)
    assert np.all(whole[100:108, 226:240] == 255)
    assert not whole[:, :100].any()
    # Nothing is added to the outline.
    np.testing.assert_array_equal(whole, np.where(block(20, 40, 10, 30), 0, image))


def test_nobody_stays_nobody() -> None:
    assert not filled(np.zeros((240, 320), np.uint8)).any()


@pytest.mark.parametrize("drop", [0.0, 0.1, 0.2])
def test_a_level_arm_by_hand(drop: float, outstretched: Callable[..., np.ndarray]) -> None:
    image = outstretched(drop)
    left, right = (level_arm(image, CAMERA, DISTANCE_M, side) for side in (1, -1))
    assert left is not None
    assert right is not None
    # The last column of the left arm is 239; its outer edge lies at 239.5, 80 px from 159.5.
    assert left.tip_m == pytest.approx(0.80)
    assert right.tip_m == pytest.approx(-0.80)
    assert left.slope == pytest.approx(-drop, abs=0.01)
    assert right.slope == pytest.approx(drop, abs=0.01)
    # The middle of rows 96 to 103 is 99.5, 20 px above the middle of the image.
    assert left.axis_m(0.0) == pytest.approx(0.20, abs=0.012)
    assert left.armpit_m == pytest.approx(0.205, abs=0.006)
    assert left.thickness_m == pytest.approx(0.08)
    assert left.reach_m == pytest.approx(0.595, abs=0.006)


def test_a_hanging_sleeve_does_not_lower_the_axis(outstretched: Callable[..., np.ndarray]) -> None:
    bare = outstretched()
    sleeved = bare.copy()
    # The upper arm's sleeve hangs 6 px below the arm, 40 px to 20 px from the middle.
    sleeved[104:110, 180:200] = 255
    seen = [level_arm(image, CAMERA, DISTANCE_M, 1) for image in (bare, sleeved)]
    assert seen[0] is not None
    assert seen[1] is not None
    assert seen[1].axis_m(0.2) == pytest.approx(seen[0].axis_m(0.2), abs=1e-6)
    assert seen[1].thickness_m == pytest.approx(0.08)


def test_a_hanging_sleeve_does_not_narrow_the_shoulders(
    block: Callable[..., np.ndarray], outstretched: Callable[..., np.ndarray]
) -> None:
    arm = level_arm(outstretched(), CAMERA, DISTANCE_M, 1)
    assert arm is not None
    trunk = block(95, 220, 150, 170)
    bare = trunk | block(104, 140, 130, 138) | block(104, 140, 182, 190)
    sleeved = bare | block(104, 140, 138, 142) | block(104, 140, 178, 182)
    found = [axes_distance_m(f, CAMERA, DISTANCE_M, 0.2, 0.1, 1.6, arm) for f in (bare, sleeved)]
    # The arms' middles are 52 px apart; an arm's outline is 1.06 thicknesses wide when it hangs.
    assert found == pytest.approx([0.52, 0.52], abs=0.006)


def test_what_hangs_below_an_arm_is_not_the_arm(
    block: Callable[..., np.ndarray], outstretched: Callable[..., np.ndarray]
) -> None:
    skirt = block(160, 220, 90, 230)
    left = level_arm(outstretched() | skirt, CAMERA, DISTANCE_M, 1)
    assert left is not None
    assert left.thickness_m == pytest.approx(0.08)
    assert left.slope == pytest.approx(0.0, abs=1e-9)


def test_no_arm_in_almost_nothing(block: Callable[..., np.ndarray]) -> None:
    assert level_arm(block(10, 20, 10, 25), CAMERA, DISTANCE_M, 1) is None


@pytest.mark.parametrize(
    ("left_px", "right_px", "expected_m"),
    [
        (80, 80, 1.60),
        (80, 78, 1.58),  # a pixel off the middle is nothing
        # 24 px are missing of one arm: the longer one is measured from the head's middle.
        (80, 56, 1.60),
        (56, 80, 1.60),
    ],
)
def test_the_span_by_hand(
    left_px: int, right_px: int, expected_m: float, outstretched: Callable[..., np.ndarray]
) -> None:
    image = outstretched(left_px=left_px, right_px=right_px)
    left, right = (level_arm(image, CAMERA, DISTANCE_M, side) for side in (1, -1))
    assert left is not None
    assert right is not None
    found = span_m(image, CAMERA, DISTANCE_M, left, right)
    assert found == pytest.approx(expected_m, abs=0.02)


def test_a_width_by_hand(block: Callable[..., np.ndarray]) -> None:
    assert width_m(block(50, 150, 100, 140), CAMERA, DISTANCE_M, 0.0) == pytest.approx(0.40)
    assert np.isnan(width_m(block(50, 60, 100, 140), CAMERA, DISTANCE_M, -0.5))
