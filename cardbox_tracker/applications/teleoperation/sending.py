"""Packets of full bodies (JSON, SONIC, Isaac, VMC) and of robots, and how they are sent."""

from __future__ import annotations

import json
import os
import re
import socket
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from typing import Any, TypeVar

import numpy as np
from scipy.spatial.transform import Rotation

from cardbox_tracker.applications.teleoperation.full_body import NAMES, FullBody
from cardbox_tracker.applications.teleoperation.smpl import FEET, local_frames
from cardbox_tracker.common.errors import CardboxError, quoted, reason_of
from cardbox_tracker.common.extensions import optional
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import rotation_z

T = TypeVar("T")
_EXTRA = "this stream needs the extra of pyzmq, msgpack and python-osc", "teleoperation"


def joints_packet(
    stamp_ns: int, names: Sequence[str], positions: FloatArray, lower: FloatArray, upper: FloatArray
) -> bytes:
    """Return a line of JSON: positions and limits (n,) of a robot's joints, rad or m."""
    values = {"positions": positions, "lower": lower, "upper": upper}
    rounded = {name: one.round(6).tolist() for name, one in values.items()}
    return line({"stamp_ns": stamp_ns, "names": names, **rounded})


def line(content: dict[str, Any]) -> bytes:
    """Return a line of JSON; it has no value that is not finite."""
    return json.dumps(content, separators=(",", ":"), allow_nan=False).encode() + b"\n"


def in_real_time(items: Iterable[T], rate_hz: float) -> Iterator[T]:
    """Yield ``items`` at a rate by the clock; one that is late does not delay the others."""
    begun_s = time.monotonic()
    for number, item in enumerate(items):
        time.sleep(max(begun_s + number / rate_hz - time.monotonic(), 0.0))
        yield item


_ADDRESS = re.compile(r"tcp://(?P<host>[^/;]+):(?P<port>\d{1,5})|ipc://(?P<file>[^*].*)")
_UDP = re.compile(r"udp://([^/;:]+):(\d{1,5})")
_LOOPBACK = re.compile(r"localhost|lo|127(\.\d+){3}|\[::1\]")
_EXPECTED = "give an address as tcp://127.0.0.1:5556, whose port is free, or ipc:///tmp/NEW"


class ZmqSender:
    """Publishes packets by ZMQ; who subscribes later misses the first ones.

    Attributes:
        remarks: what the user should know of the address, such as who can read it.
    """

    def __init__(self, address: str) -> None:
        """Listen on ``address``, such as ``tcp://127.0.0.1:5556``, or raise CardboxError."""
        found = _ADDRESS.fullmatch(address)
        if not found or not (found["file"] or 0 < int(found["port"]) < 65536):
            raise CardboxError(f"cannot listen on {quoted(address)}; {_EXPECTED}")
        if found["file"] and os.path.lexists(found["file"]):
            raise CardboxError(
                f"cannot listen on {quoted(address)}: that file exists, and would be deleted; "
                "give another, or remove it"
            )
        self.remarks: list[str] = []
        if found["host"] and not _LOOPBACK.fullmatch(found["host"]):
            self.remarks.append(
                f"whoever reaches {quoted(address)} can read what is sent; tcp://127.0.0.1:"
                f"{found['port']} is for this computer alone"
            )
        zmq = optional("zmq", *_EXTRA)
        self._context = zmq.Context()
        self._socket = self._context.socket(zmq.PUB)
        self._socket.linger = 0
        try:
            self._socket.bind(address)
        except zmq.ZMQError as error:
            self.close()
            raise CardboxError(
                f"cannot listen on {quoted(address)}: {error}; {_EXPECTED}"
            ) from None

    def send(self, packet: bytes) -> None:
        """Publish a packet; this never waits."""
        self._socket.send(packet)

    def close(self) -> None:
        """Free the address."""
        self._socket.close()
        self._context.term()


class UdpSender:
    """Sends packets by UDP, to one program; whether it receives them is not known.

    Attributes:
        remarks: as of :class:`ZmqSender`.
    """

    def __init__(self, address: str) -> None:
        """Send to ``address``, such as ``udp://127.0.0.1:39539``, or raise CardboxError."""
        self.remarks: list[str] = []
        found = _UDP.fullmatch(address)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            if found is None:
                raise ValueError("it is none")
            self._socket.connect((found[1], int(found[2])))
        except (OSError, OverflowError, ValueError) as error:
            self.close()
            raise CardboxError(
                f"cannot send to {quoted(address)}: {reason_of(error)}; give the address of the "
                "program, as udp://127.0.0.1:39539"
            ) from None

    def send(self, packet: bytes) -> None:
        """Send a packet; this never waits."""
        # Nobody listens yet, or any more.
        with suppress(ConnectionError):
            self._socket.send(packet)

    def close(self) -> None:
        """Free the socket."""
        self._socket.close()


def sender_of(to: str, address: str) -> ZmqSender | UdpSender:
    """Return what sends the packets of a peer, one of ``PACKETS``, or raise CardboxError."""
    return UdpSender(address) if to == "vmc" else ZmqSender(address)


