"""Coordinates of a tracked motion as OpenSim's MOT or STO, in the names of its models with arms.

The models' axes are X forwards, Y up, Z to the right; a left limb is the mirror image of a right
one. The pelvis stays level. Where legs are measured, it turns with the trunk; otherwise it faces
the camera, so that the lumbar joint has all of the trunk's rotation. The elbow's axis is taken as
Z; the models lean it by 13 degrees.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from cardbox_tracker.applications.exporting.motion import Motion, floor_below, frames_of, held
from cardbox_tracker.common.errors import in_cell
from cardbox_tracker.common.files import atomic_path
from cardbox_tracker.common.rates import carried
from cardbox_tracker.person.isb_angles import LABORATORY, LEAST_BENT_RAD, thorax_angles
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import LEFT_ARM, RIGHT_ARM, YAW
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import (
    POSTURE_GROUPS,
    Group,
    arm_directions,
    rotation_x,
    rotation_z,
    rows_of,
)

LUMBAR = ("lumbar_extension", "lumbar_bending", "lumbar_rotation")
"""Rotations about Z, X' and Y''."""
ARM = ("arm_flex", "arm_add", "arm_rot", "elbow_flex")
"""Rotations of the upper arm about Z, X' and Y'', then of the forearm about Z."""
PELVIS = ("pelvis_tx", "pelvis_ty", "pelvis_tz")
"""Place of the middle of the hips, m, above the floor if it is known, else above the camera."""
LEG = ("hip_flexion", "hip_adduction", "hip_rotation", "knee_angle")
"""Rotations of the thigh about Z, X' and Y'', then of the shank: those of our legs, whose second
one is an abduction."""
HAND = ("wrist_flex", "wrist_dev", "pro_sup")
"""Rotations of the hand to the palm and to the little finger, and of the forearm, whose 0 is full
supination: 90 degrees from ours."""

_STORAGE = "DataType=double", "version=3"


def coordinates_of(states: FloatArray) -> dict[str, FloatArray]:
    """Return rotations, (n,), rad, by the coordinates' names; states are (n, 14) without gaps."""
    found = dict(zip(LUMBAR, thorax_angles(states).T, strict=True))
    for suffix, arm, side in (("r", RIGHT_ARM, -1.0), ("l", LEFT_ARM, 1.0)):
        directions = arm_directions(states[:, arm], side)
        angles = _arm_angles(*(one @ LABORATORY.T * (1.0, 1.0, -side) for one in directions))
        found |= {f"{name}_{suffix}": angles[:, i] for i, name in enumerate(ARM)}
    return found


def _limbs(motion: Motion) -> dict[str, FloatArray]:
    """Return rotations (n,), rad, of legs and hands; unknown ones stay, or rest at first."""
    found: dict[str, FloatArray] = {}
    rest = 0.0, 0.0, np.pi / 2
    for number, side in enumerate(("left", "right")):
        suffix = side[0]
        if motion.has_legs:
            angles = held(motion.values_of(Group.LEG, side=side)) * (1.0, -1.0, 1.0, 1.0)
            found |= {f"{name}_{suffix}": angles[:, i] for i, name in enumerate(LEG)}
        if motion.has_hands:
            angles = np.hstack([held(motion.wrists[:, number, i, None]) for i in range(3)]) + rest
            found |= {f"{name}_{suffix}": angles[:, i] for i, name in enumerate(HAND)}
    return found


def _arm_angles(upper: FloatArray, lower: FloatArray) -> FloatArray:
    """Return the angles of ``ARM``, (n, 4), of a right arm's unit vectors (n, 3) in the trunk.

    A straight elbow does not show the rotation of the upper arm, which then stays as it was.
    """
    flexion = np.arctan2(upper[:, 0], -upper[:, 1])
    adduction = np.arcsin(np.clip(-upper[:, 2], -1.0, 1.0))
    local = np.einsum("nij,njk,nk->ni", rotation_x(-adduction), rotation_z(-flexion), lower)
    bend = np.arctan2(np.hypot(local[:, 0], local[:, 2]), -local[:, 1])
    is_known = bend >= LEAST_BENT_RAD
    last = np.maximum.accumulate(np.where(is_known, np.arange(len(bend)), -1))
    turned = np.arctan2(-local[:, 2], local[:, 0])
    rotation = np.where(
        last < 0, turned[np.argmax(is_known)] if is_known.any() else 0, turned[last]
    )
    return np.stack([flexion, adduction, rotation, bend], axis=1)


