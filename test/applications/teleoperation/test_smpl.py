"""Rotations from SMPL's T-pose put the joints where they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cardbox_tracker.applications.teleoperation.full_body import NAMES, FullBodies, FullBody
from cardbox_tracker.applications.teleoperation.smpl import PARENTS, write_npz
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.model import body_from_proportions
from cardbox_tracker.person.skeleton import JOINT_NAMES, LEG_NAMES, NECK_NAMES

BODY = body_from_proportions(1.75, 2.0)
ALL = (*JOINT_NAMES, *NECK_NAMES, *LEG_NAMES)
# Those that move with the joint before them alone; shoulders rise by themselves.
LIMBS = [
    f"{side}_{part}"
    for side in ("left", "right")
    for part in ("elbow", "wrist", "hand", "knee", "ankle", "foot")
]


def full_body(**angles_deg: float) -> FullBody:
    values = dict.fromkeys(ALL, 0.0) | {name: np.radians(v) for name, v in angles_deg.items()}
    found = FullBodies().update(5, "tracking", BODY, values, dict.fromkeys(ALL, 0.1), {})
    assert found is not None
    return found


def smpl(points: np.ndarray) -> np.ndarray:
    """Return points (..., 3) with X to the left, Y up, Z ahead."""
    return points[..., [1, 2, 0]]


def written(tmp_path: Path, *bodies: FullBody) -> dict[str, np.ndarray]:
    write_npz(bodies, 30.0, tmp_path / "a.npz")
    return dict(np.load(tmp_path / "a.npz"))


def test_a_hanging_arm_is_lowered_by_a_quarter_and_all_else_rests(tmp_path: Path) -> None:
    found = written(tmp_path, full_body())["pose_body"].reshape(21, 3)
    expected = np.zeros((21, 3))
    # About the axis ahead, Z, the left arm sinks by negative angles.
    expected[NAMES.index("left_shoulder") - 1, 2] = -np.pi / 2
    expected[NAMES.index("right_shoulder") - 1, 2] = np.pi / 2
    assert found == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_the_rotations_put_the_limbs_where_they_are(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    body = full_body(**{name: rng.uniform(-40, 40) for name in ALL if name != "torso_y"})
    arrays = written(tmp_path, body)
    # The T-pose: hanging arms are raised sideways.
    rest = full_body().points_m
    offsets = rest - rest[list(PARENTS)]
    for number, name in enumerate(NAMES):
        side, _, part = name.partition("_")
        if part in ("elbow", "wrist", "hand"):
            sign = 1.0 if side == "left" else -1.0
            offsets[number] = Rotation.from_euler("x", sign * 90, degrees=True).apply(
                offsets[number]
            )
    vectors = np.vstack([np.zeros(3), arrays["pose_body"].reshape(21, 3), np.zeros((2, 3))])
    turns: list[Rotation] = []
    for number, vector in enumerate(vectors):
        before = turns[PARENTS[number]] if number else Rotation.identity()
        turns.append(before * Rotation.from_rotvec(vector))
    for name in LIMBS:
        number = NAMES.index(name)
        parent = PARENTS[number]
        moved = turns[parent].apply(smpl(offsets[number]))
        assert moved == pytest.approx(smpl(body.points_m[number] - body.points_m[parent]), abs=1e-9)


def test_a_person_stands_on_the_floor_and_faces_their_yaw(tmp_path: Path) -> None:
    found = written(tmp_path, full_body(torso_yaw=90), full_body())
    assert found["pose_body"].shape == (2, 63) and found["trans"].shape == (2, 3)
    assert (str(found["gender"]), found["mocap_frame_rate"], found["betas"].shape) == (
        "neutral",
        30.0,
        (16,),
    )
    ahead, up = (
        Rotation.from_rotvec(found["root_orient"]).apply(axis) for axis in np.eye(3)[[2, 1]]
    )
    assert ahead == pytest.approx(np.array([[0, 1, 0], [1, 0, 0]]), abs=1e-9)
    assert up == pytest.approx(np.array([[0, 0, 1], [0, 0, 1]]), abs=1e-9)
    # SMPL-X counts from a point that is above its pelvis.
    pelvis_m = found["trans"] + [0.0031, -0.3514, 0.0120]
    foot_m = found["smpl_joints"][:, NAMES.index("left_foot"), 2]
    assert pelvis_m[:, 2] == pytest.approx(-foot_m)
    assert found["joint_valid"].shape == (2, 24) and found["stamp_ns"].tolist() == [5, 5]
    with pytest.raises(CardboxError, match="no posture"):
        write_npz([], 30.0, tmp_path / "b.npz")
