"""Packets are those of the pages of their readers, byte for byte."""

from __future__ import annotations

import json
import socket
import struct
from collections.abc import Iterator
from contextlib import closing
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cardbox_tracker.applications.teleoperation import sending
from cardbox_tracker.applications.teleoperation.full_body import NAMES, FullBody
from cardbox_tracker.common.errors import CardboxError

REST = np.tile([1.0, 0.0, 0.0, 0.0], (24, 1))


def body(yaw_rad: float = 0.0) -> FullBody:
    """Return a body whose numbers tell their places."""
    points = np.arange(72.0).reshape(24, 3) / 64
    wrists = np.array([[0.25, 0.5, 0.75], [1.25, 1.5, 1.75]])
    valid = np.array([name != "left_foot" for name in NAMES])
    return FullBody(7, points, REST, yaw_rad, wrists, valid)


def test_a_frame_of_sonic_has_the_bytes_computed_by_hand() -> None:
    header = (
        b'{"v":3,"endian":"le","count":1,"fields":['
        b'{"name":"smpl_joints","dtype":"f32","shape":[1,24,3]},'
        b'{"name":"smpl_pose","dtype":"f32","shape":[1,21,3]},'
        b'{"name":"joint_pos","dtype":"f32","shape":[1,29]},'
        b'{"name":"joint_vel","dtype":"f32","shape":[1,29]},'
        b'{"name":"body_quat","dtype":"f32","shape":[1,4]},'
        b'{"name":"frame_index","dtype":"i64","shape":[1]}]}'
    )
    expected = b"pose" + header + bytes(1280 - len(header))
    expected += b"".join(struct.pack("<f", number / 64) for number in range(72))
    expected += bytes(21 * 3 * 4) + bytes(23 * 4)
    expected += struct.pack("<6f", 0.25, 1.25, 0.5, 1.5, 0.75, 1.75)
    expected += bytes(29 * 4) + bytes.fromhex("0000803f 00000000 00000000 00000000")
    expected += bytes.fromhex("2a00000000000000")
    assert sending.sonic_packet(body(), 42) == expected
    assert len(expected) == 2080


# Its tables of the fields that protocol v3 requires: shapes behind the number of frames.
SONIC_FIELDS = {"smpl_joints": (24, 3), "smpl_pose": (21, 3), "joint_pos": (29,)} | {
    "joint_vel": (29,),
    "body_quat": (4,),
    "frame_index": (),
}


def decoded(frame: bytes) -> dict[str, Any]:
    """Decode a frame as the page of SONIC's protocol describes it, and check what it requires."""
    assert frame[:4] == b"pose"
    header = json.loads(frame[4:1284].rstrip(b"\0"))
    assert (header["v"], header["endian"]) == (3, "le")
    found, offset = {}, 1284
    for entry in header["fields"]:
        kind, size = {"f32": ("f", 4), "i64": ("q", 8)}[entry["dtype"]]
        count = int(np.prod(entry["shape"]))
        numbers = struct.unpack_from(f"<{count}{kind}", frame, offset)
        found[entry["name"]] = np.reshape(numbers, entry["shape"])
        offset += size * count
    assert offset == len(frame)
    assert {name: one.shape for name, one in found.items()} == {
        name: (header["count"], *shape) for name, shape in SONIC_FIELDS.items()
    }
    # Of the robot's joints, only the wrists count.
    assert not found["joint_pos"][:, :23].any() and not found["joint_vel"].any()
    assert np.linalg.norm(found["body_quat"], axis=1) == pytest.approx(1.0)
    return found


