"""Measure random bodies of each family, and compare the sizes with the true ones.

python -m learning.measurement --makehuman FOLDER --rocketbox FOLDER [--count N]

Each person takes the reference postures a little inexactly before a random camera, with the true
distance and nearly clean silhouettes. The table has the mean and the standard deviation of
measured divided by true lengths, the share of lengths within 6 %, and the error of the shoulders'
height, cm.
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.kinematics import pose
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import reference_posture
from cardbox_tracker.errors import CardboxError
from cardbox_tracker.estimation.initialization.config import InitializationConfig
from cardbox_tracker.estimation.initialization.measure import initialize_body
from learning.bodies import FAMILIES, Posed, RiggedBody, draw
from learning.command_line import run
from learning.motions.reference import reference_pose
from learning.rendering import render
from learning.room import draw_viewpoint
from learning.silhouette_faults import Degrader, Faults

FloatArray = NDArray[np.float64]
LENGTHS = ("upper_arm_length", "forearm_length", "shoulder_breadth")
SEED = 4
_WITHIN = 0.06


def ratios(body: RiggedBody, rng: np.random.Generator) -> FloatArray | None:
    """Return measured divided by true lengths and the error of the shoulders' height, m, (4,).

    None if the measurement was refused.
    """
    viewpoint = draw_viewpoint(rng, body.stature_m)
    camera, colours = viewpoint.camera, body.colours
    degrade = Degrader(Faults(raggedness=0.002), rng)
    silhouettes = {}
    for name in ("front", "side", "arms"):
        posed = body.posed(*reference_pose(name, rng))
        optical_m = viewpoint.optical(posed.vertices)
        light = np.array([0.0, 0.0, -1.0])
        seen = render(optical_m, body.faces, colours, camera, light).silhouette
        silhouette = degrade(seen)
        assert silhouette is not None
        silhouettes[name] = silhouette
    config = InitializationConfig(
        distance_m=float(viewpoint.place_m[0]),
        camera_pitch_rad=camera.pitch_rad,
        check_postures=False,
    )
    try:
        measured = initialize_body(silhouettes, camera, config).body
    except CardboxError:
        return None
    hanging = body.posed(*reference_pose("front"))
    lengths = [measured.size(name) for name in LENGTHS] / true_lengths_m(hanging)
    return np.append(
        lengths, _shoulders_m(measured) - _true_shoulders_m(hanging, viewpoint.place_m)
    )


def true_lengths_m(posed: Posed) -> FloatArray:
    """Return the lengths of :data:`LENGTHS`, (3,), metres."""
    joints = posed.keypoints.astype(np.float64)
    arms = np.linalg.norm(np.diff(joints.reshape(2, 3, 3), axis=1), axis=2).mean(axis=0)
    return np.append(arms, np.linalg.norm(joints[0] - joints[3]))


def _shoulders_m(measured: BodyModel) -> float:
    keypoints = pose(measured, reference_posture("front")).keypoints_m
    return float(keypoints[[0, 3], 2].mean())


def _true_shoulders_m(posed: Posed, camera_m: FloatArray) -> float:
    return float(posed.keypoints[[0, 3], 2].mean() - camera_m[2])


def main(args: list[str] | None = None) -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    for family in FAMILIES:
        parser.add_argument(f"--{family}", type=Path)
    parser.add_argument("--count", type=int, default=60, help="people of each family")
    given = parser.parse_args(args)
    print(f"{'':22}" + "".join(f"{name:>22}" for name in (*LENGTHS, "shoulders' height")))
    for family in FAMILIES:
        folder = getattr(given, family)
        if folder is None:
            continue
        rows: dict[str, list[FloatArray]] = defaultdict(list)
        for number in range(given.count):
            rng = np.random.default_rng((SEED, number))
            body = draw(rng, [family], {family: folder})
            found = ratios(body, rng)
            if found is not None:
                rows[body.sex].append(found)
        for sex, each in sorted(rows.items()):
            table = np.array(each)
            cells = [
                f"{column.mean():8.3f} +-{column.std():.3f} {100 * near.mean():4.0f} %"
                for column in table[:, :3].T
                for near in [abs(column - 1.0) <= _WITHIN]
            ]
            height = f"{100 * table[:, 3].mean():8.1f} +-{100 * table[:, 3].std():.1f}"
            print(
                f"{family} {sex} ({len(table)})".ljust(22)
                + "".join(c.rjust(22) for c in (*cells, height))
            )
    return 0


if __name__ == "__main__":
    sys.exit(run(main))
