"""Share of a film's images in which a standing or squatting person would fall.

    python -m lab.tools.falls TABLE... [--person K]

A table is one of ``cardbox track`` with legs. The middle of the mass has to be between 6 cm behind
and 21 cm ahead of the ankles, where heels and toes are. Images with the hips below 70 % of their
usual height are squats; of these, shoulders and hips are given as cm ahead of the ankles.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from cardbox_tracker import Result, read_result
from cardbox_tracker.camera.camera import level_to_optical
from cardbox_tracker.person.proportions import MASS_SHARES
from cardbox_tracker.person.sizes import FloatArray

_BEHIND_M, _AHEAD_M, _SQUAT = -0.06, 0.21, 0.7


def ahead_of_ankles(result: Result) -> tuple[FloatArray, FloatArray]:
    """Return the middle of the mass, shoulders and hips ahead of the ankles, and the hips' height.

    They are (n, 3) and (n,), m; nan without legs.
    """
    assert result.body is not None, "a table has its body beside it"
    to_level = level_to_optical(result.body.camera_pose.pitch_rad)

    def middle(name: str) -> FloatArray:
        sides = [
            np.stack([result.numbers[f"{side}_{name}_{axis}"] for axis in "xyz"], axis=1)
            for side in ("left", "right")
        ]
        return np.asarray(np.mean(sides, axis=0) @ to_level)

    shoulders, hips, knees, ankles = map(middle, ("shoulder", "hip", "knee", "ankle"))
    mass = np.tensordot(MASS_SHARES, [shoulders, hips, knees, ankles], axes=1)
    yaw = result.numbers["torso_yaw"]
    facing = np.stack([np.cos(yaw), np.sin(yaw), np.zeros(len(yaw))], axis=1)
    ahead = [((point - ankles) * facing).sum(axis=1) for point in (mass, shoulders, hips)]
    return np.stack(ahead, axis=1), hips[:, 2] - ankles[:, 2]


def main() -> None:
    """Print a line for each table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tables", type=Path, nargs="+", metavar="TABLE")
    parser.add_argument("--person", type=int, metavar="K", help="one of several people")
    given = parser.parse_args()
    print("table: images, would fall; squats: shoulders, hips ahead of the ankles, cm")
    for path in given.tables:
        ahead_m, height_m = ahead_of_ankles(read_result(path, given.person))
        known = np.isfinite(height_m)
        mass_m = ahead_m[known, 0]
        falls = np.mean((mass_m < _BEHIND_M) | (mass_m > _AHEAD_M))
        squats = ahead_m[known & (height_m < _SQUAT * np.nanpercentile(height_m, 90)), 1:]
        middle = 100 * np.median(squats, axis=0) if len(squats) else ()
        where = ", ".join(f"{one:.0f}" for one in middle)
        print(f"{path.stem}: {known.sum()}, {falls:.0%}; {len(squats)}: {where}")


if __name__ == "__main__":
    main()