def test_a_decoder_of_the_page_reads_a_frame_of_sonic() -> None:
    turned = decoded(sending.sonic_packet(body(np.pi / 2), 5))
    half = np.sqrt(0.5)
    assert turned["body_quat"][0] == pytest.approx([half, 0.0, 0.0, half])
    assert turned["frame_index"].tolist() == [5]
    # The joints are in the person's frame, whatever the yaw.
    assert turned["smpl_joints"][0] == pytest.approx(body().points_m)
    # Three joints of each wrist, left before right.
    wrists = body().wrists_rad
    assert turned["joint_pos"][0, 23::2] == pytest.approx(wrists[0])
    assert turned["joint_pos"][0, 24::2] == pytest.approx(wrists[1])


# The table of its document on full-body tracking: upper case, in this order.
ISAAC_NAMES = [
    *("PELVIS", "LEFT_HIP", "RIGHT_HIP", "SPINE1", "LEFT_KNEE", "RIGHT_KNEE", "SPINE2"),
    *("LEFT_ANKLE", "RIGHT_ANKLE", "SPINE3", "LEFT_FOOT", "RIGHT_FOOT", "NECK", "LEFT_COLLAR"),
    *("RIGHT_COLLAR", "HEAD", "LEFT_SHOULDER", "RIGHT_SHOULDER", "LEFT_ELBOW", "RIGHT_ELBOW"),
    *("LEFT_WRIST", "RIGHT_WRIST", "LEFT_HAND", "RIGHT_HAND"),
]


def test_isaac_gets_the_axes_of_openxr() -> None:
    msgpack = pytest.importorskip("msgpack")
    points = np.zeros((24, 3))
    points[NAMES.index("head")] = 0.25, 0.5, 1.0
    points[[NAMES.index("left_foot"), NAMES.index("right_foot")], 2] = -0.75, -1.0
    half = np.sqrt(0.5)
    turns = REST.copy()
    turns[NAMES.index("neck")] = half, half, 0.0, 0.0
    found = msgpack.unpackb(sending.isaac_packet(body()._replace(points_m=points, turns=turns), 0))
    assert found["timestamp"] == 7 and found["joint_names"] == ISAAC_NAMES
    # X to the right, Y up, Z backwards; the lower foot stands on the floor.
    assert found["joint_positions"][NAMES.index("head")] == [-0.5, 2.0, -0.25]
    assert found["joint_positions"][0] == [0.0, 1.0, 0.0]
    # A lean to the right is a turn about the direction ahead, which is -Z; w is last.
    assert found["joint_orientations"][NAMES.index("neck")] == pytest.approx([0, 0, -half, half])
    assert found["joint_orientations"][0] == pytest.approx([0, 0, 0, 1])
    assert [NAMES[i] for i, one in enumerate(found["joint_valid"]) if not one] == ["left_foot"]
    turned = body(np.pi / 2)._replace(points_m=points, turns=turns)
    found = msgpack.unpackb(sending.isaac_packet(turned, 0))
    assert found["joint_positions"][NAMES.index("head")] == pytest.approx([-0.25, 2.0, 0.5])
    assert found["joint_orientations"][0] == pytest.approx([0, half, 0, half])


def test_the_message_fills_isaac_teleops_full_body() -> None:
    pytest.importorskip("isaacteleop", reason="isaacteleop is not installed")
    types = import_module("isaacteleop.retargeting_engine.tensor_types")
    assert [one.name for one in types.BodyJointIndex] == ISAAC_NAMES
    group_of = import_module("isaacteleop.retargeting_engine.interface").TensorGroup
    found = import_module("msgpack").unpackb(sending.isaac_packet(body(), 0))
    group = group_of(types.FullBodyInput())
    group[types.FullBodyInputIndex.JOINT_POSITIONS] = np.array(found["joint_positions"], "f4")
    group[types.FullBodyInputIndex.JOINT_ORIENTATIONS] = np.array(found["joint_orientations"], "f4")
    group[types.FullBodyInputIndex.JOINT_VALID] = np.array(found["joint_valid"], "u1")
    with pytest.raises((TypeError, ValueError)):
        group[types.FullBodyInputIndex.JOINT_VALID] = np.ones(23, "u1")


