"""The joints and the URDF of REP-155 move as the body itself does, also through rest."""

from __future__ import annotations

import io
from xml.etree import ElementTree as Xml

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.person.kinematics import gaze_m, pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.parts import body_parts
from cardbox_tracker.person.posture import (
    LEFT_ARM,
    RIGHT_ARM,
    TURNING_LIMITS,
    place_limits,
    reference_posture,
)
from cardbox_tracker.person.rep155 import Rep155Joints, joint_names
from cardbox_tracker.person.skeleton import POSTURE_GROUPS, joints_of, neck_rotation
from cardbox_tracker.person.urdf import rep155_urdf
from cardbox_tracker.tracking.estimate import TRACKING, Estimate

yourdfpy = pytest.importorskip("yourdfpy", reason="yourdfpy is not installed")

BODY = BodyModel.of(distance_m=2.3, hip_height_m=-0.4, lateral_m=0.1, camera_pitch_rad=0.15)
LINKS = ("l_shoulder", "l_elbow", "l_wrist", "r_shoulder", "r_elbow", "r_wrist")


def load(body: BodyModel, torso_place: bool = True) -> yourdfpy.URDF:
    text = rep155_urdf(body, "p1", "eye", torso_place)
    robot = yourdfpy.URDF.load(io.BytesIO(text.encode()))
    assert robot.validate()
    return robot


ROBOT = load(BODY)


def places(robot: yourdfpy.URDF, values: np.ndarray) -> dict[str, np.ndarray]:
    """Where the URDF puts each link, in the optical frame."""
    robot.update_cfg(dict(zip(joint_names("p1"), values, strict=True)))
    return {
        name: robot.get_transform(f"{name}_p1", "eye")[:3, 3] for name in (*LINKS, "head", "body")
    }


def assert_agrees(
    posture: np.ndarray, values: np.ndarray, place: tuple[float, float] = (0.0, 0.0)
) -> None:
    camera = Camera(320, 240, 300.0, 300.0, 159.5, 119.5, pitch_rad=BODY.camera_pose.pitch_rad)
    body = Estimate(TRACKING, posture, offset_m=np.array(place)).placed(BODY)
    frames = pose(body.rigid, posture)
    found = places(ROBOT, np.array([*values, *place, 0.0, 0.0, 0.0, 0.0]))
    expected = dict(zip(LINKS, pose(body.rigid, posture).keypoints_m, strict=True))
    for name, point in {**expected, "head": frames.head, "body": frames.hip}.items():
        optical = camera.reference_to_optical(point)
        # Where a limb's angle means nothing, it is left as it was.
        np.testing.assert_allclose(found[name], optical, atol=2e-3, err_msg=name)


def within_limits() -> st.SearchStrategy[np.ndarray]:
    values = [st.floats(low, high) for low, high in TURNING_LIMITS.tolist()]
    return st.tuples(*values).map(np.array)


@settings(max_examples=25)
@given(st.lists(within_limits(), min_size=1, max_size=4))
def test_joints_of_any_sequence_put_the_limbs_where_they_are(postures: list[np.ndarray]) -> None:
    convert = Rep155Joints()
    for posture in postures:
        assert_agrees(posture, convert(posture))


@settings(max_examples=10)
@given(within_limits(), st.tuples(*(st.floats(*limits) for limits in place_limits(2.3).tolist())))
def test_the_place_moves_all_of_the_body(posture: np.ndarray, place: tuple[float, float]) -> None:
    assert_agrees(posture, Rep155Joints()(posture), place)


def test_without_the_place_there_are_twelve_joints() -> None:
    robot = load(BODY, torso_place=False)
    assert set(robot.actuated_joint_names) == set(joint_names("p1", torso_place=False))
    assert len(robot.actuated_joint_names) == 12


@pytest.mark.parametrize("neck", [(0.6, 0.0), (0.0, 0.5), (-0.9, -0.4)])
def test_the_head_turns_as_the_neck_does(neck: tuple[float, float]) -> None:
    """``p_head`` is positive upwards in the reference model."""
    posture, camera = np.zeros(12), Camera(320, 240, 300.0, 300.0, 159.5, 119.5, pitch_rad=0.15)
    posture[1:4] = (0.1, 0.3, -0.4)
    values = Rep155Joints()(np.array([*posture, 0.0, 0.0, *neck, 0.0, 0.0]))
    ROBOT.update_cfg(dict(zip(joint_names("p1"), values, strict=True)))
    frames = pose(BODY.rigid, posture)
    turned = frames.torso_rotation @ neck_rotation(np.array(neck))
    head = ROBOT.get_transform("head_p1", "eye")
    expected = camera.reference_to_optical_rotation() @ turned
    np.testing.assert_allclose(head[:3, :3], expected, atol=1e-6)
    middle, _ = gaze_m(body_parts(BODY.sizes), frames, np.array(neck))
    np.testing.assert_allclose(head[:3, 3], camera.reference_to_optical(middle), atol=1e-6)


@settings(max_examples=25)
@given(st.lists(within_limits(), min_size=1, max_size=6))
def test_values_stay_within_the_limits_of_the_urdf(postures: list[np.ndarray]) -> None:
    convert = Rep155Joints()
    for posture in postures:
        values = convert(posture)
        for name, value in zip(joint_names("p1", torso_place=False), values, strict=True):
            limit = ROBOT.joint_map[name].limit
            assert limit.lower - 1e-6 <= value <= limit.upper + 1e-6, name


