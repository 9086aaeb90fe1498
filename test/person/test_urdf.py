"""The URDF of a body moves as the body itself does."""

from __future__ import annotations

import io
import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree as Xml

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cardbox_tracker.camera.camera import Camera, roll_turn
from cardbox_tracker.commands.main import main
from cardbox_tracker.common.compiling import kernel
from cardbox_tracker.person.kinematics import clavicles, gaze_m, keypoints, pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import load_body_model
from cardbox_tracker.person.parts import body_parts
from cardbox_tracker.person.posture import (
    N_JOINTS,
    N_STATE,
    TURNING_LIMITS,
    place_limits,
    state_limits,
)
from cardbox_tracker.person.rep155 import Rep155Joints, joint_names
from cardbox_tracker.person.sizes import SIZE_LIMITS
from cardbox_tracker.person.skeleton import (
    JOINT_NAMES,
    LEG_LIMITS,
    NECK_LIMITS,
    SKELETON,
    Group,
    names_of,
    neck_rotation,
)
from cardbox_tracker.person.urdf import ROOT_LINK, rep155_urdf, urdf_from_body
from cardbox_tracker.recordings.outputs import joint_values
from cardbox_tracker.search.config import PRESETS
from cardbox_tracker.terms.kernel_arguments import BodyTuple, body_of, body_tuple
from cardbox_tracker.tracking.estimate import TRACKING, Estimate

CLAVICLE_LINKS = ("left_clavicle", "right_clavicle")
KEYPOINT_LINKS = (
    "left_upper_arm",
    "left_forearm",
    "left_hand",
    "right_upper_arm",
    "right_forearm",
    "right_hand",
)
# From the reference frame (X to the camera, Y right) to the URDF's root (X away, Y left).
TO_ROOT = np.diag([-1.0, -1.0, 1.0])
ALL_NAMES = names_of(*{*Group} - {Group.HAND})
REP155_LINKS = ("l_shoulder", "l_elbow", "l_wrist", "r_shoulder", "r_elbow", "r_wrist")
PLACE_LIMITS = place_limits(2.0)
ALL_LIMITS = np.vstack([TURNING_LIMITS, PLACE_LIMITS, NECK_LIMITS, [[0.0, 0.15]] * 2, LEG_LIMITS])


def child(element: Xml.Element, tag: str) -> dict[str, str]:
    """Return the attributes of the first child of that tag."""
    found = element.find(tag)
    assert found is not None, f"no <{tag}>"
    return dict(found.attrib)


def axis_angle(axis: np.ndarray, angle: float) -> np.ndarray:
    """Rodrigues' formula, (3, 3)."""
    x, y, z = axis
    cross = np.array([(0, -z, y), (z, 0, -x), (-y, x, 0)])
    turned: np.ndarray = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return turned


def numbers(text: str) -> np.ndarray:
    return np.array([float(value) for value in text.split()])


def link_poses(
    xml: str, positions: Mapping[str, float], root: str = ROOT_LINK
) -> dict[str, np.ndarray]:
    """Forward kinematics of a URDF, written from its specification: link name to (4, 4)."""
    robot = Xml.fromstring(xml)
    poses = {root: np.eye(4)}
    for joint in robot.findall("joint"):  # parents come before children in our files
        origin = child(joint, "origin")
        roll, pitch, yaw = numbers(origin["rpy"])
        placed = np.eye(4)
        placed[:3, :3] = (
            axis_angle(np.array([0, 0, 1]), yaw)
            @ axis_angle(np.array([0, 1, 0]), pitch)
            @ axis_angle(np.array([1, 0, 0]), roll)
        )
        placed[:3, 3] = numbers(origin["xyz"])
        moved = np.eye(4)
        if joint.attrib["type"] != "fixed":
            axis = numbers(child(joint, "axis")["xyz"])
            value = positions[joint.attrib["name"]]
            if joint.attrib["type"] == "prismatic":
                moved[:3, 3] = axis * value
            else:
                moved[:3, :3] = axis_angle(axis, value)
        parent = poses[child(joint, "parent")["link"]]
        poses[child(joint, "child")["link"]] = parent @ placed @ moved
    return poses