def _columns(motion: Motion, body: BodyModel | None) -> dict[str, FloatArray]:
    """Return rotations, rad, that go on beyond half a turn, and with the body place, m, by name.

    They are those of the images with a posture, (n,) each.
    """
    seen = motion.is_seen
    states, turned = motion.states[seen], {}
    if motion.has_legs:
        turned = dict.fromkeys(("pelvis_tilt", "pelvis_list"), np.zeros(len(states)))
        turned["pelvis_rotation"] = states[:, YAW]
        states = states.copy()
        states[:, YAW] = 0.0
    limbs = {name: of[seen] for name, of in _limbs(motion).items()}
    rotations = coordinates_of(states) | limbs | turned
    columns = {name: np.asarray(np.unwrap(of)) for name, of in rotations.items()}
    if body is not None:
        hips_m = ((frames_of(motion, body).hip - floor_below(body)) @ LABORATORY.T)[seen]
        columns |= dict(zip(PELVIS, hips_m.T, strict=True))
    return columns


def write_mot(path: Path, motion: Motion, body: BodyModel | None) -> None:
    """Write time (s), rotations (deg) and, with the body, place (m) of each image with a posture.

    Rotations go on beyond half a turn, so they do not jump by a whole one.

    Raises CardboxError if the file cannot be written.
    """
    _write_coordinates(path, motion, body, (in_cell(path.stem), "version=1"))


def write_sto(path: Path, motion: Motion, body: BodyModel | None) -> None:
    """Write what :func:`write_mot` writes as OpenSim 4 stores tables of numbers."""
    _write_coordinates(path, motion, body, _STORAGE)


def _write_coordinates(
    path: Path, motion: Motion, body: BodyModel | None, kind: tuple[str, ...]
) -> None:
    columns = {
        name: of if name in PELVIS else np.degrees(of)
        for name, of in _columns(motion, body).items()
    }
    _write(path, motion.time_s[motion.is_seen], columns, kind)


def write_rates(path: Path, motion: Motion, body: BodyModel | None) -> None:
    """Write how fast the coordinates change, with deviations, of each image where that is known.

    Velocities are ``NAME_u`` and ``NAME_u_std``, accelerations ``NAME_dudt`` and ``NAME_dudt_std``,
    in degrees, m and s; nan for legs that are hidden. Hands have none. Raises CardboxError if the
    file cannot be written.
    """
    rates = motion.rates().reshape(len(motion.state), -1, 4)
    posture = rows_of(*POSTURE_GROUPS, Group.PLACE)
    is_known = np.isfinite(rates[:, posture]).all(axis=(1, 2))
    motion = motion.without(np.asarray(~is_known))
    seen, without = motion.is_seen, replace(motion, palms=np.full_like(motion.palms, np.nan))
    rows = np.concatenate([posture, rows_of(Group.LEG)[: None if motion.has_legs else 0]])
    names = [*_columns(without, body)]
    are_angles = np.array([name not in PELVIS for name in names])

    def coordinates(values: FloatArray) -> FloatArray:
        joints = motion.joints.copy()
        joints[np.ix_(seen, rows)] = values
        return np.column_stack([*_columns(replace(without, joints=joints), body).values()])

    moving = rates[seen][:, rows].transpose(2, 0, 1)
    found = carried(coordinates, motion.joints[np.ix_(seen, rows)], moving, are_angles)
    # Legs that an image does not show have the angles of another one, but no deviations.
    found[:, np.isnan(found[1])] = np.nan
    found[..., are_angles] = np.degrees(found[..., are_angles])
    kinds = "u", "u_std", "dudt", "dudt_std"
    columns = {
        f"{name}_{kind}": found[number, :, column]
        for column, name in enumerate(names)
        for number, kind in enumerate(kinds)
    }
    _write(path, motion.time_s[seen], columns, _STORAGE)


def _write(
    path: Path, time_s: FloatArray, columns: Mapping[str, FloatArray], kind: tuple[str, ...]
) -> None:
    rows = np.column_stack([time_s, *columns.values()])
    header = (
        *kind,
        f"nRows={len(rows)}",
        f"nColumns={rows.shape[1]}",
        "inDegrees=yes",
        "endheader",
        "\t".join(("time", *columns)),
    )
    with atomic_path(path) as temporary, temporary.open("w", encoding="utf-8") as file:
        file.writelines(f"{line}\n" for line in header)
        file.writelines("\t".join(f"{value:.6f}" for value in row) + "\n" for row in rows)
