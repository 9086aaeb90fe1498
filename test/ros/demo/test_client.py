"""The demo's bag is like that of ``cardbox track --bag``: the shipped layouts show it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from rclpy.serialization import serialize_message

from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.skeleton import Group, names_of
from cardbox_tracker.person.urdf import urdf_from_body
from cardbox_tracker.recordings.outputs import TOPICS
from cardbox_tracker.recordings.result_bag import result_writer
from cardbox_tracker.ros.demo.run import Client, topics_of

NAMES = (
    *("body_model", "robot_description", "silhouette", "silhouette/camera_info", "overlay"),
    "tf",
)


@pytest.fixture
def recorded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ros_domains: Iterator[int]
) -> dict[str, Any]:
    """Topics of a bag with one message of each topic."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(next(ros_domains)))
    with result_writer(tmp_path / "bag") as bag:
        client: Any = Client(nodes=None, bag=bag)
        try:
            for topic, (kind, _) in topics_of().items():
                message = kind()
                if topic.startswith("joint_states"):
                    message.name = [*names_of(*{*Group} - {Group.HAND})]
                    message.position = [0.0] * len(message.name)
                if topic == "robot_description":
                    message.data = urdf_from_body(BodyModel())
                client.recorder(topic, kind)(serialize_message(message))
        finally:
            client.close()
    text = (tmp_path / "bag" / "metadata.yaml").read_text()
    found = yaml.safe_load(text)["rosbag2_bagfile_information"]["topics_with_message_count"]
    return {entry["topic_metadata"]["name"]: entry["topic_metadata"] for entry in found}


def test_it_has_every_topic_by_its_full_name(recorded: dict[str, Any]) -> None:
    assert set(recorded) == {f"/{name}" for name in (*NAMES, *TOPICS)}


def test_several_cameras_have_topics_below_their_namespaces() -> None:
    names = set(topics_of(["cam0", "cam1"]))
    of_camera = {"silhouette", "silhouette/camera_info", "overlay"}
    assert names - set(topics_of()) == {
        f"{c}/{name}" for c in ("cam0", "cam1") for name in of_camera
    }
    assert set(topics_of()) - names == of_camera


def test_what_is_latched_is_latched_when_it_is_played(recorded: dict[str, Any]) -> None:
    latched = {name for name, entry in recorded.items() if entry["offered_qos_profiles"]}
    assert latched == {"/body_model", "/robot_description"}
