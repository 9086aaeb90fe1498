"""Situations that the tracker is not made for, and what its states say about them.

python -m learning.situations [--rocketbox FOLDER] [--makehuman FOLDER] --output FILE.md

Simulated people who gesture are measured before a level camera, then one thing goes wrong. The
table has the error, the state and the deviations; silhouettes are perfect but for the situation.
"""

from __future__ import annotations

import argparse
import itertools
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.errors import CardboxError
from cardbox_tracker.estimation.config import PRESETS
from cardbox_tracker.estimation.estimate import TRACKING, UNCERTAIN
from cardbox_tracker.estimation.filtering.correction import FAR_M
from cardbox_tracker.estimation.filtering.keypoint_states import HANDS
from cardbox_tracker.estimation.initialization.config import InitializationConfig
from cardbox_tracker.estimation.initialization.measure import initialize_body
from cardbox_tracker.estimation.initialization.part_colors import LEARNED_FROM
from cardbox_tracker.estimation.observation import Observation
from cardbox_tracker.estimation.tracker import Tracker
from cardbox_tracker.evaluation.metrics import beside_shoulders
from cardbox_tracker.files import atomic_path
from cardbox_tracker.vision.camera import Camera
from learning.bodies import FAMILIES, RiggedBody, draw
from learning.bodies.rigged import Posed
from learning.command_line import run
from learning.motions.gestures import gestures
from learning.motions.reference import Pose, poses, reference_pose
from learning.motions.rotations import about_axis
from learning.recording import simulated_points
from learning.rendering import Rendering, render
from learning.room import Room, Viewpoint
from learning.simulated_points import SimulatedDetector

FloatArray = NDArray[np.float64]
Silhouette = NDArray[np.uint8]

SEED, FPS, SECONDS = 29, 15.0, 20.0
_REFERENCE_IMAGES = 5
STANDING_S = 2.0
"""Time before the situation begins, s."""
CAMERA = Camera(320, 240, 290.0, 290.0, 159.5, 119.5)
PLACE_M = np.array([2.3, 0.0, 1.2])
"""Optical centre in the world of a person who stands at the origin."""
VIEWPOINT = Viewpoint(CAMERA, PLACE_M)
_UNTURNED = np.eye(3)
_LIGHT = np.array([0.0, -0.6, -0.8])


def unchanged(silhouette: Silhouette) -> Silhouette:
    """Return the silhouette."""
    return silhouette


@dataclass(frozen=True)
class Situation:
    """One thing that goes wrong.

    Attributes:
        name: in the table.
        turned: rotation (3, 3) of the person in the world about the hips.
        moved_m: translation (3,) of the person, forward is towards the camera.
        told: camera that the tracker is told, for measurement and tracking.
        size: size of the person of whom the body was measured, relative to this one.
        changed: changes each silhouette.
        other_m: path (2, 3) of a second person, from the first image to the last; None for nobody.
        has_points: whether the tracker also gets the points of a simulated detector.
        has_images: whether it also gets images, from which the person's colours are learned.
        turning_s: time in which the person turns after standing, s; 0 for at once.
    """

    name: str
    turned: FloatArray = field(default_factory=lambda: _UNTURNED)
    moved_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    told: Camera = CAMERA
    size: float = 1.0
    changed: Callable[[Silhouette], Silhouette] = unchanged
    other_m: FloatArray | None = None
    has_points: bool = False
    has_images: bool = False
    turning_s: float = 0.0

    def turned_after(self, seconds: float) -> FloatArray:
        """Return the rotation (3, 3) of the person some time after the situation began."""
        if seconds >= self.turning_s:
            return self.turned
        share = seconds / self.turning_s
        return cv2.Rodrigues(share * cv2.Rodrigues(self.turned)[0])[0].astype(np.float64)


def shifted(silhouette: Silhouette, columns: int) -> Silhouette:
    """Return the silhouette of a camera that was turned aside by a number of pixels."""
    return np.roll(silhouette, columns, axis=1)


def mirrored(silhouette: Silhouette) -> Silhouette:
    """Return the silhouette of a camera that mirrors its images."""
    return silhouette[:, ::-1]


def with_coat_stand(silhouette: Silhouette) -> Silhouette:
    """Return the silhouette with a coat stand that touches the person's side."""
    result = silhouette.copy()
    cv2.rectangle(result, (205, 60), (211, 239), 255, -1)
    cv2.ellipse(result, (208, 85), (22, 40), 0, 0, 360, 255, -1)
    return result


def with_chair(silhouette: Silhouette) -> Silhouette:
    """Return the silhouette with the back of a chair before the person's hips."""
    result = silhouette.copy()
    cv2.rectangle(result, (110, 165), (200, 239), 255, -1)
    return result


