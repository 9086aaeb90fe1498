#!/usr/bin/env python3
"""Make the learned pose prior of the arms from free motion capture.

    python -m lab.fits.pose_prior FOLDER...
        --output cardbox_tracker/terms/pose_prior.json
        [--exclude NAME...] [--components 16] [--seed 0]

FOLDER holds ``.bvh`` files (searched recursively) of B. Hahne's 2010 conversion of the CMU Graphics
Lab Motion Capture Database (cgspeed; github.com/AtelierCircle/CMU-MoCap-10-14), or ``.txt`` files
of 99 or more comma-separated numbers a line, root position and exponential maps of the same
conversion (github.com/chaneyddtt/Convolutional-Sequence-to-Sequence-Model-for-Human-Dynamics,
``data/cmu_mocap``). The first frame of either is a T-pose.

The data used in this project was obtained from mocap.cs.cmu.edu. The database was created with
funding from NSF EIA-0196217. "CMU places no restrictions on the use of the original dataset, and I
(Bruce) place no additional restrictions on the use of this particular BVH conversion."

The prior is a mixture of Gaussians over six numbers of an arm: the unit vectors of upper arm and
forearm in the frame of the torso (x forward out of the chest; y outwards, to the left for the left
arm and to the right for the right one; z up from the hips to the middle of the shoulders).

Kinds of motion are weighted, independently of the number and length of their clips: gestures before
a camera count more than sports. Frequent postures, such as hanging arms, count less. Plain frontal
postures, which people take when asked to, are added. The same input and seed give the same bytes.
"""

from __future__ import annotations

import argparse
import json
import re
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# The recorded sessions, which measure the tracker, contain excerpts of these clips. In 13_18
# (boxing) the conversion bends the elbows backwards.
USED_IN_SESSIONS = (
    "13_07", "13_08", "13_09", "14_05", "13_31", "13_15", "14_17", "14_12", "washwindow_1",
    "basketball_signal_1", "basketball_signal_2", "basketball_signal_4", "basketball_signal_5",
    "directing_traffic_4",
)  # fmt: skip
BROKEN = ("13_18",)

# Patterns of the clips of each kind of motion; all further clips are "other".
KINDS = {
    "soccer": r"10_0[12356]|11_01|soccer_\d+",
    "walk": r"10_04|12_0[123]|walking_\d+",
    "tai chi": r"12_04",
    "sit": r"13_0[1-6]|14_(27|28|29|30|31|32|36)",
    "drink": r"13_0[789]|14_0[45]|14_37",
    "reach up": r"13_1[02]|14_0[789]",
    "jump": r"13_(11|13|19|32|39|40|41|42)|jumping_\d+",
    "laugh": r"13_1[456]|14_1[789]",
    "box": r"13_1[78]|14_0[123]",
    "wash windows": r"13_2[012]|14_1[012]|washwindow_\d+",
    "sweep": r"13_2[345]|14_1[356]",
    "direct traffic": r"13_2[678]|14_2[456]|directing_traffic_\d+",
    "exercise": r"13_29|13_3[01]|14_06|14_14|14_20",
    "climb": r"13_3[3-8]|14_2[123]|14_3[345]",
    "basketball": r"basketball_\d+",
    "signals": r"basketball_signal_\d+",
    "run": r"running_\d+",
}
WEIGHTS = {
    "soccer": 0.3, "walk": 0.5, "run": 0.2, "jump": 0.4, "climb": 0.3, "basketball": 0.4,
    "sit": 0.7,
}  # fmt: skip
SAMPLES_PER_S = 5.0
STANDING = ("drink", "laugh", "wash windows", "direct traffic", "exercise", "signals")
# Settings of `flatten` and `plain_arms`, chosen by which of the depths the prior prefers.
NEIGHBOURS, FLATTEN = 40, 3.0
PLAIN_SAMPLES = 3000
VARIANCE = 0.02
SOURCE = (
    "CMU Graphics Lab Motion Capture Database, mocap.cs.cmu.edu, created with funding from NSF "
    "EIA-0196217; BVH conversion by B. Hahne (cgspeed.com); see lab/fits/pose_prior.py"
)