def random_postures(count: int) -> np.ndarray:
    rng = np.random.default_rng(5)
    return rng.uniform(TURNING_LIMITS[:, 0], TURNING_LIMITS[:, 1], (count, 12))


def random_places(count: int) -> np.ndarray:
    rng = np.random.default_rng(6)
    return rng.uniform(PLACE_LIMITS[:, 0], PLACE_LIMITS[:, 1], (count, 2))


bodies = arrays(np.float64, len(SIZE_LIMITS), elements=st.floats(0.0, 1.0))
states = arrays(np.float64, N_STATE, elements=st.floats(0.0, 1.0))


def somebody(share: np.ndarray, pitch_rad: float) -> BodyModel:
    low, high = SIZE_LIMITS.T
    sizes = np.clip(low + share * (high - low), low, high)
    return BodyModel.of(sizes, distance_m=2.3, hip_height_m=-0.4, camera_pitch_rad=pitch_rad)


@settings(max_examples=60, deadline=None)
@given(
    *(bodies, states, st.floats(-1.0, 1.0), st.sampled_from([0.0, 0.3, -1.6])),
    *(st.sampled_from(["default", "paper"]), st.booleans()),
)
def test_urdf_and_joint_states_have_the_joints_where_keypoints_are(
    sizes: np.ndarray,
    share: np.ndarray,
    pitch_rad: float,
    roll_rad: float,
    preset: str,
    is_rep155: bool,
) -> None:
    """For anybody in any posture; what a tracker publishes, without its search."""
    body = PRESETS[preset]().with_shoulders(somebody(sizes, pitch_rad))
    body = body.with_values(camera_roll_rad=roll_rad)
    low, high = state_limits(body.placement.distance_m).T
    state = low + share * (high - low)
    posture, place = np.split(state, [N_JOINTS])
    raised_m, _ = clavicles(body, posture, np.full(N_JOINTS, 0.1))
    neck = np.array([0.3, -0.2])
    found = Estimate(TRACKING, posture, offset_m=place, neck=neck, clavicles_m=raised_m)
    camera = Camera(320, 240, 300.0, 300.0, 159.5, 119.5, pitch_rad)
    keypoints_m = np.empty((6, 3))
    published(state, body_tuple(body, camera), keypoints_m)
    if is_rep155:
        values = Rep155Joints()(np.array([*posture, *place, *neck, *raised_m]))
        joints = dict(zip(joint_names("a"), values, strict=True))
        poses = link_poses(rep155_urdf(body, "a", "eye"), joints, "eye")
        links = [f"{link}_a" for link in REP155_LINKS]
    else:
        said = joint_values(found)
        assert said is not None
        assert said.names == ALL_NAMES
        poses = link_poses(urdf_from_body(body, "eye"), said.by_name)
        links = list(KEYPOINT_LINKS)
    to_eye = np.linalg.inv(poses["eye"])
    for point, link in zip(keypoints_m @ roll_turn(roll_rad), links, strict=True):
        at = to_eye @ poses[link][:, 3]
        # An angle of REP-155 that means nothing is left as it was.
        np.testing.assert_allclose(at[:3], point, atol=1e-3 if is_rep155 else 1e-9, err_msg=link)
    assert preset == "default" or not np.any(raised_m)


@kernel
def published(state: np.ndarray, body: BodyTuple, points: np.ndarray) -> None:
    keypoints(state, body_of(body), points)


@pytest.mark.parametrize("posture", random_postures(8))
def test_without_the_place_the_shoulders_are_rigid(posture: np.ndarray) -> None:
    body = BodyModel.of(distance_m=2.3, hip_height_m=-0.4, lateral_m=0.1).rigid
    xml = urdf_from_body(body, torso_place=False)
    assert_agrees(xml, body, posture, dict(zip(JOINT_NAMES, posture, strict=True)))


def test_torso_x_is_nearer_to_the_camera_and_torso_z_is_higher() -> None:
    """By hand: 2.3 m away and 0.4 m below, then 0.5 m nearer and 0.1 m higher."""
    body = BodyModel.of(distance_m=2.3, hip_height_m=-0.4)
    moved = dict.fromkeys(ALL_NAMES, 0.0) | {"torso_x": 0.5, "torso_z": 0.1}
    poses = link_poses(urdf_from_body(body), moved)
    np.testing.assert_allclose(poses["torso"][:3, 3], (1.8, 0.0, -0.3), atol=1e-12)
    np.testing.assert_allclose(poses["hips"][:3, 3], (2.3, 0.0, -0.4), atol=1e-12)


