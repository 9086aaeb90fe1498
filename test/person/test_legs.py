"""The legs' rows of the skeleton: angles and directions, and the robot description."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.legs import leg_angles, leg_directions
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.parts import body_parts
from cardbox_tracker.person.proportions import HIP_SHARE, SHANK_SHARE, THIGH_SHARE, stature_of
from cardbox_tracker.person.skeleton import LEG_NAMES, Group, names_of
from cardbox_tracker.person.urdf import LinkTransforms, urdf_from_body

BODY = BodyModel()
ANGLES = st.tuples(
    st.floats(-0.6, 2.1), st.floats(-0.5, 1.0), st.floats(-0.8, 0.8), st.floats(0.1, 2.5)
)


@given(ANGLES, st.sampled_from([1.0, -1.0]))
def test_angles_come_back_from_the_directions(
    angles: tuple[float, float, float, float], side: float
) -> None:
    thigh, shank = leg_directions(np.array(angles), side)
    assert leg_angles(thigh, shank, side) == pytest.approx(angles, abs=1e-6)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_directions_by_hand(side: float) -> None:
    """X points forwards, Y to the left, Z up."""
    seated = leg_directions(np.radians([90.0, 0.0, 0.0, 90.0]), side)
    assert np.array(seated) == pytest.approx(np.array([(1, 0, 0), (0, 0, -1)]), abs=1e-9)
    # Knees apart while sitting, and feet outwards by a turn inwards of the thigh.
    apart = leg_directions(np.radians([90.0, 30.0, 0.0, 90.0]), side)
    assert apart[0] == pytest.approx([np.sqrt(0.75), side * 0.5, 0.0], abs=1e-9)
    turned = leg_directions(np.radians([90.0, 0.0, 30.0, 90.0]), side)
    assert turned[1] == pytest.approx([0.0, side * 0.5, -np.sqrt(0.75)], abs=1e-9)


def test_the_description_with_legs_moves_as_they_do() -> None:
    angles = np.radians([70.0, 20.0, 10.0, 60.0, 15.0, -5.0, -20.0, 30.0])
    links = LinkTransforms(urdf_from_body(BODY))
    positions = dict.fromkeys(names_of(*{*Group} - {Group.HAND}), 0.0) | {"torso_yaw": 0.4}
    positions |= dict(zip(LEG_NAMES, angles.tolist(), strict=True))
    assert set(links.joint_names) == set(positions)
    found = {one.child: one for one in links.at(positions)}

    def place(link: str) -> np.ndarray:
        at = np.zeros(3)
        while link in found:
            one = found[link]
            x, y, z, w = one.rotation
            turn = np.array([x, y, z])
            at = at + 2.0 * np.cross(turn, np.cross(turn, at) + w * at) + one.translation_m
            link = one.parent
        return at * (-1.0, -1.0, 1.0)

    stature_m = stature_of(body_parts(BODY.sizes))
    hip = pose(BODY, np.zeros(12)).hip
    c, s = np.cos(0.4), np.sin(0.4)
    yaw = np.array([(c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)])
    for number, (name, side) in enumerate((("left", 1.0), ("right", -1.0))):
        thigh, shank = leg_directions(angles[4 * number : 4 * number + 4], side)
        chain = np.array([0.0, side * HIP_SHARE, 0.0]) + THIGH_SHARE * thigh + SHANK_SHARE * shank
        expected = hip + stature_m * yaw @ chain
        assert place(f"{name}_foot") == pytest.approx(expected, abs=1e-3)


def test_a_description_of_the_posture_alone_has_no_legs() -> None:
    assert "thigh" in urdf_from_body(BODY)
    assert "thigh" not in urdf_from_body(BODY, torso_place=False)