@pytest.mark.parametrize(
    ("arm", "prefix"), [(LEFT_ARM, "l"), (RIGHT_ARM, "r")], ids=["left", "right"]
)
def test_plain_movements_have_plain_angles(arm: slice, prefix: str) -> None:
    """Raised aside is p alone; forwards has y at 90 degrees; a forearm forwards is the elbow."""
    index = {joint.rep155: number for number, joint in enumerate(joints_of(*POSTURE_GROUPS))}
    posture = reference_posture("front")
    posture[arm] = (0.8, 0.0, 0.0, 0.5)
    values = Rep155Joints()(posture)
    assert values[index[f"{prefix}_p_shoulder"]] == pytest.approx(0.8)
    assert values[index[f"{prefix}_y_shoulder"]] == pytest.approx(0.0)
    assert values[index[f"{prefix}_r_shoulder"]] == pytest.approx(0.0)
    assert values[index[f"{prefix}_elbow"]] == pytest.approx(0.5)
    posture[arm] = (0.0, 0.6, 0.0, 0.5)
    values = Rep155Joints()(posture)
    assert values[index[f"{prefix}_p_shoulder"]] == pytest.approx(0.6)
    assert values[index[f"{prefix}_y_shoulder"]] == pytest.approx(np.pi / 2)
    assert values[index[f"{prefix}_elbow"]] == pytest.approx(0.5)


def test_the_torso_keeps_its_angles() -> None:
    posture = np.zeros(12)
    posture[:4] = (0.3, 0.1, 0.4, -0.2)
    values = dict(zip(joint_names("a", torso_place=False), Rep155Joints()(posture), strict=True))
    assert [values[f"{n}_a"] for n in ("body", "r_waist", "waist", "y_waist")] == [
        0.3,
        0.1,
        0.4,
        -0.2,
    ]


@settings(max_examples=25)
@given(
    direction=st.floats(-np.pi, np.pi),
    elbow=st.floats(-np.pi, np.pi),
    reach=st.floats(0.15, 0.45),
    steps=st.integers(21, 60),
)
def test_a_swing_through_rest_does_not_jump(
    direction: float, elbow: float, reach: float, steps: int
) -> None:
    """From one side of the hanging, straight arm through rest itself to the other, and back."""
    swing = np.concatenate([np.linspace(reach, -reach, steps), np.linspace(-reach, reach, steps)])
    convert = Rep155Joints()
    values = []
    for amount in swing:
        posture = np.zeros(12)
        shoulder = amount * np.array([np.cos(direction), np.sin(direction)])
        forearm = amount * np.array([np.cos(elbow), np.sin(elbow)])
        posture[LEFT_ARM] = posture[RIGHT_ARM] = [*shoulder, *forearm]
        values.append(convert(posture))
    assert_agrees(posture, values[-1])
    jumps = np.abs(np.diff(values, axis=0))
    # A step of the swing is at most 0.045 rad; the angles about it follow at that order.
    assert jumps.max() < 0.2


def test_what_means_nothing_stays_as_it_was() -> None:
    convert = Rep155Joints()
    posture = np.zeros(12)
    posture[LEFT_ARM] = (0.3, 0.4, 0.2, 0.7)
    before = convert(posture)
    rest = convert(np.zeros(12))
    np.testing.assert_allclose(rest[[4, 6]], before[[4, 6]])
    np.testing.assert_allclose(rest[[5, 7]], 0.0)


def test_every_name_but_the_sensors_has_the_suffix() -> None:
    robot = Xml.fromstring(rep155_urdf(BODY, "p1", "eye"))
    names = [element.attrib["name"] for tag in ("link", "joint") for element in robot.findall(tag)]
    assert [name for name in names if not name.endswith("_p1")] == ["eye"]
    movable = {j.attrib["name"] for j in robot.findall("joint") if j.attrib["type"] != "fixed"}
    assert movable == set(joint_names("p1"))
    parents = {
        joint.find("child").attrib["link"]: joint.find("parent").attrib["link"]  # type: ignore[union-attr]
        for joint in robot.findall("joint")
    }
    assert [parents[f"{name}_p1"] for name in ("body", "z_body", "x_body")] == [
        "z_body_p1",
        "x_body_p1",
        "eye",
    ]


@pytest.mark.parametrize("pitch", [0.0, 1e-9, 0.2, -0.7])
def test_the_body_is_upright_before_any_camera(pitch: float) -> None:
    body = BodyModel.of(camera_pitch_rad=pitch)
    camera = Camera(320, 240, 300.0, 300.0, 159.5, 119.5, pitch_rad=pitch)
    robot = load(body)
    robot.update_cfg(dict.fromkeys(joint_names("p1"), 0.0))
    matrix = robot.get_transform("body_p1", "eye")
    hip = np.array([-body.placement.distance_m, 0.0, body.placement.hip_height_m])
    for axis in np.eye(3):
        expected = camera.reference_to_optical(hip + axis)
        np.testing.assert_allclose(matrix[:3, :3] @ axis + matrix[:3, 3], expected, atol=1e-8)
