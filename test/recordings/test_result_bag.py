"""The tools of mcap read the bag of results: all topics, their schemas and type hashes."""

from __future__ import annotations

import importlib.util
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from cardbox_tracker.applications.drawing.overlay import draw_sharp_overlay
from cardbox_tracker.common.errors import BagError
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.recordings.recording import Recording
from cardbox_tracker.recordings.result_bag import result_bag
from cardbox_tracker.recordings.result_reader import namespace_of, results_in
from cardbox_tracker.recordings.silhouettes import SilhouetteSource, TimeSpan
from cardbox_tracker.recordings.track import TrackSummary, track_recording
from cardbox_tracker.search.config import default_preset
from cardbox_tracker.tracking.session import Session
from cardbox_tracker.tracking.tracker import Tracker

# As ROS 2 Jazzy's own message packages have them.
TYPES = {
    "/body_model": "std_msgs/msg/String",
    "/robot_description": "std_msgs/msg/String",
    "/silhouette": "sensor_msgs/msg/Image",
    "/silhouette/camera_info": "sensor_msgs/msg/CameraInfo",
    "/overlay": "sensor_msgs/msg/Image",
    "/tracking_state": "std_msgs/msg/String",
    "/joint_states": "sensor_msgs/msg/JointState",
    "/keypoint_states": "diagnostic_msgs/msg/DiagnosticArray",
    "/place_state": "diagnostic_msgs/msg/DiagnosticArray",
    "/joint_states_stddev": "sensor_msgs/msg/JointState",
    "/keypoints": "geometry_msgs/msg/PoseArray",
    "/markers": "visualization_msgs/msg/MarkerArray",
    "/tf": "tf2_msgs/msg/TFMessage",
}


@pytest.fixture(scope="module")
def results(
    recording: Any, source: SilhouetteSource, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, TrackSummary]:
    folder = tmp_path_factory.mktemp("results")
    with result_bag(folder / "bag", source.frame_id, draw=draw_sharp_overlay) as bag:
        session = Session([recording.body], source.camera)
        summary = track_recording(Recording([""], [source]), session, TimeSpan(0.0, np.inf), (bag,))
    return folder / "bag", summary


@pytest.fixture(scope="module")
def decoded(results: tuple[Path, TrackSummary]) -> dict[str, list[Any]]:
    reader = pytest.importorskip("mcap.reader", reason="the tools of mcap are not installed")
    decoder = pytest.importorskip("mcap_ros2.decoder", reason="mcap-ros2-support is missing")
    messages: dict[str, list[Any]] = {}
    with next(results[0].glob("*.mcap")).open("rb") as stream:
        tools = reader.make_reader(stream, decoder_factories=[decoder.DecoderFactory()])
        for _, channel, _, message in tools.iter_decoded_messages():
            messages.setdefault(channel.topic, []).append(message)
    return messages


def test_every_topic_is_there_once_an_image(
    decoded: dict[str, list[Any]], results: tuple[Path, TrackSummary]
) -> None:
    summary = results[1]
    assert set(decoded) == set(TYPES)
    for topic in ("/silhouette", "/silhouette/camera_info", "/overlay", "/tracking_state"):
        assert len(decoded[topic]) == summary.frames
    for topic in ("/joint_states", "/joint_states_stddev", "/keypoints", "/tf"):
        assert len(decoded[topic]) == summary.frames_tracked < summary.frames
    assert len(decoded["/body_model"]) == len(decoded["/robot_description"]) == 1
    states = [message.data for message in decoded["/tracking_state"]]
    assert states[0] == "no_person"
    assert sum(state in ("tracking", "uncertain") for state in states) == summary.frames_tracked


