"""Recordings of other drivers, recorders and distributions."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.typesys import Stores, get_typestore

from cardbox_tracker.common.errors import BagError, CameraError, CardboxError, EncodingError
from cardbox_tracker.recordings.bag_files import lone_parts
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.recordings.bag_writer import BagWriter
from cardbox_tracker.recordings.given_camera import GivenCamera
from cardbox_tracker.recordings.open_images import is_one_recording, open_images, recordings_in
from cardbox_tracker.recordings.recording import RecordingRequest
from cardbox_tracker.recordings.silhouettes import SilhouetteSource, TimeSpan

S, MS = 1_000_000_000, 1_000_000
START = 1_700_000_000 * S
K = (165.0, 0.0, 79.5, 0.0, 165.0, 59.5, 0.0, 0.0, 1.0)
EMPTY = TimeSpan(0.0, 0.3)


def info(store: Any, width: int = 160, height: int = 120, k: Sequence[float] = K) -> Any:
    kinds = store.types
    return kinds["sensor_msgs/msg/CameraInfo"](
        header=kinds["std_msgs/msg/Header"](
            stamp=kinds["builtin_interfaces/msg/Time"](sec=0, nanosec=0), frame_id="/left"
        ),
        height=height,
        width=width,
        distortion_model="plumb_bob",
        d=np.zeros(5),
        k=np.array(k),
        r=np.eye(3).ravel(),
        p=np.zeros(12),
        binning_x=0,
        binning_y=0,
        roi=kinds["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False),
    )


def write_images(
    bag: BagWriter, topics: Sequence[str], numbers: Sequence[int], stamps: Sequence[int] = ()
) -> None:
    """Write grey images of 160x120, 15 a second."""
    for place, number in enumerate(numbers):
        recorded = START + number * S // 15
        stamp = stamps[place] if stamps else recorded
        grey = np.full((120, 160), 90 + number % 50, np.uint8)
        for topic in topics:
            values = {"encoding": "mono8", "height": 120, "width": 160, "step": 160}
            kind, data = "sensor_msgs/msg/Image", grey.ravel()
            if topic.endswith("compressed"):
                kind, values = "sensor_msgs/msg/CompressedImage", {"format": "png"}
                data = np.frombuffer(cv2.imencode(".png", grey)[1].tobytes(), np.uint8)
            header = bag.header(stamp, "/left")
            bag.write(topic, bag.new(kind, header=header, data=data, **values), recorded)


def recorded(
    path: Path,
    topics: Sequence[str] = ("/image_raw",),
    infos: Sequence[Any] | None = None,
    numbers: Sequence[int] = range(12),
    stamps: Sequence[int] = (),
) -> Path:
    with BagWriter(path) as bag:
        store = bag._store
        for number, message in enumerate([info(store)] if infos is None else infos):
            bag.write("/camera_info", message, START + (numbers[0] + number) * S // 15)
        write_images(bag, topics, numbers, stamps)
    return path


def seconds(path: Path) -> list[float]:
    with open_images(path) as bag:
        return [(image.stamp_ns - START) / 1e9 for image in bag.images()]


def test_a_bag_of_ros_1_has_capital_letters(tmp_path: Path) -> None:
    path, store = tmp_path / "session.bag", get_typestore(Stores.ROS1_NOETIC)
    kinds = store.types
    with Writer1(path) as bag:
        line = bag.add_connection("/camera_info", "sensor_msgs/msg/CameraInfo", typestore=store)
        header = kinds["std_msgs/msg/Header"](
            0, kinds["builtin_interfaces/msg/Time"](START // S, 0), "left"
        )
        roi = kinds["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
        message = kinds["sensor_msgs/msg/CameraInfo"](
            header=header,
            height=120,
            width=160,
            distortion_model="plumb_bob",
            D=np.array([-0.1, 0.02, 0.0, 0.0, 0.0]),
            K=np.array(K),
            R=np.eye(3).ravel(),
            P=np.zeros(12),
            binning_x=0,
            binning_y=0,
            roi=roi,
        )
        bag.write(line, START, store.serialize_ros1(message, message.__msgtype__))
        line = bag.add_connection("/image_raw", "sensor_msgs/msg/Image", typestore=store)
        image = kinds["sensor_msgs/msg/Image"](
            header, 120, 160, "mono8", 0, 160, np.zeros(160 * 120, np.uint8)
        )
        bag.write(line, START, store.serialize_ros1(image, image.__msgtype__))
    with open_images(path) as source:
        found = source.calibration()
    np.testing.assert_array_equal(found.k.ravel(), K)
    np.testing.assert_array_equal(found.distortion, [-0.1, 0.02, 0, 0, 0])


@pytest.mark.parametrize("empty", [1, 3])
def test_the_first_camera_info_with_a_calibration_counts(tmp_path: Path, empty: int) -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    infos = [info(store, 0, 0, (0.0,) * 9) for _ in range(empty)] + [info(store)] * 2
    with open_images(recorded(tmp_path / "late", infos=infos)) as bag:
        found = bag.calibration()
        assert (found.width, found.height, found.k[0, 0]) == (160, 120, 165.0)
        assert any(f"first {empty} messages on /camera_info" in text for text in bag.remarks)


@pytest.mark.parametrize("size", [(0, 0), (160, 120)])
def test_a_camera_info_without_a_calibration_is_no_zoom(
    tmp_path: Path, size: tuple[int, int]
) -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    empty = info(store, *size, K if size == (0, 0) else (0.0,) * 9)
    infos = [info(store)] * 4 + [empty] * 4
    with open_images(recorded(tmp_path / "bag", infos=infos)) as bag:
        assert bag.calibration().k[0, 0] == 165.0
        assert bag.remarks == []


@pytest.mark.parametrize(
    ("region", "fault"),
    [
        ((40, 30, 80, 60), "is 80 px wide, but the images of /image_raw have 160x120"),
        ((100, 80, 80, 60), "80x60 px at (100, 80), outside of images of 160x120"),
    ],
)
def test_a_region_that_is_not_that_of_the_images_is_refused(
    tmp_path: Path, region: tuple[int, int, int, int], fault: str
) -> None:
    wrong = info(get_typestore(Stores.ROS2_JAZZY))
    wrong.roi.x_offset, wrong.roi.y_offset, wrong.roi.width, wrong.roi.height = region
    with (
        open_images(recorded(tmp_path / "bag", infos=[wrong])) as bag,
        pytest.raises(CameraError, match=re.escape(fault)),
    ):
        bag.calibration()
    # Images may be of the region before binning.
    wrong.roi.x_offset = wrong.roi.y_offset = 0
    wrong.width, wrong.height, wrong.roi.width, wrong.roi.height = 320, 240, 160, 120
    wrong.binning_x = wrong.binning_y = 2
    with open_images(recorded(tmp_path / "binned", infos=[wrong])) as bag:
        assert (bag.calibration().width, bag.calibration().k[0, 0]) == (80, 82.5)


@pytest.mark.parametrize("name", ["image_rect", "image_rect_color", "rect/image"])
def test_images_that_are_rectified_by_their_name_have_p_and_no_distortion(
    tmp_path: Path, name: str
) -> None:
    """The CameraInfo beside those of image_proc is that of the raw images."""
    of_raw = info(get_typestore(Stores.ROS2_JAZZY))
    of_raw.d[0] = -0.3
    of_raw.p[[0, 2, 5, 6]] = 140.0, 119.5, 140.0, 59.5
    with open_images(recorded(tmp_path / "bag", (f"/{name}",), [of_raw])) as bag:
        found = bag.calibration()
        assert (found.k[0, 0], found.k[0, 2], found.is_distorted) == (140.0, 119.5, False)
        told = " ".join(bag.remarks)
        assert "so P of /camera_info is used" in told
        assert "principal point (119.5, 59.5) px is far from the middle" in told


def test_further_images_in_the_namespace_of_a_camera_are_left_out(tmp_path: Path) -> None:
    """The root namespace has no name by which a user could choose it."""
    topics = "/image_raw", "/image_rect"
    with open_images(recorded(tmp_path / "bag", topics)) as bag:
        assert bag.image_topic() == "/image_raw"
        assert bag.left_out("/image_raw") == ["the images on /image_rect"]
    topics = "/left/image_raw", "/right/image_raw"
    with (
        open_images(recorded(tmp_path / "two", topics)) as bag,
        pytest.raises(BagError, match="2 image topics"),
    ):
        bag.image_topic()


def test_the_frame_is_that_of_the_images_if_the_camera_info_has_none(tmp_path: Path) -> None:
    nameless = info(get_typestore(Stores.ROS2_JAZZY))
    nameless.header.frame_id = ""
    with open_images(recorded(tmp_path / "bag", infos=[nameless])) as bag:
        assert SilhouetteSource(bag, EMPTY).frame_id == "left"
        source = SilhouetteSource(bag, TimeSpan(0.0, 1e300))
        assert any("ends at 1e+300 s, after the recording of" in text for text in source.remarks)


def test_a_zoom_within_the_recording_is_told(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    twice = (330.0, 0.0, 159.5, 0.0, 330.0, 119.5, 0.0, 0.0, 1.0)
    for focal_px, size, is_told in (
        (166.0, (160, 120), False),
        (200.0, (160, 120), True),
        (330.0, (320, 240), False),
        (330.0, (160, 120), True),
    ):
        once = (focal_px, 0.0, 79.5, 0.0, focal_px, 59.5, 0.0, 0.0, 1.0)
        zoomed = info(store, *size, twice if size[0] == 320 else once)
        infos = [info(store)] * 6 + [zoomed] * 6
        with open_images(recorded(tmp_path / f"{focal_px}_{size[0]}", infos=infos)) as bag:
            assert bag.calibration().k[0, 0] == 165.0
            assert any("changes at 0.4 s" in text for text in bag.remarks) == is_told


@pytest.mark.parametrize("first", [1, 3])
def test_of_cameras_that_take_turns_on_a_topic_one_is_used(tmp_path: Path, first: int) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        for number in range(12):
            is_right, now = number < first or number % 2 == 1, START + number * S // 15
            name, focal_px = ("right", 165.0) if is_right else ("left", 200.0)
            message = info(bag._store, k=(focal_px, 0.0, 79.5, 0.0, focal_px, 59.5, 0.0, 0.0, 1.0))
            message.header.frame_id = name
            bag.write("/camera_info", message, now)
            values = {"height": 120, "width": 160, "step": 160, "encoding": "mono8"}
            data = np.full(160 * 120, 200 if is_right else 50, np.uint8)
            header = bag.header(now, name)
            bag.write(
                "/image_raw",
                bag.new("sensor_msgs/msg/Image", header=header, data=data, **values),
                now,
            )
    with open_images(tmp_path / "bag") as bag:
        assert bag.calibration().k[0, 0] == 165.0
        assert {int(image.as_sent[0, 0]) for image in bag.images()} == {200}
        assert not any("zoom" in text for text in bag.remarks)
        assert any("frame left are left out, and those of right" in text for text in bag.remarks)
        assert bag.left_out("/image_raw") == ["the images of the frame left"]


def test_a_frame_that_is_renamed_for_good_is_one_camera(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        for number in range(12):
            now = START + number * S // 15
            bag.write("/camera_info", info(bag._store), now)
            header = bag.header(now, "old" if number < 6 else "new")
            values = {"height": 120, "width": 160, "step": 160, "encoding": "mono8"}
            data = np.zeros(160 * 120, np.uint8)
            bag.write(
                "/image_raw",
                bag.new("sensor_msgs/msg/Image", header=header, data=data, **values),
                now,
            )
    with open_images(tmp_path / "bag") as bag:
        bag.calibration()
        assert len(list(bag.images())) == 12
        assert bag.left_out("/image_raw") == [] and bag.remarks == []


@pytest.mark.parametrize("is_zoom", [True, False])
def test_a_calibration_that_the_images_contradict_is_told(tmp_path: Path, is_zoom: bool) -> None:
    wall = np.random.default_rng(1).uniform(50, 200, (12, 16))
    far = np.kron(wall, np.ones((10, 10))).astype(np.uint8)
    near = cv2.resize(far[12:-12, 16:-16], (160, 120))
    with BagWriter(tmp_path / "bag") as bag:
        for number in range(12):
            focal_px, seen = (206.25, near if is_zoom else far) if number > 5 else (165.0, far)
            k = (focal_px, 0.0, 79.5, 0.0, focal_px, 59.5, 0.0, 0.0, 1.0)
            now = START + number * S // 15
            bag.write("/camera_info", info(bag._store, k=k), now)
            kind, values = "sensor_msgs/msg/Image", {"height": 120, "width": 160, "step": 160}
            header = bag.header(now, "/left")
            image = bag.new(kind, header=header, data=seen.ravel(), encoding="mono8", **values)
            bag.write("/image_raw", image, now)
    with open_images(tmp_path / "bag") as bag:
        assert bag.calibration().k[0, 0] == 165.0
        (told,) = (text for text in bag.remarks if "changes at 0.4 s" in text)
    assert ("as by a zoom" in told) is is_zoom
    assert ("the images do not" in told and "--calibration" in told) is not is_zoom


@pytest.mark.parametrize(
    ("name", "advice"),
    [
        ("s.bag", "rosbag reindex"),
        ("s.bag.active", "rosbag reindex"),
        ("s.mcap.zstd", "zstd -d"),
        ("folder/s.db3.zstd", "zstd -d"),
    ],
)
def test_files_that_another_program_has_to_open_first(
    tmp_path: Path, name: str, advice: str
) -> None:
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    # The header of a ROS 1 bag whose recorder did not write the place of the index.
    fields = (
        b"op=\x03",
        b"index_pos=" + bytes(8),
        b"conn_count=" + bytes(4),
        b"chunk_count=" + bytes(4),
    )
    header = b"".join(len(field).to_bytes(4, "little") + field for field in fields)
    sized = len(header).to_bytes(4, "little") + header + (4000).to_bytes(4, "little") + bytes(4000)
    path.write_bytes(b"#ROSBAG V2.0\n" + sized)
    with (
        pytest.raises(BagError, match=advice),
        open_images(path.parent if name.startswith("folder") else path),
    ):
        pass


def test_without_any_calibration_the_fault_is_told(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    path = recorded(tmp_path / "none", infos=[info(store, 160, 120, (0.0,) * 9)] * 3)
    with open_images(path) as bag, pytest.raises(CameraError, match="not calibrated"):
        bag.calibration()


@pytest.mark.parametrize(
    "size", [(1280, 720), (640, 400), (1280, 1024), (120, 160), (720, 480), (2048, 1080)]
)
def test_a_camera_info_of_another_shape_is_refused(tmp_path: Path, size: tuple[int, int]) -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    path = recorded(tmp_path / "wide", infos=[info(store, *size)])
    with pytest.raises(CameraError, match=f"/camera_info is for images of {size[0]}x.*160x120"):
        RecordingRequest(path, EMPTY).open().__enter__()


@pytest.mark.parametrize("size", [(160, 120), (640, 480), (1296, 972)])
def test_a_camera_info_of_another_size_of_that_shape_is_used(
    tmp_path: Path, size: tuple[int, int]
) -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    with open_images(recorded(tmp_path / "bag", infos=[info(store, *size)])) as bag:
        assert bag.calibration().width == size[0]


@pytest.fixture
def parts(tmp_path: Path) -> Iterator[list[Path]]:
    """The files of three bags, four images each, which follow each other."""
    yield [
        next(recorded(tmp_path / f"part{n}", numbers=range(4 * n, 4 * n + 4)).glob("*.mcap"))
        for n in range(3)
    ]


def test_a_split_bag_without_metadata_is_one_recording(parts: list[Path], tmp_path: Path) -> None:
    folder = tmp_path / "all" / "session"
    folder.mkdir(parents=True)
    for number, part in enumerate(parts):
        part.rename(folder / f"session_{number}.mcap")
        (folder / f"._session_{number}.mcap").write_bytes(b"\0\5\x16\7" * 20)
    assert is_one_recording(folder)
    assert recordings_in(tmp_path / "all") == {"session": folder}
    np.testing.assert_allclose(seconds(folder), np.arange(12) / 15, atol=1e-6)


def test_files_of_other_names_are_recordings_of_their_own(
    parts: list[Path], tmp_path: Path
) -> None:
    folder = tmp_path / "takes"
    folder.mkdir()
    for number, part in enumerate(parts, 1):
        part.rename(folder / f"take_{number}.mcap")
    assert not is_one_recording(folder)
    assert len(recordings_in(folder)) == 3
    with pytest.raises(BagError, match="reindex"):
        BagReader(folder).__enter__()


def test_parts_of_which_one_is_missing_are_named() -> None:
    def found(*numbers: int) -> list[str]:
        return lone_parts([Path("all", f"take_{number}.mcap") for number in numbers])

    assert found(0, 2) == ["take_0.mcap", "take_2.mcap"]
    assert found(1, 2) == found(0) == lone_parts([Path("a_0.mcap"), Path("b_2.mcap")]) == []


def test_parts_that_are_apart_are_refused(tmp_path: Path) -> None:
    folder = tmp_path / "session"
    folder.mkdir()
    for number, first in enumerate((0, 15 * 3600)):
        part = recorded(tmp_path / f"part{number}", numbers=range(first, first + 4))
        next(part.glob("*.mcap")).rename(folder / f"session_{number}.mcap")
    with pytest.raises(BagError, match=r"begins 3600 s after .*ros2 bag reindex"):
        BagReader(folder).__enter__()


@pytest.mark.parametrize("empty", ['""', "''", "", "null", "other"])
@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_metadata_without_a_storage_are_those_of_the_files(
    tmp_path: Path, storage: str, empty: str
) -> None:
    with BagWriter(tmp_path / "bag", storage) as bag:
        write_images(bag, ["/image_raw"], range(12))
    file = tmp_path / "bag" / "metadata.yaml"
    text = re.sub(r"(storage_identifier: ).*", rf"\g<1>{empty}", file.read_text())
    file.write_text(text)
    np.testing.assert_allclose(seconds(tmp_path / "bag"), np.arange(12) / 15, atol=1e-6)


@pytest.mark.parametrize(
    ("encoding", "schema", "data"),
    [
        ("json", ("Pose", "jsonschema", b"{}"), b'{"x": 1}'),
        ("protobuf", ("Pose", "protobuf", b"\n\xff\xfe\x81\x00"), b"\x08\x01"),
        ("flatbuffer", ("Pose", "flatbuffer", b"\x18\xff"), b"\x00"),
        ("json", None, b"{}"),
        ("cdr", None, b"\0\1\0\0"),
    ],
)
def test_a_channel_that_is_no_ros_message_is_left_out_and_named(
    tmp_path: Path, encoding: str, schema: tuple[str, str, bytes] | None, data: bytes
) -> None:
    mcap = pytest.importorskip("mcap.writer", reason="mcap is not installed")
    reader = pytest.importorskip("mcap.reader")
    source = next(recorded(tmp_path / "bag").glob("*.mcap"))
    path = tmp_path / "mixed.mcap"
    with source.open("rb") as read, path.open("wb") as written:
        writer = mcap.Writer(written)
        writer.start(profile="ros2")
        channels: dict[int, int] = {}
        for kind, channel, message in reader.make_reader(read).iter_messages():
            if channel.id not in channels:
                number = writer.register_schema(kind.name, kind.encoding, kind.data)
                channels[channel.id] = writer.register_channel(channel.topic, "cdr", number)
            times = message.log_time, message.data, message.publish_time
            writer.add_message(channels[channel.id], *times)
        number = writer.register_schema(*schema) if schema else 0
        writer.add_message(writer.register_channel("/pose", encoding, number), START, data, START)
        writer.finish()
    with open_images(path) as bag:
        assert len(list(bag.images())) == 12
        assert bag.calibration().k[0, 0] == 165.0
        assert any(text.startswith("/pose is left out") for text in bag.remarks)


@pytest.mark.parametrize(
    ("topics", "chosen"),
    [
        (("/image_raw", "/image_raw/compressed"), "/image_raw"),
        (("/cam/image_raw", "/cam/image_raw/compressed"), "/cam/image_raw"),
        (("/cam/image_rect", "/cam/image_rect/compressed"), "/cam/image_rect"),
        (("/image_raw/compressed",), "/image_raw/compressed"),
    ],
)
def test_transports_of_one_camera_are_one_camera(
    tmp_path: Path, topics: tuple[str, ...], chosen: str
) -> None:
    with open_images(recorded(tmp_path / "bag", topics)) as bag:
        assert bag.image_topic() == chosen
        assert len(list(bag.images())) == 12
        assert bag.left_out(chosen) == [f"the images on {n}" for n in topics if n != chosen]


@pytest.mark.parametrize("kind", ["sensor_msgs/msg/CompressedImage", "foxglove_msgs/msg/Packet"])
def test_a_transport_that_is_not_read_is_named(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "bag"
    with BagWriter(path) as bag:
        header, data = bag.header(START, "left"), np.full(99, 7, np.uint8)
        if kind.startswith("sensor"):
            bag.write(
                "/image_raw/zstd", bag.new(kind, header=header, format="zstd", data=data), START
            )
        else:
            bag.write("/image_raw/ffmpeg", header, START)
    with open_images(path, GivenCamera(fov_deg=60.0)) as bag:
        if kind.startswith("sensor"):
            with pytest.raises(
                EncodingError, match=r"of the format 'zstd'.* image_transport repub"
            ):
                _ = next(bag.images()).as_sent
            return
        bag._open.connections[0] = bag._open.connections[0]._replace(msgtype=kind)
        with pytest.raises(BagError, match=r"/image_raw/ffmpeg has packets .*image_transport repu"):
            bag.image_topic()


def test_the_root_namespace_is_a_camera_beside_others(tmp_path: Path) -> None:
    path = recorded(tmp_path / "bag", ("/image_raw", "/depth/image_raw"))
    with RecordingRequest(path, EMPTY, ["/"]).open() as recording:
        assert recording.first.account.startswith("used")


@pytest.mark.parametrize("ending", ["png", "jpg"])
def test_hidden_files_are_no_images(tmp_path: Path, ending: str) -> None:
    for number in range(12):
        cv2.imwrite(str(tmp_path / f"img_{number}.{ending}"), np.full((48, 64), number, np.uint8))
        (tmp_path / f"._img_{number}.{ending}").write_bytes(b"\0\5\x16\7" * 20)
    with open_images(tmp_path, GivenCamera(fov_deg=60.0, fps=15.0)) as folder:
        times = [image.stamp_ns / 1e9 for image in folder.images()]
        np.testing.assert_allclose(times, np.arange(12) / 15)
        assert folder.duration_s == pytest.approx(11 / 15)
        assert folder.left_out("") == [f"12 hidden files (._img_0.{ending})"]


@pytest.mark.parametrize("ahead_s", [-3600, -5, 5, 86_400])
def test_times_count_from_the_start_whatever_the_cameras_clock(
    tmp_path: Path, ahead_s: int
) -> None:
    stamps = [START + n * S // 15 + ahead_s * S for n in range(12)]
    with open_images(recorded(tmp_path / "bag", stamps=stamps)) as bag:
        source = SilhouetteSource(bag, EMPTY)
        times = [image.time_s for image in source.images()]
        np.testing.assert_allclose(times, np.arange(12) / 15, atol=1e-6)
        assert any(
            f"{abs(ahead_s)} s {'ahead' if ahead_s > 0 else 'behind'}" in r for r in source.remarks
        )


def test_the_account_names_what_was_used_and_left_out(tmp_path: Path) -> None:
    numbers = range(14)
    stamps = [START + n * S // 15 for n in (*range(12), 11, 10)]
    with open_images(recorded(tmp_path / "bag", numbers=numbers, stamps=stamps)) as bag:
        source = SilhouetteSource(bag, EMPTY)
        list(source.frames())
        assert source.account == (
            f"used 12 images of /image_raw in {tmp_path / 'bag'}; left out 1 with the stamp of an "
            "earlier time, 1 with the stamp of the one before"
        )


CASES = os.environ.get("CASES", "")


@pytest.mark.skipif(not CASES, reason="CASES is not the folder of the cases")
@pytest.mark.parametrize(
    ("name", "times"),
    [
        ("apple-double/images", np.arange(12) / 15),
        ("raw-and-compressed/usb_cam", np.arange(12) / 15),
        ("reindexed-without-storage/reindexed", np.arange(12) / 15),
        ("ros1-camera-info/session.bag", np.arange(12) / 15),
        ("split-without-metadata/session", np.arange(12) / 15),
        ("zero-stamps/zero", np.arange(12) / 15),
        # The first image after the jump is left out; then the second pass follows the first one.
        ("stamps-go-back/looped", np.delete(np.arange(24), 12) / 15),
        ("trimmed/trimmed.mp4", np.arange(39) / 15),
    ],
)
def test_the_cases_have_their_times(name: str, times: Any) -> None:
    path = Path(CASES, name)
    is_film = path.name in ("images", "trimmed.mp4")
    camera = GivenCamera(fov_deg=60.0, fps=15.0 if path.is_dir() else None) if is_film else None
    with open_images(path, camera) as source:
        found = [image.stamp_ns / 1e9 for image in source.images()]
    np.testing.assert_allclose(np.subtract(found, found[0]), times, atol=1e-3)


@pytest.mark.skipif(not CASES, reason="CASES is not the folder of the cases")
def test_a_raw_stream_is_refused_without_its_rate() -> None:
    path = Path(CASES, "raw-h264/pi.h264")
    with pytest.raises(CardboxError, match="--fps HZ"):
        open_images(path, GivenCamera(fov_deg=60.0)).__enter__()
    with open_images(path, GivenCamera(fov_deg=60.0, fps=60.0)) as source:
        assert [image.stamp_ns / 1e9 for image in source.images()][-1] == pytest.approx(59 / 60)
