"""Postures that are not the ones asked for are named; those that are pass."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from cardbox_tracker.applications.simulation.person import FINGER_REACH
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.common.errors import InitializationError
from cardbox_tracker.measuring.asked_outline import check_asked
from cardbox_tracker.measuring.config import InitializationConfig
from cardbox_tracker.measuring.reference_checks import check_postures
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import LEFT_ARM, RIGHT_ARM, SIDE_TURNS, reference_posture
from cardbox_tracker.person.sizes import DEFAULT_SIZES, SIZE_INDEX

CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
BODY = BodyModel.of(hip_height_m=-0.5)


def seen(
    name: str,
    body: BodyModel = BODY,
    yaw_deg: float | None = None,
    arms_deg: Mapping[str, float] | None = None,
) -> np.ndarray:
    """A reference; ``left_abduction``, ``right_elbow`` and so on replace angles of the arms."""
    arms_deg = arms_deg or {}
    posture = reference_posture(name, body.side_turn)
    if yaw_deg is not None:
        posture[3] = np.radians(yaw_deg)
    for arm, side in ((LEFT_ARM, "left"), (RIGHT_ARM, "right")):
        for i, angle in enumerate(("abduction", "flexion", "elbow")):
            if f"{side}_{angle}" in arms_deg:
                posture[arm.start + i] = np.radians(arms_deg[f"{side}_{angle}"])
    sizes = body.sizes.copy()
    sizes[SIZE_INDEX["forearm_length"]] *= 1.0 + FINGER_REACH
    drawn = cardbox_patches(body.with_values(sizes=sizes), posture)
    return render(drawn, CAMERA.with_pitch(body.camera_pose.pitch_rad))


def all_seen(body: BodyModel = BODY, **replaced: np.ndarray) -> dict[str, np.ndarray]:
    return {name: seen(name, body) for name in ("front", "side", "arms")} | replaced


def problems(references: dict[str, np.ndarray], body: BodyModel = BODY) -> list[str]:
    camera = CAMERA.with_pitch(body.camera_pose.pitch_rad)
    try:
        check_postures(references, camera, body.placement.distance_m)
    except InitializationError as error:
        return [str(error)]
    return []


def both(**angles_deg: float) -> dict[str, float]:
    return {f"{side}_{name}": a for name, a in angles_deg.items() for side in ("left", "right")}


@pytest.mark.parametrize("side_turn", SIDE_TURNS)
@pytest.mark.parametrize("factor", [0.8, 1.0, 1.1])
@pytest.mark.parametrize("pitch_deg", [0.0, 10.0])
def test_the_postures_pass(side_turn: str, factor: float, pitch_deg: float) -> None:
    body = BodyModel.of(
        DEFAULT_SIZES * factor,
        distance_m=2.3,
        hip_height_m=-0.5,
        camera_pitch_rad=np.radians(pitch_deg),
        side_turn=side_turn,
    )
    assert problems(all_seen(body), body) == []
    check_postures(all_seen(body), CAMERA.with_pitch(body.camera_pose.pitch_rad), 2.3)


def test_a_few_degrees_are_no_mistake() -> None:
    references = all_seen(
        front=seen("front", arms_deg={"left_abduction": 14.0, "right_abduction": 27.0}),
        side=seen("side", yaw_deg=82.0),
        arms=seen(
            "arms",
            arms_deg={"left_abduction": 88.0, "right_abduction": 72.0, "left_elbow": -5.0},
        ),
    )
    assert problems(references) == []


@pytest.mark.parametrize(
    ("order", "text"),
    [
        (
            ("side", "front", "arms"),
            "references 'front' and 'side' look swapped; capture both again",
        ),
        (
            ("arms", "side", "front"),
            "references 'front' and 'arms' look swapped; capture both again",
        ),
        (
            ("front", "arms", "side"),
            "references 'side' and 'arms' look swapped; capture both again",
        ),
        (
            ("side", "arms", "front"),
            "the references look mixed up: 'front' looks like 'side', 'side' looks like 'arms', "
            "'arms' looks like 'front'; capture them again",
        ),
    ],
)
def test_references_in_a_wrong_order_are_named(order: tuple[str, ...], text: str) -> None:
    right = all_seen()
    mixed = dict(zip(("front", "side", "arms"), (right[name] for name in order), strict=True))
    assert problems(mixed) == [text]


@pytest.mark.parametrize(
    ("arms_deg", "text"),
    [
        (both(abduction=20.0), "reference 'arms': the arms are not raised"),
        (both(abduction=45.0), "reference 'arms': the left arm is not stretched sideways"),
        ({"right_abduction": 20.0}, "reference 'arms': the right arm is not stretched sideways"),
        (both(abduction=130.0), "reference 'arms': the left arm is not stretched sideways (it "),
        (both(elbow=100.0), "reference 'arms': the"),
        (both(flexion=75.0), "reference"),
    ],
)
def test_arms_that_are_not_stretched_are_named(arms_deg: dict[str, float], text: str) -> None:
    found = problems(all_seen(arms=seen("arms", arms_deg=arms_deg)))
    assert len(found) == 1
    assert found[0].startswith(text)


def test_how_far_an_arm_is_off_is_told() -> None:
    found = problems(all_seen(arms=seen("arms", arms_deg=both(abduction=130.0))))
    # A model's thicker upper arm is taken for a sleeve, so the axis is a degree flatter.
    assert "39 degrees above" in found[0] and "10 below" in found[0]


def test_an_arm_cut_short_is_named() -> None:
    arms = seen("arms")
    columns = np.nonzero(arms.any(axis=0))[0]
    arms[:, columns[-1] - 45 :] = 0
    found = problems(all_seen(arms=arms))
    assert found[0].startswith("reference 'arms': one arm reaches")
    assert "the left arm is bent" in found[0]


@pytest.mark.parametrize(
    ("arms_deg", "text"),
    [
        (both(abduction=45.0), "the arms are raised too far"),
        ({**both(abduction=45.0), **both(elbow=-110.0)}, "the hands are at the body"),
        (both(abduction=0.0), "the arms touch the body"),
    ],
)
def test_arms_of_front_that_do_not_hang_are_named(arms_deg: dict[str, float], text: str) -> None:
    found = problems(all_seen(front=seen("front", arms_deg=arms_deg)))
    advice = "capture 'front' again: face the camera, arms 20 degrees away from the body"
    assert found == [f"reference 'front': {text}; {advice}"]


@pytest.mark.parametrize("yaw_deg", [0.0, 30.0])
def test_whoever_turned_too_little_is_told_so(yaw_deg: float) -> None:
    found = problems(all_seen(side=seen("side", yaw_deg=yaw_deg)))
    assert len(found) == 1
    assert found[0].startswith("reference 'side': the person did not turn by 90 degrees")


@pytest.mark.parametrize("name", ["side", "arms"])
def test_whoever_came_nearer_is_told_so(name: str) -> None:
    """At 1.9 instead of 2.3 m somebody whose head is above the camera seems taller."""
    body = BodyModel.of(distance_m=2.3, hip_height_m=-0.3)
    near = seen(name, body.with_values(distance_m=1.9))
    found = problems(all_seen(body, **{name: near}), body)
    assert len(found) == 1
    assert f"'{name}'" in found[0]


@pytest.mark.parametrize("name", ["front", "side", "arms"])
@pytest.mark.parametrize("other", ["front", "side", "arms"])
@pytest.mark.parametrize("factor", [0.85, 1.1])
def test_another_posture_is_named_at_its_capture(name: str, other: str, factor: float) -> None:
    body = BODY.with_values(sizes=DEFAULT_SIZES * factor)
    config = InitializationConfig(distance_m=BODY.placement.distance_m)
    silhouette = seen(other, body)
    if name == other:
        assert check_asked(name, silhouette, CAMERA, config) == ""
        return
    with pytest.raises(InitializationError, match=f"'{name}': .*'{other}'"):
        check_asked(name, silhouette, CAMERA, config)
    unchecked = replace(config, check_postures=False)
    assert check_asked(name, silhouette, CAMERA, unchecked) == ""


def test_what_looks_like_no_posture_is_warned_of_at_its_capture() -> None:
    config = InitializationConfig(distance_m=BODY.placement.distance_m)
    silhouette = np.zeros((240, 320), np.uint8)
    silhouette[60:, 60:260] = 255
    text = check_asked("front", silhouette, CAMERA, config)
    assert "'front'" in text and "IoU" in text and "0.60" in text


def test_all_of_it_is_an_error() -> None:
    right = all_seen()
    references = all_seen(front=right["side"], side=right["front"])
    with pytest.raises(InitializationError, match=r"'front' and 'side' .*swapped"):
        check_postures(references, CAMERA, BODY.placement.distance_m)
