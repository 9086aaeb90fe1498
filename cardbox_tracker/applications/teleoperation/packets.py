"""The bytes in which peers read a full body: JSON, SONIC's protocol v3, Isaac's msgpack."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from cardbox_tracker.applications.teleoperation.full_body import NAMES, FullBody
from cardbox_tracker.applications.teleoperation.sending import line, optional
from cardbox_tracker.person.skeleton import rotation_z

_HEADER_BYTES, _ROBOT_JOINTS = 1280, 29
# The first of the six wrist joints of SONIC's robot: roll, pitch, yaw, each left before right.
_WRISTS = 23
_FEET = [NAMES.index(f"{side}_foot") for side in ("left", "right")]
# OpenXR has X to the right, Y up and Z backwards.
_TO_OPENXR = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]])


def json_packet(body: FullBody, _: int) -> bytes:
    """Return a line of JSON: places (m), quaternions (w first) and validity of the joints."""
    content = {
        "stamp_ns": body.stamp_ns,
        "yaw_rad": round(body.yaw_rad, 6),
        "names": NAMES,
        "positions": body.points_m.round(5).tolist(),
        "orientations": body.turns.round(6).tolist(),
        "valid": body.valid.tolist(),
    }
    return line(content)


def sonic_packet(body: FullBody, number: int) -> bytes:
    """Return a frame of SONIC's protocol v3; ``number`` has to rise from frame to frame."""
    joints = np.zeros((1, _ROBOT_JOINTS), "<f4")
    joints[0, _WRISTS : _WRISTS + 6] = body.wrists_rad.T.ravel()
    half = body.yaw_rad / 2
    fields = {
        "smpl_joints": body.points_m[None].astype("<f4"),
        "smpl_pose": np.zeros((1, 21, 3), "<f4"),
        "joint_pos": joints,
        "joint_vel": np.zeros_like(joints),
        "body_quat": np.array([[np.cos(half), 0.0, 0.0, np.sin(half)]], "<f4"),
        "frame_index": np.array([number], "<i8"),
    }
    table = [
        {"name": name, "dtype": f"{one.dtype.kind}{8 * one.itemsize}", "shape": list(one.shape)}
        for name, one in fields.items()
    ]
    header = line({"v": 3, "endian": "le", "count": 1, "fields": table}).rstrip()
    data = b"".join(one.tobytes() for one in fields.values())
    return b"pose" + header.ljust(_HEADER_BYTES, b"\0") + data


def isaac_packet(body: FullBody, _: int) -> bytes:
    """Return the msgpack of Isaac Teleop's full body, in OpenXR's axes, the feet on the floor.

    Raises:
        CardboxError: msgpack is not installed.
    """
    points_m = body.points_m @ rotation_z(np.array(body.yaw_rad)).T @ _TO_OPENXR.T
    points_m[:, 1] -= points_m[_FEET, 1].min()
    turned = Rotation.from_rotvec([0.0, 0.0, body.yaw_rad]) * Rotation.from_quat(
        body.turns[:, [1, 2, 3, 0]]
    )
    x, y, z, w = turned.as_quat().T
    content = {
        "timestamp": body.stamp_ns,
        "joint_names": NAMES,
        "joint_positions": points_m.tolist(),
        "joint_orientations": np.stack([-y, z, -x, w], axis=1).tolist(),
        "joint_valid": body.valid.tolist(),
    }
    packed: bytes = optional("msgpack").packb(content)
    return packed


PACKETS: dict[str, Callable[[FullBody, int], bytes]] = {
    "sonic": sonic_packet,
    "isaac": isaac_packet,
    "json": json_packet,
}
"""Makers of packets by the name of the peer."""


def packet(to: str, body: FullBody | None, number: int) -> bytes | None:
    """Return the packet of a body; None where the peer has to stay, as it cannot read validity."""
    if body is None or (to != "json" and not body.valid.any()):
        return None
    return PACKETS[to](body, number)