_BACK = about_axis(2, np.array([np.pi]))[0]
_TURNING_S = 1.2
_LYING = about_axis(0, np.array([np.pi / 2]))[0]
_TWO_DEGREES_PX = round(290.0 * np.tan(np.radians(2.0)))
SITUATIONS = (
    Situation("none"),
    Situation("back to the camera", turned=_BACK),
    Situation("none, with images", has_images=True),
    Situation("back to the camera, with images", turned=_BACK, has_images=True),
    Situation("turns round, with images", turned=_BACK, has_images=True, turning_s=_TURNING_S),
    Situation("none, with points", has_points=True),
    Situation("back to the camera, with points", turned=_BACK, has_points=True),
    Situation("lying on the side", turned=_LYING, moved_m=(0.0, 0.0, 0.2)),
    Situation("head alone in view", moved_m=(0.0, 0.0, -1.15)),
    Situation("hips below the image", moved_m=(0.0, 0.0, -0.6)),
    Situation("0.8 m from the camera", moved_m=(1.5, 0.0, 0.0)),
    Situation("5 m from the camera", moved_m=(-2.7, 0.0, 0.0)),
    Situation("second person beside", other_m=np.array([[0.0, 0.75, 0.0]] * 2)),
    Situation("second person crosses", other_m=np.array([[0.5, -2.0, 0.0], [0.5, 2.0, 0.0]])),
    Situation("coat stand as foreground", changed=with_coat_stand),
    Situation("chair as foreground", changed=with_chair),
    Situation("body of somebody 25 % smaller", size=0.75),
    Situation("camera bumped by 3 px", changed=partial(shifted, columns=3)),
    Situation("camera turned by 2 degrees", changed=partial(shifted, columns=_TWO_DEGREES_PX)),
    Situation("mirrored image", changed=mirrored),
    Situation("focal length told 20 % too long", told=replace(CAMERA, fx=348.0, fy=348.0)),
    Situation("pitch told 15 degrees wrong", told=CAMERA.with_pitch(float(np.radians(15.0)))),
)


class Row(NamedTuple):
    """Figures of the images after the situation began; shares in %, errors in cm."""

    absolute: float
    aligned: float
    tracking: float
    uncertain: float
    far: float
    hand_far: float
    deviation_deg: float