JOINTS = {
    "left_hip": ("LeftUpLeg", "lThigh"),
    "right_hip": ("RightUpLeg", "rThigh"),
    "left_shoulder": ("LeftArm", "lShldr"),
    "right_shoulder": ("RightArm", "rShldr"),
    "left_elbow": ("LeftForeArm", "lForeArm"),
    "right_elbow": ("RightForeArm", "rForeArm"),
    "left_wrist": ("LeftHand", "lHand"),
    "right_wrist": ("RightHand", "rHand"),
}
# The skeleton of the text files: names, parents and the relevant offsets in its own units.
TEXT_NAMES = (  # noqa: SIM905
    "Hips LHipJoint LeftUpLeg LeftLeg LeftFoot LeftToeBase LeftToeEnd RHipJoint RightUpLeg "
    "RightLeg RightFoot RightToeBase RightToeEnd LowerBack Spine Spine1 Neck Neck1 Head HeadEnd "
    "LeftShoulder LeftArm LeftForeArm LeftHand LeftFingerBase LFingers LFingersEnd LThumb "
    "LThumbEnd RightShoulder RightArm RightForeArm RightHand RightFingerBase RFingers "
    "RFingersEnd RThumb RThumbEnd"
).split()
TEXT_PARENTS = (
    -1, 0, 1, 2, 3, 4, 5, 0, 7, 8, 9, 10, 11, 0, 13, 14, 15, 16, 17, 18, 15, 20, 21, 22, 23, 24,
    25, 23, 27, 15, 29, 30, 31, 32, 33, 34, 32, 36,
)  # fmt: skip
TEXT_OFFSETS = {
    "LeftUpLeg": (1.65674, -1.80282, 0.62477), "RightUpLeg": (-1.6107, -1.80282, 0.62476),
    "Spine": (0.01961, 2.0545, -0.14112), "Spine1": (0.01021, 2.06436, -0.05921),
    "LeftArm": (3.54205, 0.90436, -0.17364), "RightArm": (-3.49802, 0.75994, -0.32616),
    "LeftForeArm": (4.86513, 0, 0), "RightForeArm": (-5.02649, 0, 0),
    "LeftHand": (3.35554, 0, 0), "RightHand": (-3.36431, 0, 0),
}  # fmt: skip
TEXT_STEP_S = 1.0 / 120.0


# --- reading ------------------------------------------------------------------------------------


def read_bvh(path: Path) -> tuple[dict[str, FloatArray], float]:
    """Return positions (frames, 3) of the joints by role, y up, and the time of a frame, s."""
    names: list[str] = []
    parents: list[int] = []
    offsets: list[list[float]] = []
    channels: list[list[str]] = []
    open_joints: list[int] = []
    in_end = False
    lines = path.read_text().splitlines()
    motion = next(i for i, line in enumerate(lines) if line.startswith("MOTION"))
    for words in (line.split() for line in lines[:motion] if line.strip()):
        if words[0] in ("ROOT", "JOINT"):
            parents.append(open_joints[-1] if open_joints else -1)
            open_joints.append(len(names))
            names.append(words[1])
        elif words[0] == "End":
            in_end = True
        elif words[0] == "OFFSET" and not in_end:
            offsets.append([float(word) for word in words[1:4]])
        elif words[0] == "CHANNELS":
            channels.append(words[2:])
        elif words[0] == "}":
            if in_end:
                in_end = False
            else:
                open_joints.pop()
    step_s = float(lines[motion + 2].split()[2])
    rows = [line for line in lines[motion + 3 :] if line.strip()]
    frames = np.array([[float(word) for word in row.split()] for row in rows])
    columns = np.cumsum([0, *(len(c) for c in channels)])
    rotations, root = [], np.zeros((len(frames), 3))
    for joint, of_joint in enumerate(channels):
        turn = np.tile(np.eye(3), (len(frames), 1, 1))
        for column, channel in enumerate(of_joint, columns[joint]):
            axis = "XYZ".index(channel[0])
            if channel.endswith("rotation"):
                turn = turn @ about_axis(axis, np.radians(frames[:, column]))
            elif joint == 0:
                root[:, axis] = frames[:, column]
        rotations.append(turn)
    return positions(names, parents, np.array(offsets), rotations, root), step_s


