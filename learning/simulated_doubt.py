"""Fit the coefficients of the doubt about a detector's points to simulated people.

python -m learning.simulated_doubt [--makehuman FOLDER] [--rocketbox FOLDER] [--people N]

Random people of whom stature and distance are stated gesture before random cameras and are tracked
with the points of a simulated detector. A logistic regression on ``point_doubt.FEATURES`` estimates
whether a hand is off by more than 30 cm; wrong and right images weigh alike. The command prints the
coefficients beside those of the package and, by threshold, the shares of all images that are
certain, and that are certain although a hand is off. ``--check N`` adds people who are not fitted.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.proportions import STATURE_LIMITS_M, body_from_proportions
from cardbox_tracker.errors import CardboxError
from cardbox_tracker.estimation.config import PRESETS
from cardbox_tracker.estimation.cost.joint_points import JointPointsObservation
from cardbox_tracker.estimation.filtering import point_doubt
from cardbox_tracker.estimation.filtering.correction import FAR_M
from cardbox_tracker.estimation.filtering.keypoint_states import HANDS, UNCERTAIN_FROM
from cardbox_tracker.estimation.observation import Observation
from cardbox_tracker.estimation.tracker import Tracker
from learning.bodies import FAMILIES, draw
from learning.command_line import run
from learning.logistic import chances, fitted
from learning.motions.gestures import gestures
from learning.motions.reference import poses, reference_pose
from learning.recording import simulated_points
from learning.rendering import render
from learning.room import draw_viewpoint
from learning.simulated_points import SimulatedDetector

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

SEED, FPS, SECONDS = 4400, 15.0, 12.0
THRESHOLDS = (0.1, 0.15, 0.2, 0.25, 0.3, 0.4)
INVERSE_PENALTY = 1.0
_STANDING = 15
"""Images of the standing person before the gestures."""
# Deviation of the logarithms of stature and distance as people state them.
_TOLD = 0.015, 0.04
_LIGHT = np.array([0.0, -0.6, -0.8])


class Frames(NamedTuple):
    """Images with points: features (n, 4), whether a hand is off (n,), whether the hands are sure.

    ``are_sure`` (n,) is by all other reasons: the deviations, and the distance to the points.
    """

    features: FloatArray
    is_wrong: BoolArray
    are_sure: BoolArray


def frames_of(number: int, families: Mapping[str, Path]) -> Frames:
    """Track a simulated person; equal numbers give equal people.

    Raises:
        CardboxError: a folder has no bodies.
    """
    rng = np.random.default_rng((SEED, number))
    body = draw(rng, list(families), families)
    viewpoint = draw_viewpoint(rng, body.stature_m)
    camera = viewpoint.camera
    motion = gestures("", SECONDS, rng).resampled(FPS)
    told = np.exp(rng.normal(0.0, _TOLD))
    person = body_from_proportions(
        float(np.clip(body.stature_m * told[0], *STATURE_LIMITS_M)),
        float(viewpoint.place_m[0] * told[1]),
        camera_pitch_rad=camera.pitch_rad,
    )
    tracker = Tracker(person, camera, PRESETS["default"](), np.random.default_rng(number))
    detector = SimulatedDetector(camera, FPS, rng)
    latest: list[tuple[FloatArray, float]] = []
    original = point_doubt.features_of

    def noted(
        keypoints_m: FloatArray, observation: JointPointsObservation, farthest_m: float
    ) -> FloatArray:
        features = original(keypoints_m, observation, farthest_m)
        latest[:] = [(features, farthest_m)]
        return features

    rows: list[tuple[FloatArray, bool, bool]] = []
    with patch.object(point_doubt, "features_of", noted):
        for count, pose in enumerate([*[reference_pose("front")] * _STANDING, *poses(motion)]):
            posed = body.posed(*pose)
            optical_m = viewpoint.optical(posed.vertices)
            rendering = render(optical_m, body.faces, body.colours, camera, _LIGHT)
            points = simulated_points(viewpoint, posed, pose[0], rendering, detector)
            silhouette = 255 * rendering.silhouette.astype(np.uint8)
            latest.clear()
            stamp_ns = int(count * 1e9 / FPS)
            found = tracker.track(Observation(silhouette, stamp_ns=stamp_ns, points=points))
            if count < _STANDING or not latest or found.keypoints_m is None:
                continue
            off_m = np.linalg.norm(found.keypoints_m - viewpoint.optical(posed.keypoints), axis=1)
            sure = found.keypoint_chances is not None and bool(
                (found.keypoint_chances[HANDS] <= UNCERTAIN_FROM).all()
            )
            is_near = latest[0][1] <= point_doubt.FAR_M
            rows.append((latest[0][0], bool((off_m[HANDS] > FAR_M).any()), sure and is_near))
    features, is_wrong, are_sure = zip(*rows, strict=True) if rows else ((), (), ())
    width = len(point_doubt.FEATURES)
    return Frames(
        np.array(features, np.float64).reshape(-1, width),
        np.array(is_wrong, bool),
        np.array(are_sure, bool),
    )


def together(frames: list[Frames]) -> Frames:
    """Return the images of all people."""
    return Frames(*(np.concatenate(one) for one in zip(*frames, strict=True)))


def shares(frames: Frames, found: FloatArray, threshold: float) -> tuple[float, float]:
    """Return the shares of images that are certain, and certain although a hand is off."""
    certain = frames.are_sure & (found <= threshold)
    return float(certain.mean()), float((certain & frames.is_wrong).mean())


def report(fit: Frames, check: Frames | None, inverse_penalty: float = INVERSE_PENALTY) -> str:
    """Return coefficients, and shares by threshold.

    Raises:
        ValueError: all images are right, or all wrong.
    """
    shipped = np.array([point_doubt.INTERCEPT, *point_doubt.COEFFICIENTS])
    own = fitted(fit.features, fit.is_wrong, np.ones(len(fit.is_wrong)), inverse_penalty)
    lines = [f"{'':20} {'fitted':>8} {'shipped':>8}"]
    for name, *pair in zip(("intercept", *point_doubt.FEATURES), own, shipped, strict=True):
        lines.append(f"{name:20} {pair[0]:8.2f} {pair[1]:8.2f}")
    for name, frames in (("fitted to", fit), ("not fitted", check)):
        if frames is None:
            continue
        count, wrong = len(frames.is_wrong), 100.0 * frames.is_wrong.mean()
        lines.append(f"\n{name}: {count} images, a hand off in {wrong:.1f} %")
        lines.append(f"{'certain up to':20} {'kept, %':>8} {'wrong, %':>8}")
        for threshold in THRESHOLDS:
            kept, off = shares(frames, chances(own, frames.features), threshold)
            lines.append(f"{threshold:<20} {100.0 * kept:8.1f} {100.0 * off:8.2f}")
    return "\n".join(lines)


def main(args: list[str] | None = None) -> int:
    """Simulate, fit and print; the package's coefficients stay as they are."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    for family in FAMILIES:
        parser.add_argument(f"--{family}", type=Path, help="folder of this family of bodies")
    parser.add_argument("--people", type=int, default=28, help="to fit to (default: 28)")
    parser.add_argument("--check", type=int, default=0, help="further people (default: 0)")
    given = parser.parse_args(args)
    families = {name: path for name in FAMILIES if (path := getattr(given, name)) is not None}
    if not families:
        parser.error(f"give a folder of bodies: {' or '.join(f'--{name}' for name in FAMILIES)}")
    people = [frames_of(number, families) for number in range(given.people + given.check)]
    rest = people[given.people :]
    try:
        print(report(together(people[: given.people]), together(rest) if rest else None))
    except ValueError as error:
        raise CardboxError(f"no fit: {error}; simulate more people") from None
    return 0


if __name__ == "__main__":
    sys.exit(run(main))