def rendered(
    body: RiggedBody,
    pose: Pose,
    turned: FloatArray = _UNTURNED,
    moved_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> tuple[Rendering, Posed]:
    """Return the person's image, and the person in the world."""
    posed = body.posed(*pose)
    move_m = posed.hips + np.array(moved_m)
    there = Posed(*(np.asarray((one - posed.hips) @ turned.T + move_m) for one in posed))
    optical_m = VIEWPOINT.optical(there.vertices)
    return render(optical_m, body.faces, body.colours, CAMERA, _LIGHT), there


def silhouette_of(rendering: Rendering) -> Silhouette:
    """Return the silhouette (H, W) of an image."""
    return 255 * rendering.silhouette.astype(np.uint8)


def measured(body: RiggedBody, told: Camera, seed: int, room: Room | None = None) -> BodyModel:
    """Return the body measured before ``CAMERA`` by somebody who believes in ``told``.

    Colours are learned from images of ``room``; None for a body without colours.
    """
    shown = {name: rendered(body, reference_pose(name))[0] for name in ("front", "side", "arms")}
    references = {name: silhouette_of(one) for name, one in shown.items()}
    images = None
    if room is not None:
        images = {
            name: [room.image(shown[name]) for _ in range(_REFERENCE_IMAGES)]
            for name in LEARNED_FROM
        }
    config = InitializationConfig(
        distance_m=float(PLACE_M[0]),
        camera_pitch_rad=told.pitch_rad,
        check_postures=False,
        seed=seed,
    )
    return initialize_body(references, told, config, images=images).body


def measurable(family: str, folders: Mapping[str, Path], count: int) -> list[RiggedBody]:
    """Return people of a family who can be measured; wide clothes can make that impossible."""
    found: list[RiggedBody] = []
    for number in itertools.count():
        body = draw(np.random.default_rng((SEED, number)), [family], folders)
        with suppress(CardboxError):
            measured(body, CAMERA, number)
            found.append(body)
        if len(found) == count:
            break
    return found


def scaled(body: BodyModel, size: float) -> BodyModel:
    """Return the body of somebody of another size at the same place."""
    return replace(body, person=replace(body.person, sizes=size * body.sizes))


def tracked(situation: Situation, people: Sequence[RiggedBody]) -> Row:
    """Track all people in a situation."""
    off_m, states, deviations = [], [], []
    for seed, body in enumerate(people):
        motion = gestures("", SECONDS, np.random.default_rng((SEED, seed))).resampled(FPS)
        room = Room(CAMERA, np.random.default_rng((SEED, seed))) if situation.has_images else None
        person = scaled(measured(body, situation.told, seed, room), situation.size)
        tracker = Tracker(person, situation.told, PRESETS["default"](), np.random.default_rng(seed))
        other = people[(seed + 1) % len(people)]
        standing = [reference_pose("front")] * round(STANDING_S * FPS)
        every = [*standing, *poses(motion)]
        detector = SimulatedDetector(CAMERA, FPS, np.random.default_rng((SEED, seed)))
        for number, pose in enumerate(every):
            is_standing = number < len(standing)
            turned = situation.turned_after(max(number - len(standing), 0) / FPS)
            placed = () if is_standing else (turned, situation.moved_m)
            rendering, posed = rendered(body, pose, *placed)
            silhouette = silhouette_of(rendering)
            if situation.other_m is not None and not is_standing:
                share = (number - len(standing)) / len(motion)
                path_m = situation.other_m[0] + share * np.diff(situation.other_m, axis=0)[0]
                second, _ = rendered(other, reference_pose("front"), moved_m=path_m)
                silhouette = np.maximum(silhouette, silhouette_of(second))
            if not is_standing:
                silhouette = np.ascontiguousarray(situation.changed(silhouette))
            points = None
            if situation.has_points:
                turns = pose[0] if is_standing else turned @ pose[0]
                points = simulated_points(VIEWPOINT, posed, turns, rendering, detector)
            stamp_ns = round(number * 1e9 / FPS)
            image = None if room is None else room.image(rendering)
            seen = Observation(silhouette, image, stamp_ns=stamp_ns, points=points)
            found = tracker.track(seen)
            if is_standing:
                continue
            true_m = VIEWPOINT.optical(posed.keypoints)
            states.append(found.state)
            if found.keypoints_m is None or found.posture_stddev is None:
                off_m.append(np.full((6, 3), np.nan))
                deviations.append(np.nan)
                continue
            off_m.append(found.keypoints_m - true_m)
            deviations.append(float(np.degrees(found.posture_stddev[1:]).mean()))
    return _row(np.array(off_m), np.array(states), np.array(deviations))


def _row(off_m: FloatArray, states: NDArray[np.str_], deviations_deg: FloatArray) -> Row:
    distances_m = np.linalg.norm(off_m, axis=2)
    aligned_m = np.linalg.norm(beside_shoulders(off_m), axis=2)
    is_tracking = states == TRACKING

    def percent(which: NDArray[np.bool_]) -> float:
        return 100.0 * float(which.mean())

    has = np.isfinite(distances_m).all(axis=1)
    absolute, aligned = (
        100.0 * float(one[has].mean()) if has.any() else np.nan for one in (distances_m, aligned_m)
    )
    far = distances_m.mean(axis=1) > FAR_M
    hand_far = (distances_m[:, HANDS] > FAR_M).any(axis=1)
    return Row(
        absolute,
        aligned,
        percent(is_tracking),
        percent(states == UNCERTAIN),
        percent(is_tracking & far),
        percent(is_tracking & hand_far),
        float(deviations_deg[has].mean()) if has.any() else np.nan,
    )


_TEXT = """\
# Situations that the tracker is not made for

Simulated people ({people}) gesture for {seconds:.0f} s, {fps:.0f} images a second, after they were
measured 2.3 m before a level camera; then one thing goes wrong. Silhouettes are perfect otherwise.
Errors are in cm, absolute and after both skeletons are shifted to the middle of their shoulders;
shares are of all images: those with the state `tracking` or `uncertain`, and those with `tracking`
although the mean error, or a hand's, is beyond 30 cm. Deviations are means over the angles, deg.
With points, the tracker also gets those of a simulated detector. An outline does not show whether
a person's back is seen; points do, as left and right stay exchanged, and so does hair in images
([figures](../research/deviations-and-loss.md#the-back-of-a-person)).
Made by `python -m learning.situations`, see [learning](../research/learning.md).

| situation | absolute | aligned | `tracking` | `uncertain` | mean far | hand far | deviation |
|---|---|---|---|---|---|---|---|
"""


def main(args: list[str] | None = None) -> int:
    """Track all situations and write the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    for family in FAMILIES:
        parser.add_argument(f"--{family}", type=Path, help="folder of this family of bodies")
    parser.add_argument("--people", type=int, default=2, help="of each family (default: 2)")
    parser.add_argument("--only", nargs="*", help="names of situations")
    parser.add_argument("--output", type=Path)
    given = parser.parse_args(args)
    folders = {name: path for name in FAMILIES if (path := getattr(given, name)) is not None}
    if not folders:
        parser.error(f"give a folder of bodies: {' or '.join(f'--{name}' for name in FAMILIES)}")
    people = [one for family in folders for one in measurable(family, folders, given.people)]
    lines = []
    for situation in SITUATIONS:
        if given.only and situation.name not in given.only:
            continue
        row = tracked(situation, people)
        cells = "{:.0f} | {:.0f} | {:.0f} | {:.0f} | {:.1f} | {:.1f} | {:.0f}".format(*row)
        lines.append(f"| {situation.name} | {cells} |")
        print(lines[-1], flush=True)
    if given.output:
        names = ", ".join(one.name for one in people)
        text = _TEXT.format(people=names, seconds=SECONDS, fps=FPS)
        with atomic_path(given.output) as temporary:
            temporary.write_text(text + "\n".join(lines) + "\n", encoding="utf-8")
        print(f"written: {given.output}")
    return 0


if __name__ == "__main__":
    sys.exit(run(main))