def read_text(path: Path) -> tuple[dict[str, FloatArray], float]:
    """Read exponential maps; return the same as :func:`read_bvh`."""
    rows = np.loadtxt(path, delimiter=",")
    turns = rows[:, 3 : 3 + 3 * len(TEXT_NAMES)].reshape(len(rows), -1, 3)
    rotations = [about_vector(-turns[:, joint]) for joint in range(turns.shape[1])]
    offsets = np.array([TEXT_OFFSETS.get(name, (0.0, 0.0, 0.0)) for name in TEXT_NAMES])
    return positions(TEXT_NAMES, TEXT_PARENTS, offsets, rotations, rows[:, :3]), TEXT_STEP_S


def positions(
    names: Sequence[str],
    parents: Sequence[int],
    offsets: FloatArray,
    rotations: Sequence[FloatArray],
    root: FloatArray,
) -> dict[str, FloatArray]:
    """Return positions (frames, 3) of the joints in ``JOINTS`` by role."""
    place, turned = [root], [rotations[0]]
    for joint in range(1, len(names)):
        parent = parents[joint]
        place.append(place[parent] + turned[parent] @ offsets[joint])
        turned.append(turned[parent] @ rotations[joint])
    return {
        role: place[next(i for i, name in enumerate(names) if name in known)]
        for role, known in JOINTS.items()
    }


def about_axis(axis: int, angle_rad: FloatArray) -> FloatArray:
    """Return rotations (n, 3, 3) about a coordinate axis."""
    vectors = np.zeros((len(angle_rad), 3))
    vectors[:, axis] = angle_rad
    return about_vector(vectors)


def about_vector(vectors_rad: FloatArray) -> FloatArray:
    """Return rotations (n, 3, 3) by rotation vectors (n, 3)."""
    angle = np.linalg.norm(vectors_rad, axis=1)
    x, y, z = (vectors_rad / np.maximum(angle, 1e-12)[:, None]).T
    zero = np.zeros_like(x)
    cross = np.moveaxis(np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]), 2, 0)
    s, c = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    rotated: FloatArray = np.eye(3) + s * cross + (1 - c) * (cross @ cross)
    return rotated


# --- postures -----------------------------------------------------------------------------------


def unit(vectors: FloatArray) -> FloatArray:
    """Return vectors (..., 3) of length one."""
    result: FloatArray = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return result


def torso_frames(joints: dict[str, FloatArray]) -> FloatArray:
    """Return rotations (frames, 3, 3) with columns forward, left, up; the T-pose is upright.

    The capture's own axes are x to the left, y up and z forward in the T-pose.
    """
    hips = (joints["left_hip"] + joints["right_hip"]) / 2
    up = unit((joints["left_shoulder"] + joints["right_shoulder"]) / 2 - hips)
    left = joints["left_shoulder"] - joints["right_shoulder"]
    forward = unit(np.cross(left, up))
    frames = np.stack([forward, np.cross(up, forward), up], axis=2)
    upright = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    turned: FloatArray = frames @ (frames[0].T @ upright)
    return turned


def arms_of(joints: dict[str, FloatArray]) -> FloatArray:
    """Return unit vectors of both limbs, (frames, 2 arms, 6): forward, outwards, up of each."""
    torso = torso_frames(joints)
    arms = []
    for side, outwards in (("left", 1.0), ("right", -1.0)):
        shoulder, elbow, wrist = (joints[f"{side}_{j}"] for j in ("shoulder", "elbow", "wrist"))
        limbs = [unit(elbow - shoulder), unit(wrist - elbow)]
        inside = [np.einsum("nji,nj->ni", torso, limb) * (1.0, outwards, 1.0) for limb in limbs]
        arms.append(np.concatenate(inside, axis=1))
    return np.stack(arms, axis=1)


def torso_angles_rad(joints: dict[str, FloatArray]) -> FloatArray:
    """Return roll and pitch (frames, 2) of the torso in Rz(yaw) Ry(pitch) Rx(roll)."""
    frames = torso_frames(joints)
    # Row 1 is the upward direction of the world, which does not depend on the yaw.
    pitch = np.arcsin(np.clip(-frames[:, 1, 0], -1, 1))
    roll = np.arctan2(frames[:, 1, 1], frames[:, 1, 2])
    return np.stack([roll, pitch], axis=1)


def kind_of(clip: str) -> str:
    """Return the kind of motion of a clip by its name."""
    for kind, pattern in KINDS.items():
        if re.fullmatch(pattern, clip):
            return kind
    return "other"


# --- mixture ------------------------------------------------------------------------------------