def test_a_line_of_json_has_the_validity_of_each_joint() -> None:
    found = json.loads(sending.json_packet(body(), 0))
    assert found["names"] == list(NAMES) and found["stamp_ns"] == 7
    assert found["positions"][1] == [round(value / 64, 5) for value in (3, 4, 5)]
    assert found["valid"].count(False) == 1
    with pytest.raises(ValueError):
        sending.line({"value": float("nan")})


def test_readers_without_validity_get_nothing_while_nothing_is_valid() -> None:
    nothing = body().invalid(8)
    assert sending.Packets("sonic", 50.0).of(nothing) is None
    assert sending.Packets("isaac", 50.0).of(nothing) is None
    assert b'"valid":[false' in (sending.Packets("json", 50.0).of(nothing) or b"")
    assert sending.Packets("json", 50.0).of(None) is None


def test_sonic_gets_no_joint_that_jumps() -> None:
    """An arm that is seen again, after a silence, is reached at 4 m/s; a robot holds meanwhile."""
    packets = sending.Packets("sonic", 50.0)
    away = body(np.pi)
    points = away.points_m + np.array([0.3, 0.0, 0.4])
    away = away._replace(points_m=points, wrists_rad=np.ones((2, 3)))
    sent = [packets.of(one) for one in (body(), body().invalid(8), *[away] * 40)]
    assert sent[1] is None
    found = [decoded(one) for one in sent if one]
    assert [one["frame_index"][0] for one in found] == [0, *range(2, 42)]
    moved = np.diff([one["smpl_joints"][0] for one in found], axis=0)
    assert np.linalg.norm(moved, axis=2).max() == pytest.approx(0.08, abs=1e-6)
    assert found[-1]["smpl_joints"][0] == pytest.approx(away.points_m)
    yaws = np.array(
        [2 * np.arctan2(one["body_quat"][0, 3], one["body_quat"][0, 0]) for one in found]
    )
    assert np.abs(np.diff(yaws)).max() <= 0.16 + 1e-6
    assert np.abs(yaws[-1]) == pytest.approx(np.pi, abs=1e-6)
    turned = np.diff([one["joint_pos"][0] for one in found], axis=0)
    assert np.abs(turned).max() <= 0.16 + 1e-6


def osc_strings(packet: bytes, offset: int) -> tuple[str, int]:
    """Return a text of OSC, which ends with zeros to a multiple of four bytes, and its end."""
    end = packet.index(b"\0", offset)
    return packet[offset:end].decode(), (end + 4) & ~3


def osc_messages(packet: bytes) -> dict[str, list[float]]:
    """Decode a bundle as the specification of OSC 1.0 has it: values by address and name."""
    assert packet[:8] == b"#bundle\0"
    found, offset = {}, 16
    while offset < len(packet):
        size = struct.unpack_from(">i", packet, offset)[0]
        message, offset = packet[offset + 4 : offset + 4 + size], offset + 4 + size
        address, at = osc_strings(message, 0)
        types, at = osc_strings(message, at)
        name = ""
        if types[1:2] == "s":
            name, at = osc_strings(message, at)
        kinds = types[2 if name else 1 :]
        found[f"{address} {name}".strip()] = list(struct.unpack_from(f">{kinds}", message, at))
    return found


