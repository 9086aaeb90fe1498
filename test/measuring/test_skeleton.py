"""The bones of the arms, out of outlines drawn by hand and of model bodies."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import pytest

from cardbox_tracker.applications.simulation.person import FINGER_REACH
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.measuring.shoulders import GIRDLE_RISE
from cardbox_tracker.measuring.skeleton import (
    KNUCKLES_SHARE,
    UPPER_ARM_SHARE,
    combined,
    measure_skeleton,
)
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import REFERENCE_NAMES, reference_posture
from cardbox_tracker.person.sizes import DEFAULT_SIZES, SIZE_INDEX

# At 2 m a pixel is 1 cm.
CAMERA = Camera(320, 240, 200.0, 200.0, 159.5, 119.5)
DISTANCE_M = 2.0


def seen(body: BodyModel, name: str) -> np.ndarray:
    """A model body with open hands, and with shoulders that rise with the arms."""
    sizes: np.ndarray = body.sizes.copy()
    sizes[SIZE_INDEX["forearm_length"]] *= 1.0 + FINGER_REACH
    if name == "arms":
        sizes[SIZE_INDEX["shoulder_drop"]] -= GIRDLE_RISE * body.size("shoulder_breadth")
    camera = Camera(320, 240, 330.0, 330.0, 159.5, 119.5, body.camera_pose.pitch_rad)
    patches = cardbox_patches(body.with_values(sizes=sizes), reference_posture(name))
    image: np.ndarray = render(patches, camera)
    return image


def test_readings_are_averaged_by_their_precision() -> None:
    # Weights 4 and 1 of logarithms.
    found = combined(np.array([1.0, 1.05]), np.array([0.05, 0.10]))
    assert found == pytest.approx(1.05**0.2, abs=1e-3)
    assert combined(np.array([0.4, np.nan]), np.array([0.05, 0.01])) == pytest.approx(0.4)
    # One that is far off hardly counts.
    found = combined(np.array([1.0, 1.01, 2.0]), np.array([0.03, 0.03, 0.03]))
    assert found == pytest.approx(1.0, abs=0.03)


def test_a_stick_figure_by_hand(
    block: Callable[..., np.ndarray], outstretched: Callable[..., np.ndarray]
) -> None:
    """Arms at row 100, hanging arms whose axes meet the joints' height 16 px from the middle."""
    arms = outstretched()
    front = block(95, 220, 146, 174) | block(60, 95, 152, 168)
    for side in (1, -1):
        outline = [(16, 100), (20, 98), (50, 180), (42, 182)]
        points = [[159.5 + side * x, y] for x, y in outline]
        cv2.fillPoly(front, [np.round(points).astype(np.int32)], 255)
    # Chest and hips are above each other in ``side``.
    references = {"front": front, "side": block(60, 220, 145, 175), "arms": arms}
    found = measure_skeleton(references, CAMERA, DISTANCE_M)
    assert found is not None
    assert found.forward_m == pytest.approx(0.0)
    assert found.span_m == pytest.approx(1.60)
    breadth = found.shoulder_breadth_m
    assert 0.28 < breadth < 0.40
    # The axis is 20 cm above the camera's centre, and the girdle sinks with the arms. The crown
    # of this figure is higher above its arms than a person's, and counts less.
    axis = 0.20 - GIRDLE_RISE * breadth
    assert axis - 0.005 < found.shoulder_height_m < axis + 0.03
    reach = KNUCKLES_SHARE * (0.99 * 1.60 - breadth) / 2
    assert found.upper_arm_m + found.forearm_m == pytest.approx(reach, abs=1e-6)
    assert found.upper_arm_m / reach == pytest.approx(UPPER_ARM_SHARE)


@pytest.mark.parametrize(("side_turn", "nearer"), [("left", 1.0), ("right", -1.0)])
def test_shoulders_before_the_hips_are_nearer(
    side_turn: str,
    nearer: float,
    block: Callable[..., np.ndarray],
    outstretched: Callable[..., np.ndarray],
) -> None:
    front = block(95, 220, 144, 176) | block(60, 95, 152, 168)
    # A pixel is 1 cm: the chest is 4 cm to the right of the hips. Half of that is believed.
    side = block(60, 125, 144, 164) | block(125, 220, 140, 160)
    references = {"front": front, "side": side, "arms": outstretched()}
    found = measure_skeleton(references, CAMERA, DISTANCE_M, side_turn)
    assert found is not None
    assert found.forward_m == pytest.approx(nearer * 0.02)
    assert found.span_m == pytest.approx(1.60 * (2.0 - nearer * 0.02) / 2.0)


def test_no_arms_no_skeleton(block: Callable[..., np.ndarray]) -> None:
    narrow = block(60, 220, 155, 165)
    assert measure_skeleton(dict.fromkeys(REFERENCE_NAMES, narrow), CAMERA, DISTANCE_M) is None


@pytest.mark.parametrize("pitch_deg", [0.0, 8.0])
@pytest.mark.parametrize("factor", [0.85, 1.0, 1.1])
def test_a_model_body_is_measured(factor: float, pitch_deg: float) -> None:
    body = BodyModel.of(
        DEFAULT_SIZES * factor, hip_height_m=-0.55, camera_pitch_rad=np.radians(pitch_deg)
    )
    camera = Camera(320, 240, 330.0, 330.0, 159.5, 119.5, body.camera_pose.pitch_rad)
    references = {name: seen(body, name) for name in REFERENCE_NAMES}
    found = measure_skeleton(references, camera, body.placement.distance_m)
    assert found is not None
    top = body.placement.hip_height_m + body.size("waist_height") + body.size("torso_height")
    expected = top - body.size("shoulder_drop")
    assert found.shoulder_height_m == pytest.approx(expected, abs=0.015)
    arm = body.size("upper_arm_length") + body.size("forearm_length")
    assert found.upper_arm_m + found.forearm_m == pytest.approx(arm, rel=0.05)
    assert found.shoulder_breadth_m == pytest.approx(body.size("shoulder_breadth"), rel=0.08)
