"""How good results are, in words."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.skeleton import JOINT_NAMES, KeypointState
from cardbox_tracker.recordings.track import Quality
from cardbox_tracker.search.doubt import Doubt, Source
from cardbox_tracker.tracking.estimate import LOST, NO_PERSON, TRACKING, UNCERTAIN, Estimate, Place

SURE, UNSURE = KeypointState.TRACKED, KeypointState.UNCERTAIN
BODY = BodyModel()


class Frame:
    cameras: tuple[None, ...] = (None,)
    body = BODY

    def __init__(self, time_s: float) -> None:
        self.time_s, self.stamp_ns = time_s, round(1e9 * time_s)


def estimate(state: str, right: KeypointState = SURE, chance: float = 0.0) -> Estimate:
    stddev = np.zeros(12)
    stddev[JOINT_NAMES.index("torso_y")] = 0.05
    stddev[JOINT_NAMES.index("torso_roll") :] = np.radians(8.0)
    return Estimate(
        state,
        np.zeros(12),
        stddev,
        keypoint_states=(SURE, SURE, SURE, SURE, SURE, right),
        keypoint_chances=np.array([0, 0, 0, 0, 0, chance]),
    )


def lines(*images: tuple[float, Estimate]) -> list[str]:
    quality = Quality()
    for time_s, one in images:
        quality(cast(Any, Frame(time_s)), one, cast(Any, Frame(time_s)))
    return list(quality.lines())


def test_sure_images_and_hands_are_counted() -> None:
    unsure = replace(estimate(UNCERTAIN, UNSURE, 0.3), reason="a hand hides")
    share, why, deviation, moments = lines(
        (0.0, replace(estimate(TRACKING), place=Place(np.zeros(3), 0.01, "given"))),
        (1.0, replace(unsure, place=Place(np.zeros(3), 0.9, "given"), pitch_stddev_rad=0.1)),
        (5.0, Estimate(LOST)),
        (9.0, Estimate(NO_PERSON)),
    )
    assert share == (
        "sure: the posture in 25% of 4 images (hands 38%), leans in 25%, the distance (to 0.3 m) "
        "in 25%"
    )
    assert why == "postures are unsure where a hand hides (1), lost (1)"
    assert deviation.startswith("typical standard deviation: 8 degrees of an angle, ")
    assert moments == "least sure, look at them: 1.0 s (right hand), 5.0 s (lost)"


def test_why_hands_may_be_sure_where_the_posture_is_not_is_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # What the doubt itself says of hands that may be wrong.
    values = {"slope": np.full(6, 1.0), "yaw": np.full(6, 1.5), "left over": np.zeros(6)}
    judged = Doubt().judge(values, Source.POINTS, np.zeros(6, np.bool_))
    unsure = replace(estimate(UNCERTAIN), reason=judged.reason)
    hint = lines((0.0, unsure))[2]
    assert "left_hand_state" in hint and "film more from the front" in hint
    assert not any("left_hand_state" in one for one in lines((0.0, estimate(TRACKING))))
    monkeypatch.setattr(Frame, "cameras", (None, None))
    hint = lines((0.0, unsure))[2]
    assert "left_hand_state" in hint and "second camera" not in hint


def test_a_hand_deviates_with_its_joints_and_the_distance_with_the_place() -> None:
    only = estimate(TRACKING)
    assert only.posture_stddev is not None
    # The torso's place moves the whole person, and the elbow the hand.
    only.posture_stddev[1:] = 0.0
    assert lines((0.0, only))[1].endswith(
        "0 degrees of an angle, 0 cm of a hand beside the shoulders"
    )
    for side in ("left", "right"):
        only.posture_stddev[JOINT_NAMES.index(f"{side}_elbow_flexion")] = 0.5
    placed = replace(only, place=Place(np.array([0.12, 0.0, 0.4]), 0.01, "given"))
    hand_cm = 100 * 2 * np.sin(0.25) * BODY.size("forearm_length")
    assert lines((0.0, placed))[1].endswith(
        f"{hand_cm:.0f} cm of a hand beside the shoulders, 12 cm of the distance"
    )


def test_the_worst_moments_are_apart_and_in_order() -> None:
    images = [(time_s, estimate(UNCERTAIN, UNSURE, chance)) for time_s, chance in SOME]
    assert lines(*images)[3] == (
        "least sure, look at them: 1.0 s (right hand), 5.0 s (right hand), 9.0 s (right hand)"
    )


SOME = [(1.0, 0.5), (3.0, 0.4), (5.0, 0.9), (7.0, 0.8), (9.0, 0.3)]


def test_an_unknown_pitch_is_told_with_what_to_give() -> None:
    shown = replace(estimate(TRACKING), pitch_stddev_rad=np.radians(15.0), cost_px=1, iou=0.9)
    assert lines((0.0, shown))[:2] == [
        "sure: the posture in 100% of 1 images (hands 100%), leans in 0%, the distance (to 0.3 m) "
        "in 0%",
        "leans are unsure: the camera's pitch is 0 +- 15 degrees; give --camera-pitch-deg (0 for a "
        "level camera)",
    ]


def test_without_images_there_is_nothing_to_say() -> None:
    assert lines() == []


@pytest.mark.parametrize("count", [1, 30])
def test_few_moments_are_named(count: int) -> None:
    images = [(4.0 * n, estimate(UNCERTAIN, UNSURE, 0.5)) for n in range(count)]
    assert lines(*images)[3].count("right hand") == min(count, 5)


def test_who_comes_back_is_told_with_the_chance() -> None:
    here = replace(estimate(TRACKING), person_chance=1.0)
    back = replace(here, person_chance=0.93)
    told = lines((0.0, here), (1.0, replace(Estimate(LOST), person_chance=1.0)), (4.2, back))
    (line,) = (one for one in told if one.startswith("away or hidden"))
    assert line.endswith("being the same person: 4.2 s (93%)")
    assert not any(one.startswith("away") for one in lines((0.0, here), (1.0, here)))
