"""The hands' rows of the skeleton: the robot description and the measured palm agree."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import TURNING_LIMITS
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import HAND_NAMES, JOINT_NAMES, turn_of
from cardbox_tracker.person.urdf import LinkTransforms, urdf_from_body
from cardbox_tracker.tracking.estimate import Hand

BODY = BodyModel.of(distance_m=2.0)
LINKS = LinkTransforms(urdf_from_body(BODY, torso_place=False, hands=True))
SIDES = ("left", "right")
postures = arrays(np.float64, 12, elements=st.floats(0.0, 1.0))


def rotation(quaternion: tuple[float, ...]) -> FloatArray:
    x, y, z, w = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def turned(joints: dict[str, float], link: str) -> FloatArray:
    """Rotation (3, 3) of a link's frame in that of the root."""
    by_child = {one.child: one for one in LINKS.at(joints)}
    whole = np.eye(3)
    while link in by_child:
        whole = rotation(by_child[link].rotation) @ whole
        link = by_child[link].parent
    return whole


@pytest.mark.parametrize("side", SIDES)
@settings(max_examples=15, deadline=None)
@given(
    share=postures,
    turn=st.floats(-3.1, 3.1),
    flexion=st.floats(-1.2, 1.2),
    deviation=st.floats(-0.6, 0.6),
)
def test_the_description_has_the_palm_that_was_measured(
    side: str, share: FloatArray, turn: float, flexion: float, deviation: float
) -> None:
    low, high = TURNING_LIMITS.T
    joints = dict.fromkeys(HAND_NAMES, 0.0)
    joints |= zip(JOINT_NAMES, (low + share * (high - low)).tolist(), strict=True)
    names = [f"{side}_{name}" for name in ("forearm_turn", "wrist_flexion", "wrist_deviation")]
    joints |= zip(names, (turn, flexion, deviation), strict=True)
    sign = 1.0 if side == "left" else -1.0
    palm = turned(joints, f"{side}_palm")
    forearm = turned(joints, f"{side}_forearm")
    normal, fingers, along = palm @ [0.0, -sign, 0.0], -palm[:, 2], -forearm[:, 2]
    # As in the module that measures hands.
    assert -normal @ along == pytest.approx(np.sin(flexion), abs=1e-9)
    straight = along - (along @ normal) * normal
    straight /= np.linalg.norm(straight)
    aside = sign * np.cross(straight, normal)
    assert np.arctan2(fingers @ aside, fingers @ straight) == pytest.approx(deviation, abs=1e-9)
    found = turn_of(normal, forearm, sign)
    assert np.cos(found - turn) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("side", SIDES)
def test_a_hanging_hand_by_hand(side: str) -> None:
    """In the frame of the torso X is ahead and Y to the left."""
    joints = dict.fromkeys((*JOINT_NAMES, *HAND_NAMES), 0.0)
    torso = turned(joints, "torso")
    inwards = np.array([0.0, -1.0 if side == "left" else 1.0, 0.0])

    def palm() -> FloatArray:
        # The normal out of the palm of the left hand is -Y of its link, of the right one Y.
        return torso.T @ turned(joints, f"{side}_palm") @ inwards

    np.testing.assert_allclose(palm(), inwards, atol=1e-9)
    joints[f"{side}_forearm_turn"] = np.pi / 2
    # The thumb was ahead, and turns inwards; the palm faces back.
    np.testing.assert_allclose(palm(), [-1.0, 0.0, 0.0], atol=1e-9)
    joints[f"{side}_wrist_flexion"] = np.pi / 2
    np.testing.assert_allclose(palm(), [0.0, 0.0, 1.0], atol=1e-9)


def test_joints_are_kept_within_their_limits() -> None:
    wrist = np.array([-3.0, 3.0, 0.0])
    found = np.degrees(Hand(None, np.zeros(3), wrist, np.zeros(3), turn=4.0).joints)
    np.testing.assert_allclose(found, [180.0, -90.0, 50.0])
    assert len(HAND_NAMES) == 6
    assert HAND_NAMES[3] == "right_forearm_turn"


def test_a_measured_body_has_hands_only_if_they_are_asked_for() -> None:
    assert "palm" not in urdf_from_body(BODY)
    assert urdf_from_body(BODY, hands=True).count('type="revolute"') == 27
