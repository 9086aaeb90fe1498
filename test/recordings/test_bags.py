"""Recordings written and read back, and the refusal of what is none; no ROS needed."""

from __future__ import annotations

import itertools
import os
import re
import resource
import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
import yaml

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.errors import BagError, CameraError, CardboxError
from cardbox_tracker.person.skeleton import JOINT_NAMES
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.recordings.bag_writer import STORAGES, BagWriter

CAMERA = Camera(32, 24, 33.0, 34.0, 15.5, 11.0)
START_NS = 1_700_000_000_000_000_000
IMAGE, INFO = "/camera/image_raw", "/camera/camera_info"
COUNT = 20


def image(number: int) -> Any:
    return np.random.default_rng(number).integers(0, 256, (24, 32), dtype=np.uint8)


def stamp(number: int) -> int:
    return START_NS + number * 66_666_667


def record(path: Path, storage: str = "mcap", count: int = COUNT) -> Path:
    with BagWriter(path, storage) as bag:
        for number in range(count):
            bag.write_camera_info(INFO, stamp(number), "optical", CAMERA)
            bag.write_image(IMAGE, stamp(number), "optical", image(number), "mono8")
            bag.write_joint_state(
                "/truth", stamp(number), "optical", JOINT_NAMES, np.full(12, number)
            )
    return path


def storage_file(path: Path) -> Path:
    return next(file for file in path.iterdir() if file.suffix in (".mcap", ".db3"))


@pytest.fixture(params=sorted(STORAGES))
def storage(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def test_what_is_written_is_read_back(tmp_path: Path, storage: str) -> None:
    with BagReader(record(tmp_path / "bag", storage)) as bag:
        assert bag.start_ns == START_NS
        assert bag.duration_s == pytest.approx((COUNT - 1) * 0.066_666_667, abs=1e-12)
        assert bag.topics == {
            IMAGE: "sensor_msgs/msg/Image",
            INFO: "sensor_msgs/msg/CameraInfo",
            "/truth": "sensor_msgs/msg/JointState",
        }
        assert bag.count() == 3 * COUNT
        assert bag.count([IMAGE]) == COUNT
        assert (bag.image_topic(), bag.camera_info_topic()) == (IMAGE, INFO)
        calibration = bag.calibration()
        assert calibration.camera(32, 24) == CAMERA
        assert calibration.frame_id == "optical"
        for number, got in itertools.zip_longest(range(COUNT), bag.images()):
            assert (got.stamp_ns, got.frame_id) == (stamp(number), "optical")
            np.testing.assert_array_equal(got.as_sent, image(number))
        last = [bag.deserialize(message) for message in bag.messages(["/truth"])][-1]
        assert tuple(last.name) == JOINT_NAMES
        np.testing.assert_array_equal(last.position, COUNT - 1)


def test_a_folder_may_be_named_like_a_file_of_ros_1(tmp_path: Path, storage: str) -> None:
    with BagReader(record(tmp_path / "a.bag", storage)) as bag:
        assert bag.count([IMAGE]) == COUNT


def test_messages_come_in_the_order_of_their_time(tmp_path: Path, storage: str) -> None:
    order = np.random.default_rng(0).permutation(200)
    with BagWriter(tmp_path / "bag", storage) as bag:
        for number in order:
            topic = f"/text{number % 3}"
            bag.write_string(topic, stamp(int(number)), "x" * 20_000)
    with BagReader(tmp_path / "bag") as bag:
        times = [message.time_ns for message in bag.messages()]
    assert times == [stamp(number) for number in range(200)]


def test_raw_bytes_of_one_recording_go_into_another_unchanged(tmp_path: Path, storage: str) -> None:
    with (
        BagReader(record(tmp_path / "a", "mcap")) as bag,
        BagWriter(tmp_path / "b", storage) as out,
    ):
        first = list(bag.messages())
        for message in first:
            out.write_raw(message.topic, message.msgtype, message.raw, message.time_ns)
    with BagReader(tmp_path / "b") as bag:
        assert sorted(bag.messages()) == sorted(first)
    assert first[0].raw[:4] == b"\x00\x01\x00\x00"


def test_compressed_images_are_found_and_decoded(tmp_path: Path, storage: str) -> None:
    smooth = np.broadcast_to(np.arange(0, 240, 10, dtype=np.uint8)[:, None], (24, 32))
    jpeg = cv2.imencode(".jpg", smooth, [cv2.IMWRITE_JPEG_QUALITY, 95])[1].tobytes()
    with BagWriter(tmp_path / "bag", storage) as bag:
        bag.write_camera_info(INFO, START_NS, "optical", CAMERA)
        bag.write_compressed(f"{IMAGE}/compressed", START_NS, "optical", jpeg)
    with BagReader(tmp_path / "bag") as bag:
        assert bag.camera_info_topic() == INFO
        (got,) = bag.images()
        np.testing.assert_allclose(got.as_sent, smooth, atol=4)


@pytest.mark.parametrize("encoding", ["rgb8", "bgr8"])
def test_a_colour_image_keeps_its_colours(tmp_path: Path, encoding: str) -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (24, 32, 3), dtype=np.uint8)
    with BagWriter(tmp_path / "bag") as bag:
        bag.write_image(IMAGE, START_NS, "optical", pixels, encoding)
    with BagReader(tmp_path / "bag") as bag:
        (got,) = bag.images()
        np.testing.assert_array_equal(
            got.as_sent, pixels if encoding == "bgr8" else pixels[:, :, ::-1]
        )