_HEADER_BYTES, _ROBOT_JOINTS = 1280, 29
# The first of the six wrist joints of SONIC's robot: roll, pitch, yaw, each left before right.
_WRISTS = 23
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
    """Return the msgpack of Isaac Teleop's body in OpenXR's axes, or raise CardboxError."""
    points_m = body.points_m @ rotation_z(np.array(body.yaw_rad)).T @ _TO_OPENXR.T
    points_m[:, 1] -= points_m[FEET, 1].min()
    turned = Rotation.from_rotvec([0.0, 0.0, body.yaw_rad]) * Rotation.from_quat(
        body.turns[:, [1, 2, 3, 0]]
    )
    x, y, z, w = turned.as_quat().T
    content = {
        "timestamp": body.stamp_ns,
        "joint_names": [name.upper() for name in NAMES],
        "joint_positions": points_m.tolist(),
        "joint_orientations": np.stack([-y, z, -x, w], axis=1).tolist(),
        "joint_valid": body.valid.tolist(),
    }
    packed: bytes = optional("msgpack", *_EXTRA).packb(content)
    return packed


# The humanoid bones of VRM, as Unity names them.
_BONES = {"Hips": "pelvis", "Spine": "spine1", "Chest": "spine2", "UpperChest": "spine3"} | {
    "Neck": "neck",
    "Head": "head",
    **{
        f"{side.capitalize()}{bone}": f"{side}_{joint}"
        for side in ("left", "right")
        for bone, joint in (
            *(("Shoulder", "collar"), ("UpperArm", "shoulder"), ("LowerArm", "elbow")),
            *(("Hand", "wrist"), ("UpperLeg", "hip"), ("LowerLeg", "knee"), ("Foot", "ankle")),
        )
    },
}


def vmc_packet(body: FullBody, _: int) -> bytes:
    """Return a bundle of OSC with the bones of VMC (https://protocol.vmc.info), or CardboxError.

    Unity's axes are left-handed: X to the right, Y up, Z ahead. Bones have their places and
    rotations (x, y, z, w) against those before them, the root the yaw.
    """
    osc, bundles = (
        optional(f"pythonosc.{name}", *_EXTRA)
        for name in ("osc_message_builder", "osc_bundle_builder")
    )
    bundle = bundles.OscBundleBuilder(bundles.IMMEDIATELY)

    def add(address: str, *values: str | float) -> None:
        message = osc.OscMessageBuilder(f"/VMC/Ext/{address}")
        for value in values:
            message.add_arg(value)
        bundle.add_content(message.build())

    turns, places = local_frames(body)
    half = body.yaw_rad / 2
    add("OK", 1)
    add("T", body.stamp_ns / 1e9)
    add("Root/Pos", "root", *(0.0, 0.0, 0.0), *(0.0, -np.sin(half), 0.0, np.cos(half)))
    for bone, joint in _BONES.items():
        number = NAMES.index(joint)
        (x, y, z), turn = places[number].tolist(), Rotation.from_matrix(turns[number])
        qx, qy, qz, qw = turn.as_quat().tolist()
        add("Bone/Pos", bone, -y, z, x, qy, -qz, -qx, qw)
    packed: bytes = bundle.build().dgram
    return packed


PACKETS: dict[str, Callable[[FullBody, int], bytes]] = {
    "sonic": sonic_packet,
    "isaac": isaac_packet,
    "json": json_packet,
    "vmc": vmc_packet,
}
"""Makers of packets by the name of the peer."""


# A hand that gestures is slower; what is faster is mostly an arm that is seen again.
_FASTEST_M_S, _FASTEST_RAD_S = 4.0, 8.0


class Packets:
    """Makes the packets of one stream, at one rate.

    SONIC cannot read validity. From one of its packets to the next, no joint moves faster than
    4 m/s, and yaw and wrists turn no faster than 8 rad/s, also after a time without packets.
    """

    def __init__(self, to: str, rate_hz: float) -> None:
        """Begin a stream to a peer, one of ``PACKETS``."""
        self._to, self._rate_hz = to, rate_hz
        self._number = -1
        self._before: FullBody | None = None

    def of(self, body: FullBody | None) -> bytes | None:
        """Return the packet of a body; None where the peer has to stay as nothing is valid."""
        self._number += 1
        if body is None or (self._to != "json" and not body.valid.any()):
            return None
        if self._to == "sonic":
            self._before = body = self._slowed(body)
        return PACKETS[self._to](body, self._number)

    def _slowed(self, body: FullBody) -> FullBody:
        if self._before is None:
            return body
        most_m, most_rad = _FASTEST_M_S / self._rate_hz, _FASTEST_RAD_S / self._rate_hz
        before = self._before
        moved_m = body.points_m - before.points_m
        away_m = np.linalg.norm(moved_m, axis=1, keepdims=True)
        turned = (body.yaw_rad - before.yaw_rad + np.pi) % (2 * np.pi) - np.pi
        wrists = np.clip(body.wrists_rad - before.wrists_rad, -most_rad, most_rad)
        return body._replace(
            points_m=before.points_m + moved_m * (most_m / np.maximum(away_m, most_m)),
            yaw_rad=before.yaw_rad + float(np.clip(turned, -most_rad, most_rad)),
            wrists_rad=before.wrists_rad + wrists,
        )