def test_an_avatar_gets_the_bones_of_vmc() -> None:
    """Hanging arms are turned down from the T-pose; in Unity, about Z, which points ahead."""
    pytest.importorskip("pythonosc", reason="python-osc is not installed")
    points = np.zeros((24, 3))
    points[NAMES.index("left_shoulder")] = 0.0, 0.2, 0.5
    points[NAMES.index("left_elbow")] = 0.0, 0.2, 0.2
    points[[NAMES.index("left_foot"), NAMES.index("right_foot")], 2] = -0.75, -1.0
    half = np.sqrt(0.5)
    found = osc_messages(sending.vmc_packet(body(np.pi / 2)._replace(points_m=points), 0))
    assert found["/VMC/Ext/OK"] == [1]
    # To the left is a negative turn about Y of left-handed axes.
    assert found["/VMC/Ext/Root/Pos root"] == pytest.approx([0, 0, 0, 0, -half, 0, half])
    bones = {name.split()[1]: of for name, of in found.items() if "Bone" in name}
    assert len(bones) == 20 and bones["Hips"] == pytest.approx([0, 1.0, 0, 0, 0, 0, 1])
    # The left is -X; the arm goes out from the shoulder before it is turned by a quarter.
    assert bones["LeftLowerArm"] == pytest.approx([-0.3, 0, 0, 0, 0, 0, 1], abs=1e-6)
    assert bones["LeftUpperArm"][:3] == pytest.approx([-0.2, 0.5, 0.0])
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        turn = np.array(bones[f"{side}UpperArm"][3:])
        assert turn * np.sign(turn[3]) == pytest.approx([0, 0, sign * half, half])


def test_packets_arrive_by_udp() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as reader:
        reader.bind(("127.0.0.1", 0))
        reader.settimeout(5.0)
        address = f"udp://127.0.0.1:{reader.getsockname()[1]}"
        with closing(sending.sender_of("vmc", address)) as sender:
            sender.send(b"one")
            assert reader.recv(10) == b"one"
            reader.close()
            sender.send(b"nobody listens")
            sender.send(b"nobody listens")
    for wrong in ("tcp://127.0.0.1:39539", "udp://127.0.0.1", "udp://127.0.0.1:99999", "udp://:1"):
        with pytest.raises(CardboxError, match="give the address of the program"):
            sending.sender_of("vmc", wrong)


@pytest.fixture
def subscriber() -> Iterator[Any]:
    zmq = pytest.importorskip("zmq", reason="pyzmq is not installed")
    with zmq.Context() as context, context.socket(zmq.SUB) as socket:
        socket.subscribe(b"")
        socket.linger, socket.rcvtimeo = 0, 200
        yield socket


def test_packets_arrive_by_zmq(subscriber: Any) -> None:
    import zmq

    address = "tcp://127.0.0.1:51873"
    with closing(sending.ZmqSender(address)) as sender:
        subscriber.connect(address)
        for _ in range(50):
            sender.send(b"pose1")
            try:
                assert subscriber.recv() == b"pose1"
                break
            except zmq.Again:
                continue
        else:
            pytest.fail("nothing arrived")
        with pytest.raises(CardboxError, match="cannot listen on 'tcp:"):
            sending.ZmqSender(address)


@pytest.mark.parametrize(
    "address",
    [
        *("nonsense", "tcp://127.0.0.1:0", "tcp://127.0.0.1:70000", "tcp://127.0.0.1:*"),
        *("tcp://127.0.0.1", "tcp://127.0.0.1:5595/x", "inproc://x", "ipc://*", "ipc://", ""),
    ],
)
def test_an_address_that_nobody_can_read_is_refused(address: str) -> None:
    with pytest.raises(CardboxError, match="give an address as"):
        sending.ZmqSender(address)


def test_no_file_is_deleted_and_an_open_address_is_told(tmp_path: Path) -> None:
    pytest.importorskip("zmq", reason="pyzmq is not installed")
    file = tmp_path / "notes"
    file.write_text("mine")
    with pytest.raises(CardboxError, match="that file exists"):
        sending.ZmqSender(f"ipc://{file}")
    assert file.read_text() == "mine"
    for address, words in (
        (f"ipc://{tmp_path}/new", ""),
        ("tcp://0.0.0.0:51875", "computer alone"),
    ):
        with closing(sending.ZmqSender(address)) as sender:
            assert bool(sender.remarks) == bool(words) and words in "".join(sender.remarks)


def test_a_missing_package_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "msgpack", None)
    with pytest.raises(CardboxError, match=r"pip install 'cardbox_tracker\[teleoperation\]'"):
        sending.isaac_packet(body(), 0)