def test_markers_follow_the_person_and_go_with_them(decoded: dict[str, list[Any]]) -> None:
    shown = [array for array in decoded["/markers"] if array.markers[0].action == 0]
    assert len(shown) == len(decoded["/joint_states"])
    for array, points in zip(shown, decoded["/keypoints"], strict=True):
        triangles, bones = array.markers
        assert (triangles.ns, triangles.type, len(triangles.points)) == ("patches", 11, 90)
        assert (bones.ns, bones.type, len(bones.points)) == ("skeleton", 5, 16)
        hand, last = points.poses[2].position, bones.points[9]
        np.testing.assert_allclose((last.x, last.y, last.z), (hand.x, hand.y, hand.z), atol=1e-9)


def test_images_are_those_of_the_tracker(
    decoded: dict[str, list[Any]], source: SilhouetteSource
) -> None:
    for frame, silhouette in zip(source.frames(0.0, 8.0), decoded["/silhouette"], strict=False):
        assert bytes(silhouette.data) == frame.silhouette.tobytes()
    overlay = decoded["/overlay"][-1]
    # Twice the size of the silhouettes, for lines and text.
    assert (overlay.encoding, overlay.width, overlay.height) == ("bgr8", 640, 480)


def test_type_hashes_are_those_of_the_installed_messages(
    results: tuple[Path, TrackSummary],
) -> None:
    pytest.importorskip("rclpy", reason="rclpy is not installed")
    text = (results[0] / "metadata.yaml").read_text()
    information = yaml.safe_load(text)["rosbag2_bagfile_information"]
    for entry in information["topics_with_message_count"]:
        topic = entry["topic_metadata"]
        assert topic["type"] == TYPES[topic["name"]]
        # PyPI has no tf2_msgs.
        if topic["name"] != "/tf" or importlib.util.find_spec("tf2_msgs"):
            assert topic["type_description_hash"] == installed_hash(topic["type"])


def installed_hash(kind: str) -> str:
    package, _, name = kind.split("/")
    prefix = Path(importlib.import_module(package).__file__ or "").parents[4]
    found = prefix / "share" / package / "msg" / f"{name}.json"
    if not found.exists():
        pytest.skip("the message packages are installed without their descriptions")
    hashes = json.loads(found.read_text())["type_hashes"]
    return str(next(h["hash_string"] for h in hashes if h["type_name"] == kind))


def test_latched_topics_are_latched_when_played(results: tuple[Path, TrackSummary]) -> None:
    text = (results[0] / "metadata.yaml").read_text()
    information = yaml.safe_load(text)["rosbag2_bagfile_information"]
    durabilities = {
        entry["topic_metadata"]["name"]: [
            profile["durability"] for profile in entry["topic_metadata"]["offered_qos_profiles"]
        ]
        for entry in information["topics_with_message_count"]
    }
    assert durabilities["/body_model"] == durabilities["/robot_description"]
    assert durabilities["/body_model"] in (["transient_local"], [1])


def test_several_people_have_a_namespace_each(
    recording: Any, source: SilhouetteSource, tmp_path: Path
) -> None:
    frames = list(source.frames(0.0, 0.3))
    tracker = Tracker(recording.body, source.camera, default_preset())
    found = tracker.track(frames[-1].silhouette)
    with result_bag(tmp_path / "bag", source.frame_id) as write:
        for frame in frames:
            for person in (1, 2):
                write(frame, replace(found, person=person), tracker)
    with BagReader(tmp_path / "bag") as bag:
        names = {topic.partition("/person_")[2] for topic in bag.topics if "person" in topic}
        assert {name.partition("/")[0] for name in names} == {"1", "2"}
        assert "/joint_states" not in bag.topics and "/tf" not in bag.topics
        silhouettes = list(bag.messages(["/silhouette"]))
        assert len(silhouettes) == len(frames)
        assert namespace_of(bag) == "/person_1" and namespace_of(bag, 2) == "/person_2"
        assert len(results_in(bag, 2).state) == len(frames)
        with pytest.raises(BagError, match="has no results of person 3"):
            namespace_of(bag, 3)