def fit_mixture(
    x: FloatArray, weights: FloatArray, components: int, seed: int, floor: float, rounds: int = 200
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Fit a mixture by weighted EM: shares (K,), means (K, D), covariances (K, D, D).

    Args:
        x: samples (N, D).
        weights: of the samples, (N,), summing to one.
        components: K.
        seed: of the start by k-means++.
        floor: variance that is added to every axis.
        rounds: number of iterations.
    """
    rng = np.random.default_rng(seed)
    n, d = x.shape
    means = x[rng.choice(n, 1, p=weights)]
    for _ in range(1, components):
        far = np.min(np.sum((x[:, None] - means) ** 2, axis=2), axis=1) * weights
        means = np.concatenate([means, x[rng.choice(n, 1, p=far / far.sum())]])
    shares = np.full(components, 1 / components)
    covariances = np.tile(0.1 * np.eye(d), (components, 1, 1))
    for _ in range(rounds):
        logs = log_densities(x, shares, means, covariances)
        top = logs.max(axis=1, keepdims=True)
        belongs = np.exp(logs - top)
        belongs *= (weights / belongs.sum(axis=1))[:, None]
        shares = belongs.sum(axis=0)
        means = belongs.T @ x / shares[:, None]
        for k in range(components):
            away = x - means[k]
            covariances[k] = (belongs[:, k, None] * away).T @ away / shares[k] + floor * np.eye(d)
    return shares, means, covariances


def log_densities(
    x: FloatArray, shares: FloatArray, means: FloatArray, covariances: FloatArray
) -> FloatArray:
    """Return the log of share times density of each component, (N, K)."""
    logs = np.empty((len(x), len(shares)))
    for k, (share, mean, covariance) in enumerate(zip(shares, means, covariances, strict=True)):
        lower = np.linalg.cholesky(covariance)
        scaled = np.linalg.solve(lower, (x - mean).T)
        size = np.log(np.diag(lower)).sum() + 0.5 * x.shape[1] * np.log(2 * np.pi)
        logs[:, k] = np.log(share) - size - 0.5 * np.sum(scaled**2, axis=0)
    return logs


# --- all of it ----------------------------------------------------------------------------------


def load(folders: Sequence[Path], exclude: Sequence[str]) -> dict[str, dict[str, FloatArray]]:
    """Return arms (n, 2, 6) and torso angles (n, 2) of each clip, ``SAMPLES_PER_S`` a second."""
    clips: dict[str, dict[str, FloatArray]] = {}
    seen = set()
    for path in sorted(p for f in folders for p in f.rglob("*") if p.suffix in (".bvh", ".txt")):
        name = path.stem
        if name in exclude or (path.suffix == ".txt" and kind_of(name) == "other"):
            continue
        if path.stat().st_size < 1000:
            continue
        joints, step_s = read_bvh(path) if path.suffix == ".bvh" else read_text(path)
        # Many clips are in both sources; equal kind and number of frames identify a clip.
        if (kind_of(name), len(joints["left_hip"])) in seen:
            continue
        seen.add((kind_of(name), len(joints["left_hip"])))
        stride = max(1, round(1 / (SAMPLES_PER_S * step_s)))
        arms, torso = arms_of(joints)[1::stride], torso_angles_rad(joints)[1::stride]
        key = name if name not in clips else f"{path.parent.parent.name}/{name}"
        clips[key] = {"arms": arms, "torso": torso}
    return clips


def balance(clips: dict[str, dict[str, FloatArray]]) -> tuple[FloatArray, FloatArray]:
    """Return the arms of both sides, (N, 6), and their weights (N,)."""
    of_kind: dict[str, list[str]] = defaultdict(list)
    for name in clips:
        of_kind[kind_of(name.split("/")[-1])].append(name)
    arms, weights = [], []
    for kind, names in sorted(of_kind.items()):
        for name in names:
            x = clips[name]["arms"].reshape(-1, 6)
            arms.append(x)
            weights.append(np.full(len(x), WEIGHTS.get(kind, 1.0) / len(names) / len(x)))
    all_weights = np.concatenate(weights)
    return np.concatenate(arms), all_weights / all_weights.sum()


def plain_arms(count: int, seed: int) -> FloatArray:
    """Return arms (count, 6) beside the body, nearly straight or with the forearm raised.

    People hold them so when they follow instructions, exercise or wave, and motion capture hardly
    contains it. Shoulder abduction is uniform, flexion small; half of the elbows are straight.
    """
    rng = np.random.default_rng(seed)
    straight = rng.random(count) < 0.5
    shoulder = rng.uniform(5, 170, count), rng.normal(4, 8, count)
    aside = np.where(straight, rng.normal(0, 8, count), rng.uniform(-30, 120, count))
    elbow = aside, rng.normal(8, 8, count)
    upper = limb_rotation(*np.radians(shoulder))
    fore = upper @ limb_rotation(*np.radians(elbow))
    return np.concatenate([-upper[:, :, 2], -fore[:, :, 2]], axis=1)


def limb_rotation(abduction_rad: FloatArray, flexion_rad: FloatArray) -> FloatArray:
    """Return Rx(abduction) Ry(-flexion), (n, 3, 3), axes forward, outwards, up of a limb."""
    return about_axis(0, abduction_rad) @ about_axis(1, -flexion_rad)


def flatten(x: FloatArray, weights: FloatArray, neighbours: int, power: float) -> FloatArray:
    """Return weights (N,) that reduce the influence of frequent postures.

    Each weight grows with the distance to a near neighbour, so with a power of the inverse density.
    """
    reach = np.empty(len(x))
    for i in range(0, len(x), 500):
        far = np.sum(x[i : i + 500] ** 2, axis=1)[:, None] + np.sum(x**2, axis=1)
        far = np.sqrt(np.maximum(far - 2 * x[i : i + 500] @ x.T, 0))
        reach[i : i + 500] = np.partition(far, neighbours - 1, axis=1)[:, neighbours - 1]
    flat = weights * (reach + 0.15) ** power
    normalized: FloatArray = flat / flat.sum()
    return normalized


def main() -> None:
    """Read, fit, write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--output", type=Path, required=True)
    parser.add_argument("--exclude", nargs="*", default=[], help="further clips to leave out")
    parser.add_argument("--components", type=int, default=16)
    parser.add_argument("--plain", type=float, default=0.4, help="share of plain postures")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    clips = load(args.folders, (*USED_IN_SESSIONS, *BROKEN, *args.exclude))
    arms, weights = balance(clips)
    plain = plain_arms(PLAIN_SAMPLES, args.seed + 1)
    x = np.concatenate([arms, plain])
    w = np.concatenate([
        (1 - args.plain) * flatten(arms, weights, NEIGHBOURS, FLATTEN),
        np.full(len(plain), args.plain / len(plain)),
    ])  # fmt: skip
    shares, means, covariances = fit_mixture(x, w / w.sum(), args.components, args.seed, VARIANCE)
    at_means = log_densities(means, shares, means, covariances)
    best = np.max(np.log(np.sum(np.exp(at_means), axis=1)))
    result = {
        "source": SOURCE,
        "clips": sorted(clips),
        "torso": torso_statistics(clips),
        # The offset makes the best posture cost about nothing.
        "offset": round(float(best), 4),
        "shares": np.round(shares, 5).tolist(),
        "means": np.round(means, 4).tolist(),
        "covariances": np.round(covariances, 5).tolist(),
    }
    text = json.dumps(result, indent=None, separators=(",", ":"))
    args.output.write_text(text.replace('],"', '],\n"') + "\n")
    hand = arms[:, 0] * 0.28 + arms[:, 3] * 0.33
    print(
        f"{len(clips)} clips, {len(arms)} arms; hand in front of the shoulder plane "
        f"{100 * np.sum(weights * (hand > 0)):.1f} %, elbow "
        f"{100 * np.sum(weights * (arms[:, 0] > 0)):.1f} %; {args.output.stat().st_size} bytes"
    )


def torso_statistics(clips: dict[str, dict[str, FloatArray]]) -> dict[str, list[float]]:
    """Return percentiles 1, 5, 25, 50, 75, 95, 99 of standing people's roll and pitch, deg."""
    standing = [clips[n]["torso"] for n in clips if kind_of(n.split("/")[-1]) in STANDING]
    if not standing:
        return {}
    shown = np.degrees(np.percentile(np.concatenate(standing), (1, 5, 25, 50, 75, 95, 99), axis=0))
    return {
        "roll_deg": np.round(shown[:, 0], 1).tolist(),
        "pitch_deg": np.round(shown[:, 1], 1).tolist(),
    }


if __name__ == "__main__":
    main()
