"""The node ``camera`` plays a video file like a camera, and reports faulty sources."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from sensor_msgs.msg import CameraInfo, Image

from cardbox_tracker.ros.messages.conversions import stamp_ns
from cardbox_tracker.ros.runtime import qos

CALIBRATION = """\
image_width: 64
image_height: 48
camera_name: test
distortion_model: plumb_bob
camera_matrix: {rows: 3, cols: 3, data: [60.0, 0, 31.5, 0, 60.0, 23.5, 0, 0, 1]}
distortion_coefficients: {rows: 1, cols: 5, data: [0.1, 0, 0, 0, 0]}
"""


@pytest.fixture(scope="module")
def video(tmp_path_factory: Any) -> Path:
    path = Path(tmp_path_factory.mktemp("video")) / "video.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 20.0, (64, 48))
    assert writer.isOpened()
    for number in range(20):
        writer.write(np.full((48, 64, 3), 10 * number, np.uint8))
    writer.release()
    return path


def test_video_and_calibration_come_out_at_the_rate(
    graph: Any, video: Path, tmp_path: Path
) -> None:
    calibration = tmp_path / "camera.yaml"
    calibration.write_text(CALIBRATION)
    images = graph.collect(Image, "image_raw", qos.REPLAY)
    infos = graph.collect(CameraInfo, "camera_info", qos.REPLAY)
    process = graph.start(
        "camera", file=video, loop=True, rate_hz=20.0, calibration_file=calibration, frame_id="eye"
    )
    graph.wait(lambda: len(images) >= 25 and len(infos) >= 25, "images beyond the file's end")
    assert (images[0].width, images[0].height, images[0].encoding) == (64, 48, "mono8")
    assert images[0].header.frame_id == infos[0].header.frame_id == "eye"
    assert (infos[0].k[0], infos[0].d[0]) == (60.0, 0.1)
    # The topic that DDS matched first has more messages.
    stamps = [[stamp_ns(m.header.stamp) for m in messages] for messages in (images, infos)]
    first, last = max(s[0] for s in stamps), min(s[-1] for s in stamps)
    shared = [[at for at in each if first <= at <= last] for each in stamps]
    assert shared[0] == shared[1] and len(shared[0]) > 1
    # Even a slow machine must not exceed the requested rate.
    span_s = (stamps[0][24] - stamps[0][0]) / 1e9
    assert span_s > 0.8 * 24 * 0.05
    assert process.stop() == 0


def test_a_video_is_seen_from_its_beginning_and_says_what_it_lacks(
    own_graph: Any, video: Path
) -> None:
    process = own_graph.start("camera", file=video, rate_hz=40.0)
    own_graph.wait(lambda: "a subscriber of /image_raw" in process.text(), "the words")
    assert "horizontal_fov_deg:=60.0" in process.text()
    own_graph.spin(0.5)
    images = own_graph.collect(Image, "image_raw", qos.REPLAY)
    own_graph.wait(lambda: len(images) == 20, "all images")
    assert images[0].data[0] < 5


def test_a_video_has_its_own_rate_unless_another_one_is_given(
    own_graph: Any, tmp_path: Path
) -> None:
    path, count, slow_hz = tmp_path / "slow.avi", 8, 5.0
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), slow_hz, (64, 48))
    for _ in range(count + 1):
        writer.write(np.zeros((48, 64, 3), np.uint8))
    writer.release()
    # An image that is damaged takes its time, and does not end the video.
    data = bytearray(path.read_bytes())
    at = [found.start() for found in re.finditer(b"00dc", data)][4]
    data[at + 8 : at + 208] = bytes(200)
    path.write_bytes(data)
    own_graph.start("camera", file=path)
    images = own_graph.collect(Image, "image_raw", qos.REPLAY)
    own_graph.wait(lambda: len(images) == count, "all images")
    span_s = (stamp_ns(images[-1].header.stamp) - stamp_ns(images[0].header.stamp)) / 1e9
    # Even a slow machine must not exceed the file's rate.
    assert span_s > 0.9 * count / slow_hz


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"device": "/dev/video_none"}, ("no camera /dev/video_none", "file")),
        ({"file": "/nowhere.mp4"}, ("no video /nowhere.mp4",)),
        ({"file": __file__}, ("OpenCV cannot read", "ffmpeg")),
        ({"device": "''"}, ("both empty",)),
        ({"file": "VIDEO", "calibration_file": "/nowhere.yaml"}, ("/nowhere.yaml",)),
    ],
)
def test_a_source_that_cannot_be_opened_says_what_to_do(
    graph: Any, video: Path, parameters: dict[str, str], words: tuple[str, ...]
) -> None:
    given = {name: value.replace("VIDEO", str(video)) for name, value in parameters.items()}
    process = graph.start("camera", **given)
    assert graph.ended(process) == 1
    for word in words:
        assert word in process.text()
    assert "Traceback" not in process.text()


def test_devices_are_listed_without_a_graph(graph: Any) -> None:
    process = graph.start("camera", "--list")
    assert graph.ended(process) == 0
    assert "video" in process.text() and "Traceback" not in process.text()


def test_an_unknown_option_is_told_without_a_traceback(graph: Any) -> None:
    for name, wrong in (("camera", "--lst"), ("play_bag", "--rate=fast"), ("cardbox_nodes", "x")):
        process = graph.start(name, wrong)
        assert graph.ended(process) == 2
        assert wrong.split("=")[-1] in process.text() and "usage:" in process.text()
        assert "Traceback" not in process.text()
