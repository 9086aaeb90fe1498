"""Figures of measured wrists: how exact the hand's direction is against that of the forearm.

    cardbox track SESSION/bag --stature M --detector mediapipe --hands --csv TABLE.csv
    python -m lab.tools.wrists SESSION TABLE.csv [SESSION TABLE.csv ...]

The truth has elbow, wrist and hand of each arm, so the angle between forearm and hand is known, but
not how much of it is flexion. *Hand* is the error of the hand's direction, after the measured
forearm is turned to the true one, and *straight* that of a hand that goes on from the forearm, both
as root mean square. *Bent* is the share of hands whose true angle is larger than 15 degrees, the
limit of RULA, *right* how often the measurement says on which side of it a hand is, and *chance*
the mean probability of that side, as RULA draws it.
"""

from __future__ import annotations

import csv
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from cardbox_tracker.person.sizes import FloatArray

_BENT_RAD = np.radians(15.0)


def main() -> None:
    """Print a line for each session."""
    print("session, hands, degrees: hand, straight; shares: bent, right, chance")
    for folder, table in zip(sys.argv[1::2], sys.argv[2::2], strict=True):
        truth = json.loads((Path(folder) / "ground_truth.json").read_text(encoding="utf-8"))
        true = {str(one["stamp_ns"]): one.get("joints_m") for one in truth["frames"]}
        with Path(table).open(encoding="utf-8") as file:
            found = np.array(list(_errors(csv.DictReader(file), true)))
        error, bent, measured, chance = found.T
        is_bent = bent > _BENT_RAD
        right = is_bent == (measured > _BENT_RAD)
        likely = np.where(is_bent, chance, 1.0 - chance)
        degrees = (np.degrees(np.sqrt(np.mean(one**2))) for one in (error, bent))
        print(
            f"{Path(folder).name}, {len(found)}, {', '.join(f'{one:.0f}' for one in degrees)}, "
            f"{is_bent.mean():.2f}, {right.mean():.2f}, {likely.mean():.2f}",
            flush=True,
        )


def _errors(rows: Any, true: dict[str, Any]) -> Iterator[tuple[float, float, float, float]]:
    """Yield the error of each hand's direction, its true angle, and the measured one, rad.

    The last value is the probability that it is bent.
    """
    noise = np.random.default_rng(0).standard_normal((500, 2))
    for row in rows:
        joints = true.get(row["stamp_ns"])
        for side, sign in (("left", 1.0), ("right", -1.0)):
            if joints is None or not row[f"{side}_wrist_flexion"]:
                continue

            def at(name: str, row: Any = row, side: str = side) -> FloatArray:
                return np.array([row[f"{side}_{name}_{axis}"] for axis in "xyz"], float)

            true_m = [
                np.array(joints[f"{side}_{name}"], float) for name in ("elbow", "wrist", "hand")
            ]
            if not np.isfinite(true_m).all():
                continue
            true_forearm, true_hand = (_unit(one) for one in np.diff(true_m, axis=0))
            forearm, palm = _unit(at("hand") - at("elbow")), at("palm")
            names = [f"{side}_wrist_{name}" for name in ("flexion", "deviation")]
            mean = np.array([row[name] for name in names], float)
            drawn = mean + noise * [float(row[f"{name}_stddev_rad"]) for name in names]
            straight = _unit(forearm - (forearm @ palm) * palm)
            aside = sign * np.cross(straight, palm)
            hand = _turned(forearm, true_forearm) @ (
                np.cos(mean[1]) * straight + np.sin(mean[1]) * aside
            )
            yield (
                _angle(hand, true_hand),
                _angle(true_forearm, true_hand),
                float(np.arccos(np.cos(mean).prod())),
                float(np.mean(np.arccos(np.cos(drawn).prod(axis=1)) > _BENT_RAD)),
            )


def _turned(start: FloatArray, end: FloatArray) -> FloatArray:
    """Return the least rotation (3, 3) from one unit vector (3,) to another."""
    axis = np.cross(start, end)
    rotation, _ = cv2.Rodrigues(_angle(start, end) * axis / max(float(np.linalg.norm(axis)), 1e-9))
    return np.asarray(rotation, np.float64)


def _angle(first: FloatArray, second: FloatArray) -> float:
    return float(np.arccos(np.clip(first @ second, -1.0, 1.0)))


def _unit(vector: FloatArray) -> FloatArray:
    return np.asarray(vector / np.linalg.norm(vector))


if __name__ == "__main__":
    main()
