"""What is said on /tf is the forward kinematics of the URDF that is published beside it."""

from __future__ import annotations

import io
from collections.abc import Iterable

import numpy as np
import pytest

from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.skeleton import JOINT_NAMES, PLACE_NAMES
from cardbox_tracker.person.urdf import (
    ROOT_LINK,
    LinkTransform,
    LinkTransforms,
    rep155_urdf,
    urdf_from_body,
)

BODY = BodyModel.of(distance_m=2.3, hip_height_m=-0.4, camera_pitch_rad=0.2)


def matrix(link: LinkTransform) -> np.ndarray:
    """Return (4, 4), written from the definition of a unit quaternion."""
    x, y, z, w = link.rotation
    assert np.linalg.norm(link.rotation) == pytest.approx(1.0, abs=1e-12)
    cross = np.array([(0, -z, y), (z, 0, -x), (-y, x, 0)])
    placed = np.eye(4)
    placed[:3, :3] += 2 * w * cross + 2 * cross @ cross
    placed[:3, 3] = link.translation_m
    return placed


def poses(links: Iterable[LinkTransform], root: str = ROOT_LINK) -> dict[str, np.ndarray]:
    """Return every link's pose (4, 4) in the root, in whatever order they come."""
    waiting = list(links)
    found = {root: np.eye(4)}
    while waiting:
        ready = [link for link in waiting if link.parent in found]
        assert ready, f"no way from {root} to {[link.child for link in waiting]}"
        for link in ready:
            found[link.child] = found[link.parent] @ matrix(link)
            waiting.remove(link)
    return found


@pytest.mark.parametrize("kind", ["own", "rep155"])
def test_they_are_those_of_yourdfpy(kind: str) -> None:
    rng = np.random.default_rng(7)
    yourdfpy = pytest.importorskip("yourdfpy", reason="yourdfpy is not installed")
    urdf = urdf_from_body(BODY, "eye") if kind == "own" else rep155_urdf(BODY, "a", "eye")
    robot = yourdfpy.URDF.load(io.BytesIO(urdf.encode()))
    links = LinkTransforms(urdf)
    assert set(links.joint_names) == set(robot.actuated_joint_names)
    for _ in range(10):
        joints = dict(zip(links.joint_names, rng.uniform(-1.5, 1.5, 40), strict=False))
        robot.update_cfg(joints)
        found = poses(links.at(joints), robot.base_link)
        assert set(found) == set(robot.link_map)
        for link, pose in found.items():
            np.testing.assert_allclose(
                pose, robot.get_transform(link, robot.base_link), atol=1e-9, err_msg=link
            )


def test_a_joint_without_a_position_is_named() -> None:
    joints = dict.fromkeys((*JOINT_NAMES[1:], *PLACE_NAMES), 0.0)
    with pytest.raises(ValueError, match="torso_y"):
        LinkTransforms(urdf_from_body(BODY)).at(joints)