def test_without_the_place_it_and_neck_and_clavicles_are_missing() -> None:
    full = Xml.fromstring(urdf_from_body(BodyModel(), "eye"))
    short = Xml.fromstring(urdf_from_body(BodyModel(), "eye", torso_place=False))
    legs = [joint for joint in SKELETON if joint.group == Group.LEG]
    of_legs = [name for joint in legs for name in (joint.name, joint.link)]
    missing = {*ALL_NAMES[12:], *CLAVICLE_LINKS, *of_legs}
    for element in [*full.findall("link"), *full.findall("joint")]:
        if element.attrib["name"].removesuffix("_link") in missing:
            full.remove(element)
    raised = "left_shoulder_abduction", "right_shoulder_abduction"
    for joint, link in (("torso_y", "hips"), *((name, "torso") for name in ("neck", *raised))):
        (parent,) = full.findall(f"joint[@name='{joint}']/parent")
        parent.attrib["link"] = link
        moved, same = (
            robot.findall(f"joint[@name='{joint}']/origin")[0] for robot in (full, short)
        )
        moved.attrib["xyz"] = same.attrib["xyz"]
    for robot in (full, short):
        robot[:] = sorted(robot, key=lambda element: (element.tag, element.attrib["name"]))
    assert Xml.canonicalize(Xml.tostring(full), strip_text=True) == Xml.canonicalize(
        Xml.tostring(short), strip_text=True
    )


@pytest.mark.parametrize("neck", [(0.6, 0.0), (0.0, 0.5), (-0.9, -0.4)])
@pytest.mark.parametrize("posture", random_postures(2))
def test_the_head_turns_as_the_neck_does(posture: np.ndarray, neck: tuple[float, float]) -> None:
    body = BodyModel.of(distance_m=2.3, hip_height_m=-0.4)
    values = [*posture, 0.0, 0.0, *neck, *[0.0] * 10]
    head = link_poses(urdf_from_body(body), dict(zip(ALL_NAMES, values, strict=True)))["head"]
    frames = pose(body.rigid, posture)
    turned = frames.torso_rotation @ neck_rotation(np.array(neck))
    np.testing.assert_allclose(head[:3, :3], TO_ROOT @ turned, atol=1e-9)
    middle, _ = gaze_m(body_parts(body.sizes), frames, np.array(neck))
    np.testing.assert_allclose(head[:3, 3], TO_ROOT @ middle, atol=1e-9)


def assert_agrees(xml: str, body: BodyModel, posture: np.ndarray, joints: dict[str, float]) -> None:
    """The links of the URDF are where our kinematics has them for ``body``."""
    poses = link_poses(xml, joints)
    frames = pose(body.rigid, posture)
    for point, link in zip(pose(body.rigid, posture).keypoints_m, KEYPOINT_LINKS, strict=True):
        np.testing.assert_allclose(poses[link][:3, 3], TO_ROOT @ point, atol=1e-9)
    np.testing.assert_allclose(poses["head"][:3, 3], TO_ROOT @ frames.head, atol=1e-9)
    np.testing.assert_allclose(poses["torso"][:3, 3], TO_ROOT @ frames.hip, atol=1e-9)


def test_optical_frame_is_pitched_as_the_body_model_says() -> None:
    body = BodyModel.of(camera_pitch_rad=0.2)
    xml = urdf_from_body(body, optical_frame="cam_optical")
    poses = link_poses(xml, dict.fromkeys(ALL_NAMES, 0.0))
    camera = Camera(320, 240, 300.0, 300.0, 159.5, 119.5, pitch_rad=0.2)
    for point in np.array([(1.0, 0, 0), (0, 1.0, 0), (-2.0, 0.3, 0.5)]):
        optical = camera.reference_to_optical(point)
        np.testing.assert_allclose(
            poses["cam_optical"][:3, :3] @ optical, TO_ROOT @ point, atol=1e-9
        )