def test_reading_is_lazy(tmp_path: Path, storage: str) -> None:
    """The first image comes although the last one's bytes are no image."""
    with BagWriter(tmp_path / "bag", storage) as bag:
        bag.write_image(IMAGE, stamp(0), "optical", image(0), "mono8")
        bag.write_image(IMAGE, stamp(1), "optical", image(1), "32FC1")
    with BagReader(tmp_path / "bag") as bag:
        np.testing.assert_array_equal(next(bag.images()).as_sent, image(0))


def test_a_single_file_and_a_session_folder_are_recordings_too(
    tmp_path: Path, storage: str
) -> None:
    folder = record(tmp_path / "bag", storage)
    with BagReader(storage_file(folder)) as bag:
        assert bag.count() == 3 * COUNT
    (tmp_path / "session").mkdir()
    shutil.move(folder, tmp_path / "session" / "bag")
    with BagReader(tmp_path / "session") as bag:
        assert bag.count() == 3 * COUNT


def test_mcap_tools_read_the_schemas(tmp_path: Path) -> None:
    reader = pytest.importorskip("mcap.reader", reason="the tools of mcap are not installed")
    decoder = pytest.importorskip("mcap_ros2.decoder", reason="mcap-ros2-support is missing")
    with storage_file(record(tmp_path / "bag")).open("rb") as stream:
        tools = reader.make_reader(stream, decoder_factories=[decoder.DecoderFactory()])
        decoded = [(c.topic, m) for _, c, _, m in tools.iter_decoded_messages()]
    assert len(decoded) == 3 * COUNT
    images = [message for topic, message in decoded if topic == IMAGE]
    assert bytes(images[3].data) == image(3).tobytes()
    assert images[3].header.frame_id == "optical"


def test_the_metadata_names_jazzys_type_hashes(tmp_path: Path, storage: str) -> None:
    text = (record(tmp_path / "bag", storage) / "metadata.yaml").read_text()
    information = yaml.safe_load(text)["rosbag2_bagfile_information"]
    assert information["storage_identifier"] == storage
    hashes = {
        entry["topic_metadata"]["type"]: entry["topic_metadata"]["type_description_hash"].strip()
        for entry in information["topics_with_message_count"]
    }
    # As ROS 2 Jazzy's own sensor_msgs 5.3 has them.
    assert hashes["sensor_msgs/msg/Image"] == (
        "RIHS01_d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47"
    )
    assert hashes["sensor_msgs/msg/CameraInfo"] == (
        "RIHS01_b3dfd68ff46c9d56c80fd3bd4ed22c7a4ddce8c8348f2f59c299e73118e7e275"
    )


# What is no recording


