"""A small recording cannot fill the memory, hang, or end in a traceback."""

from __future__ import annotations

import os
import struct
import threading
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import lz4.frame
import numpy as np
import pytest
from rosbags.rosbag2 import storage_mcap

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.errors import BagError, CardboxError
from cardbox_tracker.recordings import bag_files
from cardbox_tracker.recordings.bag_files import LimitedFile, unpack_lz4, unpack_zstd
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.recordings.bag_writer import BagWriter
from cardbox_tracker.recordings.silhouettes import SilhouetteSource, TimeSpan

CAMERA = Camera(64, 48, 66.0, 66.0, 31.5, 23.5)
START_NS = 1_700_000_000_000_000_000
MB = 1024 * 1024
# Untyped, because rosbags does not export its zstd module.
_MCAP: Any = storage_mcap
zstd = _MCAP.zstd


CODECS: dict[str, tuple[Callable[[bytes], bytes], Callable[[bytes, int], bytes]]] = {
    "zstd": (zstd.compress, unpack_zstd),
    "lz4": (lz4.frame.compress, unpack_lz4),
}


def record(path: Path, count: int = 12, late_s: float = 0.0, broken: tuple[int, ...] = ()) -> Path:
    """Record JPEG images, some of them broken, whose stamps are ``late_s`` before the bag's."""
    with BagWriter(path, compress=True) as bag:
        for number in range(count):
            recorded_ns = START_NS + number * 100_000_000
            stamp_ns = recorded_ns - round(late_s * 1e9)
            image = np.full((48, 64), 90 + number % 2, np.uint8)
            data = cv2.imencode(".jpg", image)[1].tobytes()
            data = data[: len(data) // 2] if number in broken else data
            bag.write_camera_info("/camera_info", recorded_ns, "eye", CAMERA)
            message = bag.new(
                "sensor_msgs/msg/CompressedImage",
                header=bag.header(stamp_ns, "eye"),
                format="jpeg",
                data=np.frombuffer(data, np.uint8),
            )
            bag.write("/image_raw/compressed", message, recorded_ns)
    return path


def mcap_of(bag: Path) -> Path:
    return next(bag.glob("*.mcap"))


@pytest.mark.parametrize("name", CODECS)
@pytest.mark.parametrize("frames", [1, 3])
def test_what_is_compressed_comes_back(name: str, frames: int) -> None:
    data = os.urandom(1000) + bytes(100_000)
    pack, unpack = CODECS[name]
    assert unpack(pack(data) * frames, frames * len(data)) == data * frames


@pytest.mark.promise("No input fills memory, disk or log, or holds up a program")
@pytest.mark.parametrize("name", CODECS)
def test_a_chunk_that_holds_more_than_it_says_is_not_unpacked(name: str) -> None:
    pack, unpack = CODECS[name]
    packed = pack(bytes(200 * MB))
    tracemalloc.start()
    try:
        with pytest.raises(BagError, match="1000 bytes"):
            unpack(packed, 1000)
        with pytest.raises(BagError, match="cut off"):
            unpack(packed[:50], 40 * MB)
        assert tracemalloc.get_traced_memory()[1] < 50 * MB
    finally:
        tracemalloc.stop()


@pytest.mark.promise("No input fills memory, disk or log, or holds up a program")
@pytest.mark.parametrize("size", [2 * bag_files.MOST_BYTES, 2**63])
def test_a_chunk_that_says_it_holds_gigabytes_is_refused(size: int, tmp_path: Path) -> None:
    file = mcap_of(record(tmp_path / "bag"))
    data = bytearray(file.read_bytes())
    at = 8
    while data[at] != 0x06:
        at += 9 + struct.unpack_from("<Q", data, at + 1)[0]
    struct.pack_into("<Q", data, at + 9 + 16, size)
    file.write_bytes(data)
    for path in (file, file.parent):
        with pytest.raises(BagError, match=r"unpack.* MB"), BagReader(path):
            pytest.fail("it was opened")


@pytest.mark.promise("No input fills memory, disk or log, or holds up a program")
def test_the_stated_size_is_the_limit_while_messages_are_read(tmp_path: Path) -> None:
    file = mcap_of(record(tmp_path / "bag"))
    data = bytearray(file.read_bytes())
    at = 8
    while at < len(data) - 37:
        kind, length = struct.unpack_from("<BQ", data, at)
        at += 9 + length
        if kind == 0x08:
            struct.pack_into("<Q", data, at - 8, 10)
    file.write_bytes(data)
    with BagReader(file) as bag, pytest.raises(BagError, match="more than 10 bytes"):
        list(bag.messages())


@pytest.mark.promise("No input fills memory, disk or log, or holds up a program")
def test_many_chunks_that_are_large_together_are_refused(tmp_path: Path) -> None:
    chunk = struct.pack("<BQQQQIIQ", 0x06, 40, 0, 0, bag_files.MOST_BYTES // 3, 0, 0, 0)
    (tmp_path / "bag.mcap").write_bytes(b"\x89MCAP0\r\n" + chunk * 4)
    with pytest.raises(BagError, match="unpack"), BagReader(tmp_path / "bag.mcap"):
        pytest.fail("it was opened")


def test_messages_and_files_that_are_compressed_each_are_bounded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bag_files, "MOST_BYTES", 10 * MB)
    packed = tmp_path / "bag.zstd"
    packed.write_bytes(zstd.compress(bytes(100 * MB)))
    with (
        packed.open("rb") as file,
        LimitedFile(file, "rb") as unpacked,
        pytest.raises(BagError, match="than its size allows"),
    ):
        while unpacked.read(MB):
            pass
    with pytest.raises(BagError, match=f"{10 * MB} bytes"):
        unpack_zstd(zstd.compress(bytes(11 * MB)))


@pytest.mark.parametrize(
    "metadata", ["a: &a [x]\nb: [*a, *a]\n", "#" * (bag_files.MOST_METADATA_BYTES + 1)]
)
def test_metadata_that_no_recorder_wrote_are_refused(metadata: str, tmp_path: Path) -> None:
    bag = record(tmp_path / "bag")
    (bag / "metadata.yaml").write_text(metadata)
    with pytest.raises(BagError, match="ros2 bag reindex"), BagReader(bag):
        pytest.fail("it was opened")


def pipe(path: Path) -> Path:
    os.mkfifo(path)
    return path


def folder_with_pipes(path: Path) -> Path:
    record(path)
    mcap = mcap_of(path)
    mcap.unlink()
    return pipe(mcap).parent


def folder_with_metadata_pipe(path: Path) -> Path:
    record(path)
    (path / "metadata.yaml").unlink()
    return pipe(path / "metadata.yaml").parent


@pytest.mark.promise("No input fills memory, disk or log, or holds up a program")
@pytest.mark.parametrize("make", [pipe, folder_with_pipes, folder_with_metadata_pipe])
def test_a_pipe_is_not_waited_for(make: Callable[[Path], Path], tmp_path: Path) -> None:
    path = make(tmp_path / "bag")
    told: list[str] = []

    def read() -> None:
        with pytest.raises(BagError) as refused:
            BagReader(path).__enter__()
        told.append(str(refused.value))

    reading = threading.Thread(target=read, daemon=True)
    reading.start()
    reading.join(30)
    assert told and ("pipe" in told[0] or "is not a file" in told[0])


@pytest.mark.promise("Any damaged or hostile input is read or refused with a reason")
def test_broken_images_are_left_out_counted_and_named(tmp_path: Path) -> None:
    with BagReader(record(tmp_path / "bag", broken=(6, 9))) as bag:
        source = SilhouetteSource(bag, TimeSpan(0.0, 0.5))
        for _ in range(2):
            assert len(list(source.frames())) == 10
        (remark,) = source.remarks
    assert remark.startswith("2 images cannot be decoded")
    assert "number 7: the compressed image" in remark


def test_a_recording_of_broken_images_says_so(tmp_path: Path) -> None:
    with (
        BagReader(record(tmp_path / "bag", broken=tuple(range(12)))) as bag,
        pytest.raises(CardboxError, match=r"bag has no image to learn from: 12 images.*number 1: "),
    ):
        SilhouetteSource(bag, TimeSpan(0.0, 0.5))


@pytest.mark.parametrize(("late_s", "words"), [(1.7e9, "behind"), (-3600.0, "ahead of")])
def test_stamps_on_another_clock_are_told_and_seconds_count_all_the_same(
    late_s: float, words: str, tmp_path: Path
) -> None:
    times = {}
    for name, late in (("same", 0.2), ("other", late_s)):
        with BagReader(record(tmp_path / name, late_s=late)) as bag:
            source = SilhouetteSource(bag, TimeSpan(0.0 - 1, 0.5))
            times[name] = [frame.time_s for frame in source.frames(0.55)]
            remarks = source.remarks
    np.testing.assert_allclose(times["other"], [0.6, 0.7, 0.8, 0.9, 1.0, 1.1], atol=1e-6)
    np.testing.assert_allclose(times["same"], [0.6, 0.7, 0.8, 0.9], atol=1e-6)
    assert words in remarks[0]


def test_a_type_that_is_not_that_of_ros_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Recordings bring definitions of their types along."""

    class Odd:
        header = data = format = None

    odd = Odd()
    monkeypatch.setattr(BagReader, "deserialize", lambda *_: odd)
    with BagReader(record(tmp_path / "bag")) as bag:
        for use in (lambda: list(bag.images()), bag.calibration):
            with pytest.raises(BagError, match="damaged"):
                use()


def test_bytes_that_are_no_message_are_refused(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as writer:
        writer.write_camera_info("/camera_info", START_NS, "eye", CAMERA)
        kind = "sensor_msgs/msg/CompressedImage"
        writer.write_raw("/image_raw/compressed", kind, b"\0\1\0\0" + b"\xff" * 30, START_NS)
    with BagReader(tmp_path / "bag") as bag, pytest.raises(BagError, match="damaged"):
        list(bag.images())
