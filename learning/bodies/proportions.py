"""Prints the proportions of bodies by family and sex.

``python -m learning.bodies.proportions FAMILY=FOLDER... [--count N] [--drawn]``: without
``--drawn`` the bodies have no random sizes, and are those of the family.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from pathlib import Path
from typing import NamedTuple

import numpy as np

from learning.bodies.random_body import bare, draw
from learning.bodies.rigged import RiggedBody


class Proportions(NamedTuple):
    """Proportions of a body in the T-pose.

    ``upper_arm`` is shoulder to elbow, divided by the sum of that and elbow to knuckles.
    ``forward_m`` is how far the shoulders are before the hip joints, metres. ``breadth`` is the
    distance of the shoulder joints and ``reach`` that from shoulder to knuckles, both divided by
    the stature ``stature_m``.
    """

    upper_arm: float
    forward_m: float
    breadth: float
    reach: float
    stature_m: float


def proportions(body: RiggedBody) -> Proportions:
    """Return the proportions of a body."""
    posed = body.in_t_pose()
    shoulders, elbows, hands = posed.keypoints.reshape(2, 3, 3).transpose(1, 0, 2)
    upper = np.linalg.norm(elbows - shoulders, axis=1).mean()
    lower = np.linalg.norm(hands - elbows, axis=1).mean()
    stature = body.stature_m
    return Proportions(
        upper_arm=float(upper / (upper + lower)),
        forward_m=float(shoulders[:, 0].mean() - posed.hips[0]),
        breadth=float(np.linalg.norm(shoulders[0] - shoulders[1]) / stature),
        reach=float((upper + lower) / stature),
        stature_m=stature,
    )


def main() -> None:
    """Print mean and standard deviation of each proportion."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("families", nargs="+", help="FAMILY=FOLDER")
    parser.add_argument("--count", type=int, default=200, help="random bodies of each family")
    parser.add_argument("--drawn", action="store_true", help="with random sizes and clothes")
    arguments = parser.parse_args()
    folders = {name: Path(folder) for name, folder in (f.split("=") for f in arguments.families)}
    found: dict[tuple[str, str], list[Proportions]] = defaultdict(list)
    for family, folder in folders.items():
        for number in range(arguments.count):
            rng = np.random.default_rng(number)
            one = draw(rng, [family], folders) if arguments.drawn else bare(rng, family, folder)
            kind = "child" if "child" in one.name.lower() else one.sex
            found[family, kind].append(proportions(one))
    for (family, kind), rows in sorted(found.items()):
        print(f"{family} {kind} ({len(rows)})")
        for name, values in zip(Proportions._fields, np.array(rows).T, strict=True):
            print(f"  {name:10} {values.mean():7.3f} +- {values.std():.3f}")


if __name__ == "__main__":
    main()
