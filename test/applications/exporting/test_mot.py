"""Coordinates for OpenSim: postures by hand, directions computed back, and the file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker.applications.exporting.mot import (
    ARM,
    LUMBAR,
    coordinates_of,
    write_mot,
    write_rates,
    write_sto,
)
from cardbox_tracker.person.isb_angles import LABORATORY
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.legs import floor_m, leg_directions
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import LEFT_ARM, RIGHT_ARM, YAW
from cardbox_tracker.person.skeleton import (
    LEG_NAMES,
    STATE_NAMES,
    arm_directions,
    rotation_x,
    rotation_y,
    rotation_z,
)


def postures(count: int = 40) -> np.ndarray:
    rng = np.random.default_rng(0)
    states = rng.uniform(-0.5, 0.5, (count, 14))
    states[:, 4:12] = rng.uniform(0.4, 1.4, (count, 8))
    return states


def forwards(found: dict[str, np.ndarray], side: float) -> tuple[np.ndarray, np.ndarray]:
    """Return upper arm and forearm (n, 3) in OpenSim's trunk, as its joints turn about their axes.

    Those of the left arm turn about -X and -Y where those of the right one turn about X and Y.
    """
    sign = -side
    flex, add, rot, bend = (found[f"{name}_{'l' if side > 0 else 'r'}"] for name in ARM)
    humerus = rotation_z(flex) @ rotation_x(sign * add) @ rotation_y(sign * rot)
    down = np.array([0.0, -1.0, 0.0])
    return humerus @ down, humerus @ rotation_z(bend) @ down


@pytest.mark.parametrize(("side", "arm"), [(1.0, LEFT_ARM), (-1.0, RIGHT_ARM)])
def test_opensim_s_joints_bring_the_limbs_back(side: float, arm: slice) -> None:
    states = postures()
    for found, expected in zip(
        forwards(coordinates_of(states), side), arm_directions(states[:, arm], side), strict=True
    ):
        np.testing.assert_allclose(found, expected @ LABORATORY.T, atol=1e-9)


def test_the_lumbar_joint_has_the_rotation_of_the_trunk(body: BodyModel) -> None:
    states = postures()
    found = coordinates_of(states)
    extension, bending, rotation = (found[name] for name in LUMBAR)
    turned = rotation_z(extension) @ rotation_x(bending) @ rotation_y(rotation)
    expected = LABORATORY @ pose(body, states).torso_rotation @ LABORATORY.T
    np.testing.assert_allclose(turned, expected, atol=1e-9)


def test_a_straight_elbow_keeps_the_rotation_and_angles_do_not_jump() -> None:
    states = np.zeros((60, 14))
    states[:, 4] = 0.3
    states[:, 6] = 0.02 * np.sin(2.0 * np.arange(60))
    states[:, 7] = [*np.linspace(0.0, 1.5, 20), *np.linspace(1.5, 0.0, 40)]
    found = coordinates_of(states)
    assert np.abs(np.diff(found["arm_rot_l"])).max() < np.radians(10)
    assert found["elbow_flex_l"][19] == pytest.approx(1.5, abs=0.01)


def test_the_file_has_degrees_metres_and_no_row_in_a_gap(
    tmp_path: Path, motion_of: Callable, body: BodyModel
) -> None:
    states = postures(4)
    states[1] = np.nan
    motion = motion_of(states, body)
    write_mot(tmp_path / "person.mot", motion, body)
    lines = (tmp_path / "person.mot").read_text().splitlines()
    end = lines.index("endheader")
    assert {"version=1", "nRows=3", "nColumns=15", "inDegrees=yes"} <= set(lines[:end])
    names = lines[end + 1].split("\t")
    rows = np.array([line.split("\t") for line in lines[end + 2 :]], float)
    assert rows.shape == (3, len(names)) and names[0] == "time"
    np.testing.assert_allclose(rows[:, 0], [0.0, 0.2, 0.3])
    column = dict(zip(names, rows.T, strict=True))
    expected = np.degrees(coordinates_of(states[[0, 2, 3]])["arm_flex_r"])
    np.testing.assert_allclose(column["arm_flex_r"], expected, atol=1e-5)
    hips = pose(body, states[[0, 2, 3]]).hip
    np.testing.assert_allclose(column["pelvis_ty"], hips[:, 2] - floor_m(body), atol=1e-5)
    np.testing.assert_allclose(column["pelvis_tx"], hips[:, 0], atol=1e-5)
    write_mot(tmp_path / "bare.mot", motion, None)
    assert "pelvis" not in (tmp_path / "bare.mot").read_text()


def test_legs_and_hands_turn_as_opensim_s_joints(
    tmp_path: Path, motion_of: Callable, body: BodyModel
) -> None:
    """The left joints turn about -X and -Y; the pelvis turns with the trunk."""
    legs = np.radians([[40.0, 20, 10, 50, 30, 15, -10, 70]])
    wrists = np.radians([[[20.0, 10, -30], [np.nan, np.nan, np.nan]]])
    state = np.zeros(14)
    state[3] = 0.5
    motion = motion_of(state, body, legs=legs, wrists=wrists, palms=np.ones((1, 2, 3)))
    write_mot(tmp_path / "a.mot", motion, body)
    names, row = (tmp_path / "a.mot").read_text().splitlines()[-2:]
    found = dict(zip(names.split("\t"), map(float, row.split("\t")), strict=True))
    for side, suffix, angles in ((1.0, "l", legs[:, :4]), (-1.0, "r", legs[:, 4:])):
        flexion, adduction, rotation, knee = (
            np.radians(found[f"{name}_{suffix}"])
            for name in ("hip_flexion", "hip_adduction", "hip_rotation", "knee_angle")
        )
        thigh = rotation_z(flexion) @ rotation_x(-side * adduction) @ rotation_y(-side * rotation)
        down = np.array([0.0, -1.0, 0.0])
        for bone, expected in zip(
            (thigh @ down, thigh @ rotation_z(-knee) @ down),
            leg_directions(angles, side),
            strict=True,
        ):
            np.testing.assert_allclose(bone, LABORATORY @ expected[0], atol=1e-6)
    assert found["pelvis_rotation"] == pytest.approx(np.degrees(0.5), abs=1e-5)
    assert found["lumbar_rotation"] == pytest.approx(0.0, abs=1e-5)
    # OpenSim counts the forearm's rotation from full supination; an unknown hand is at rest.
    left = [found[f"{name}_l"] for name in ("wrist_flex", "wrist_dev", "pro_sup")]
    right = [found[f"{name}_r"] for name in ("wrist_flex", "wrist_dev", "pro_sup")]
    assert left == pytest.approx([20.0, 10.0, 60.0]) and right == pytest.approx([0.0, 0.0, 90.0])


def test_angles_do_not_jump_by_a_whole_turn(
    motion_of: Callable, body: BodyModel, tmp_path: Path
) -> None:
    states = np.zeros((8, 14))
    # The person turns around.
    states[:, YAW] = np.linspace(2.5, 4.0, 8)
    write_mot(tmp_path / "a.mot", motion_of(states, body), body)
    lines = (tmp_path / "a.mot").read_text(encoding="utf-8").splitlines()
    rows = np.array([line.split() for line in lines[7:]], float)
    turned = rows[:, lines[6].split().index("lumbar_rotation")]
    np.testing.assert_allclose(np.abs(np.diff(turned)), np.degrees(1.5 / 7), atol=1e-3)


def test_sto_has_the_columns_of_mot_below_the_header_of_opensim_4(
    tmp_path: Path, motion_of: Callable, body: BodyModel
) -> None:
    motion = motion_of(postures(4), body)
    mot, sto = tmp_path / "a.mot", tmp_path / "a.sto"
    write_mot(mot, motion, body)
    write_sto(sto, motion, body)
    (_, below), (head, same) = (one.read_text().split("endheader\n") for one in (mot, sto))
    assert below == same
    assert {"DataType=double", "version=3", "inDegrees=yes", "nRows=4"} <= {*head.splitlines()}


def test_the_storage_has_velocities_and_accelerations_with_deviations(
    motion_of: Callable, body: BodyModel, tmp_path: Path
) -> None:
    """The person turns by 0.5 rad/s and comes by 0.2 m/s; legs are seen in the last images."""
    states, legs = np.zeros((5, 14)), np.zeros((5, 8))
    states[:, [4, 8]] = 0.3
    legs[:2] = np.nan
    rates = np.full((5, len(STATE_NAMES) + 18, 4), np.nan)
    rates[:, :14] = 0.0, 0.1, 0.0, 1.0
    rates[:, YAW] = 0.5, 0.1, -2.0, 1.0
    rates[:, STATE_NAMES.index("torso_x")] = 0.2, 0.01, 3.0, 0.5
    first = STATE_NAMES.index(LEG_NAMES[0])
    rates[2:, first : first + 8] = 0.4, 0.2, 0.0, 1.0
    rates[0] = np.nan
    motion = motion_of(states, body, legs=legs, rates=lambda: rates.reshape(5, -1))
    write_rates(tmp_path / "a.sto", motion, body)
    lines = (tmp_path / "a.sto").read_text(encoding="utf-8").splitlines()
    rows = np.array([line.split() for line in lines[7:]], float)
    found = dict(zip(lines[6].split(), rows.T, strict=True))

    def of(name: str) -> np.ndarray:
        kinds = "u", "u_std", "dudt", "dudt_std"
        return np.array([found[f"{name}_{kind}"] for kind in kinds]).T

    # The first image has no velocities.
    np.testing.assert_allclose(found["time"], [0.1, 0.2, 0.3, 0.4])
    turn = np.degrees([0.5, 0.1, -2.0, 1.0])
    np.testing.assert_allclose(of("pelvis_rotation"), np.tile(turn, (4, 1)), atol=1e-3)
    np.testing.assert_allclose(of("pelvis_tx"), [[0.2, 0.01, 3.0, 0.5]] * 4, atol=1e-3)
    knee = np.degrees([0.4, 0.2, 0.0, 1.0])
    np.testing.assert_allclose(of("knee_angle_r")[1:], np.tile(knee, (3, 1)), atol=1e-3)
    assert np.isnan(of("knee_angle_r")[0]).all() and not np.isnan(of("arm_flex_r")).any()