def test_the_floor_is_where_the_measured_person_stands() -> None:
    """By hand: hips 0.4 m below the camera, on legs of 53 % of a stature of 1.72 m."""
    poses = link_poses(urdf_from_body(BodyModel.of(hip_height_m=-0.4)), dict.fromkeys(ALL_NAMES, 0))
    np.testing.assert_allclose(poses["floor"][:3, 3], (0.0, 0.0, -0.4 - 0.53 * 1.72), atol=1e-9)
    np.testing.assert_array_equal(poses["floor"][:3, :3], np.eye(3))
    assert "floor" not in urdf_from_body(BodyModel.of(unknown=("hip_height_m",)))


def test_movable_joints_are_those_of_the_joint_state_with_limits() -> None:
    robot = Xml.fromstring(urdf_from_body(BodyModel()))
    movable = {j.attrib["name"]: j for j in robot.findall("joint") if j.attrib["type"] != "fixed"}
    assert set(movable) == set(ALL_NAMES)
    for name, (lower, upper) in zip(ALL_NAMES, ALL_LIMITS, strict=True):
        limit = child(movable[name], "limit")
        assert float(limit["lower"]) == pytest.approx(lower)
        assert float(limit["upper"]) == pytest.approx(upper)


@pytest.mark.parametrize("torso_place", [True, False])
def test_links_form_one_tree(torso_place: bool) -> None:
    robot = Xml.fromstring(urdf_from_body(BodyModel(), "optical", torso_place=torso_place))
    links = {link.attrib["name"] for link in robot.findall("link")}
    children = [child(joint, "child")["link"] for joint in robot.findall("joint")]
    assert sorted([*children, ROOT_LINK]) == sorted(links)


def test_visuals_are_the_fifteen_patches_and_the_legs() -> None:
    robot = Xml.fromstring(urdf_from_body(BodyModel()))
    assert len(robot.findall("link/visual")) == 15 + 4


def test_yourdfpy_loads_it_and_agrees() -> None:
    yourdfpy = pytest.importorskip("yourdfpy", reason="yourdfpy is not installed")
    body = BodyModel.of(distance_m=2.3)
    posture, place = random_postures(1)[0], random_places(1)[0]
    robot = yourdfpy.URDF.load(io.BytesIO(urdf_from_body(body).encode()))
    assert robot.validate()
    robot.update_cfg(dict(zip(ALL_NAMES, [*posture, *place, 0.4, -0.2, *[0.0] * 10], strict=True)))
    placed = Estimate(TRACKING, posture, offset_m=place).placed(body)
    for point, link in zip(pose(placed.rigid, posture).keypoints_m, KEYPOINT_LINKS, strict=True):
        np.testing.assert_allclose(
            robot.get_transform(link, ROOT_LINK)[:3, 3], TO_ROOT @ point, atol=1e-6
        )


def test_the_example_body_is_a_person_to_try_it_with(capsys: pytest.CaptureFixture[str]) -> None:
    yourdfpy = pytest.importorskip("yourdfpy", reason="yourdfpy is not installed")
    example = Path(__file__).resolve().parents[2] / "config" / "example_body.yaml"
    assert main(["urdf", str(example)]) == 0
    robot = yourdfpy.URDF.load(io.BytesIO(capsys.readouterr().out.encode()))
    assert robot.validate()
    assert set(robot.actuated_joint_names) == set(ALL_NAMES)
    assert main(["urdf", str(example), "--no-torso-place"]) == 0
    robot = yourdfpy.URDF.load(io.BytesIO(capsys.readouterr().out.encode()))
    assert set(robot.actuated_joint_names) == set(JOINT_NAMES)
    assert len(load_body_model(example).sizes) == 18


@pytest.mark.skipif(shutil.which("check_urdf") is None, reason="check_urdf is not installed")
@pytest.mark.parametrize("kind", ["own", "rep155"])
def test_check_urdf_accepts_it(tmp_path: Path, kind: str) -> None:
    body = BodyModel()
    path = tmp_path / "person.urdf"
    path.write_text(urdf_from_body(body, "eye") if kind == "own" else rep155_urdf(body, "a", "eye"))
    checked = subprocess.run(["check_urdf", str(path)], capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked.stdout + checked.stderr