def refusal(path: Path) -> str:
    """What is said of a recording when all its images are asked for."""
    with pytest.raises(BagError) as error, BagReader(path) as bag:
        for each in bag.images():
            assert each.as_sent.size
    return str(error.value)


def test_a_missing_path_is_named(tmp_path: Path) -> None:
    assert str(tmp_path / "nothing") in refusal(tmp_path / "nothing")


def test_a_folder_without_recording_is_refused(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("x")
    assert "metadata.yaml" in refusal(tmp_path)


@pytest.mark.parametrize("name", ["film.mp4", "bag.mcap", "bag.db3", "bag.bag"])
@pytest.mark.parametrize("data", [b"", b"something else", bytes(5000)])
def test_a_file_of_another_kind_is_refused(tmp_path: Path, name: str, data: bytes) -> None:
    (tmp_path / name).write_bytes(data)
    assert str(tmp_path / name) in refusal(tmp_path / name)


@pytest.mark.parametrize("text", ["", "{", "a: 1", "rosbag2_bagfile_information: {version: 99}"])
def test_damaged_metadata_is_refused(tmp_path: Path, text: str) -> None:
    folder = record(tmp_path / "bag")
    (folder / "metadata.yaml").write_text(text)
    assert str(folder) in refusal(folder)


def test_metadata_of_another_type_are_refused_without_the_words_of_python(tmp_path: Path) -> None:
    folder = record(tmp_path / "bag")
    whole = (folder / "metadata.yaml").read_text()
    (folder / "metadata.yaml").write_text(re.sub(r"version: \d+", "version: ;", whole))
    assert "of another type, size or range" in refusal(folder)


def test_a_recording_without_messages_is_refused(tmp_path: Path, storage: str) -> None:
    with BagWriter(tmp_path / "bag", storage):
        pass
    assert "no messages" in refusal(tmp_path / "bag")


def test_a_recording_without_images_lists_its_topics(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        bag.write_string("/chatter", START_NS, "hello")
    text = refusal(tmp_path / "bag")
    assert "0 image topics" in text
    assert "/chatter (std_msgs/msg/String)" in text


def test_a_bag_of_results_is_known_for_one(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        for name in ("/overlay", "/silhouette"):
            bag.write_image(name, START_NS, "optical", image(0), "mono8")
        bag.write_string("/tracking_state", START_NS, "tracking")
    text = refusal(tmp_path / "bag")
    assert "a bag of results" in text and "give the recording" in text
    assert "--cameras" not in text


def test_several_image_topics_are_listed(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        for side in ("left", "right"):
            bag.write_image(f"/{side}/image_raw", START_NS, "optical", image(0), "mono8")
            bag.write_camera_info(f"/{side}/camera_info", START_NS, "optical", CAMERA)
    text = refusal(tmp_path / "bag")
    assert "2 image topics" in text
    assert "/left/image_raw" in text
    assert "/right/image_raw" in text
    with BagReader(tmp_path / "bag") as bag:
        (got,) = bag.images("/left/image_raw")
        np.testing.assert_array_equal(got.as_sent, image(0))


def test_a_topic_that_is_not_there_is_named_with_those_that_are(tmp_path: Path) -> None:
    with BagReader(record(tmp_path / "bag")) as bag:
        with pytest.raises(BagError, match=rf"/nose.*{IMAGE}"):
            list(bag.messages(["/nose"]))
        with pytest.raises(BagError, match=rf"/nose.*{IMAGE}"):
            list(bag.images("/nose"))


def test_a_recording_without_camera_info_says_so(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        bag.write_image(IMAGE, START_NS, "optical", image(0), "mono8")
    with BagReader(tmp_path / "bag") as bag, pytest.raises(BagError, match="0 CameraInfo"):
        bag.calibration()


def test_an_uncalibrated_camera_is_refused_with_both_topics(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        bag.write_image(IMAGE, START_NS, "optical", image(0), "mono8")
        unknown: Any = SimpleNamespace(width=32, height=24, k=np.zeros((3, 3)))
        bag.write_camera_info(INFO, START_NS, "optical", unknown)
    with BagReader(tmp_path / "bag") as bag, pytest.raises(CameraError, match=f"{IMAGE}.*{INFO}"):
        bag.calibration()


@pytest.mark.parametrize("keeps_metadata", [True, False])
@pytest.mark.parametrize("part", [0.0, 0.001, 0.3, 0.7, 0.9])
def test_a_truncated_recording_is_refused(
    tmp_path: Path, storage: str, part: float, keeps_metadata: bool
) -> None:
    folder = record(tmp_path / "bag", storage, count=300)
    file = storage_file(folder)
    os.truncate(file, int(part * file.stat().st_size))
    if not keeps_metadata:
        (folder / "metadata.yaml").unlink()
    assert str(folder) in refusal(folder)


def test_a_message_that_is_damaged_is_refused_on_the_way(tmp_path: Path) -> None:
    folder = record(tmp_path / "bag", count=300)
    file = storage_file(folder)
    data = bytearray(file.read_bytes())
    place = data.index(image(0).tobytes()[:40])
    # The lengths of the message's strings, so that it no longer deserializes.
    data[place - 60 : place] = b"\xff" * 60
    file.write_bytes(data)
    assert "damaged" in refusal(folder)


def test_a_reader_that_is_not_open_says_so(tmp_path: Path) -> None:
    with pytest.raises(BagError, match="not open"):
        BagReader(record(tmp_path / "bag")).image_topic()


# Writing


def test_an_error_leaves_nothing_behind(tmp_path: Path, storage: str) -> None:
    with pytest.raises(RuntimeError), BagWriter(tmp_path / "bag", storage) as bag:
        bag.write_string("/text", START_NS, "x")
        raise RuntimeError
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("count", [2, 200])
def test_a_full_disk_is_told_with_the_path_of_the_bag(tmp_path: Path, count: int) -> None:
    """A limit of the size stands for the disk, met by a chunk on the way or at the end."""
    path, noise = tmp_path / "bag", np.random.default_rng(0).bytes(20_000)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, before[1]))
    try:
        told = rf"cannot write {path}: File too large; make room"
        with pytest.raises(CardboxError, match=told), BagWriter(path) as bag:
            for number in range(count):
                bag.write_compressed("/image/compressed", stamp(number), "camera", noise)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert not list(tmp_path.iterdir())


def test_an_error_keeps_the_recording_that_was_there(tmp_path: Path) -> None:
    record(tmp_path / "bag")
    with pytest.raises(RuntimeError), BagWriter(tmp_path / "bag", overwrite=True) as bag:
        bag.write_string("/text", START_NS, "x")
        raise RuntimeError
    with BagReader(tmp_path / "bag") as bag:
        assert bag.count() == 3 * COUNT
    assert [path.name for path in tmp_path.iterdir()] == ["bag"]


def test_a_recording_appears_only_when_it_is_whole(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        bag.write_string("/text", START_NS, "x")
        (bag.folder / "notes.txt").write_text("beside")
        assert not (tmp_path / "bag").exists()
    assert (tmp_path / "bag" / "notes.txt").read_text() == "beside"
    assert (tmp_path / "bag" / "bag.mcap").exists()


def test_a_recording_is_replaced_only_when_asked_to(tmp_path: Path) -> None:
    record(tmp_path / "bag")
    with pytest.raises(BagError, match="is a recording"):
        BagWriter(tmp_path / "bag")
    with BagWriter(tmp_path / "bag", overwrite=True) as bag:
        bag.write_string("/text", START_NS, "x")
    with BagReader(tmp_path / "bag") as bag:
        assert bag.count() == 1


@pytest.mark.parametrize("is_file", [True, False])
def test_what_is_no_recording_is_never_replaced(tmp_path: Path, is_file: bool) -> None:
    target = tmp_path / "thesis"
    if is_file:
        target.write_text("chapter one")
    else:
        target.mkdir()
        (target / "chapter.txt").write_text("one")
    with pytest.raises(BagError, match="not a recording"):
        BagWriter(target)


def test_an_unknown_storage_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BagError, match=r"'hdf5'.*mcap.*sqlite3"):
        BagWriter(tmp_path / "bag", storage="hdf5")


def test_a_folder_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(BagError, match="cannot write"), BagWriter(tmp_path / "file" / "bag"):
        pass
