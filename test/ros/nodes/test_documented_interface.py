"""The nodes have the topics of docs/topics.md, and the layouts show published topics."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import DEFAULT, patch

import cv2
import numpy as np
import pytest
import rclpy
import yaml
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from cardbox_tracker.applications.simulation.session import session_camera
from cardbox_tracker.detectors.detector import PersonDetector
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.skeleton import JOINT_NAMES, Group, names_of
from cardbox_tracker.person.urdf import ROOT_LINK, LinkTransforms, urdf_from_body
from cardbox_tracker.recordings.bag_writer import BagWriter
from cardbox_tracker.ros.nodes import tracker_node
from cardbox_tracker.ros.nodes.background_node import BackgroundNode
from cardbox_tracker.ros.nodes.camera_node import CameraNode
from cardbox_tracker.ros.nodes.detector_node import DetectorNode
from cardbox_tracker.ros.nodes.initializer_node import InitializerNode
from cardbox_tracker.ros.nodes.play_bag_node import PlayBagNode
from cardbox_tracker.ros.nodes.retarget_node import RetargetNode
from cardbox_tracker.ros.nodes.rula_node import RulaNode
from cardbox_tracker.ros.nodes.stereo_depth_node import StereoDepthNode
from cardbox_tracker.ros.nodes.teleoperation_node import TeleoperationNode
from cardbox_tracker.ros.nodes.tracker_node import TrackerNode
from cardbox_tracker.ros.runtime.command_line import SERVICE, entries

ROOT = Path(__file__).parents[3]
NODES = (
    "camera",
    "play_bag",
    "background",
    "stereo_depth",
    "detector",
    "initializer",
    "tracker",
    "rula",
    "retarget",
    "teleoperation",
)
ARM = {
    "robot_file": str(ROOT / "config" / "example_arm.urdf"),
    "joint_map_file": str(ROOT / "config" / "example_joint_map.yaml"),
}
# rclpy adds these to every node.
OF_EVERY_NODE = ("/rosout", "/parameter_events")
ALL_NAMES = names_of(*{*Group} - {Group.HAND})
BAG_TOPIC = "/of_the_bag/camera_info"


class Topic(NamedTuple):
    name: str
    direction: str
    kind: str
    qos: str


def table(node: str) -> tuple[set[Topic], set[str]]:
    """Return the documented topics and services of a node by full name."""
    found = entries(node)
    return (
        {Topic(full(e.name), e.direction, e.type, e.qos) for e in found if e.direction != SERVICE},
        {full(e.name) for e in found if e.direction == SERVICE},
    )


def full(name: str) -> str:
    return name if name.startswith("/") else f"/{name}"


def qos_text(profile: QoSProfile) -> str:
    if profile.durability == DurabilityPolicy.TRANSIENT_LOCAL:
        return f"latched, {profile.depth}"
    is_reliable = profile.reliability == ReliabilityPolicy.RELIABLE
    return f"{'reliable' if is_reliable else 'best effort'}, {profile.depth}"


def kind_text(message: Any) -> str:
    return f"{message.__module__.split('.')[0]}/{message.__name__}"


def interface_of(node: Any) -> tuple[set[Topic], set[str]]:
    topics = {
        Topic(end.topic_name, direction, kind_text(end.msg_type), qos_text(end.qos_profile))
        for direction, ends in (("in", node.subscriptions), ("out", node.publishers))
        for end in ends
        if not end.topic_name.startswith((*OF_EVERY_NODE, BAG_TOPIC))
    }
    services = {
        service.srv_name
        for service in node.services
        if kind_text(service.srv_type).startswith("std_srvs/")
    }
    return topics, {
        name if name.startswith("/") else node.resolve_service_name(name) for name in services
    }


@pytest.fixture
def make(tmp_path: Path) -> Iterator[Callable[..., Any]]:
    """Create a node of a class with parameters; all are closed at the end."""
    rclpy.init(args=[])
    made = []

    def create(kind: type, **parameters: Any) -> Any:
        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        node = kind(parameter_overrides=overrides, enable_rosout=False)
        made.append(node)
        return node

    yield create
    for node in made:
        node.close()
        node.destroy_node()
    rclpy.shutdown()


def nodes_called(name: str, make: Callable[..., Any], folder: Path) -> list[Any]:
    if name == "background":
        return [
            *(make(BackgroundNode, image_transport=kind) for kind in ("raw", "compressed")),
            make(BackgroundNode, depth="DEPTH", within_m=2.5),
        ]
    if name == "camera":
        video = folder / "video.avi"
        writer = cv2.VideoWriter(str(video), cv2.VideoWriter.fourcc(*"MJPG"), 15.0, (64, 48))
        writer.write(np.zeros((48, 64, 3), np.uint8))
        writer.release()
        return [make(CameraNode, file=str(video))]
    if name == "play_bag":
        with BagWriter(folder / "bag") as bag:
            bag.write_camera_info(BAG_TOPIC, 1, "camera", session_camera())
        return [make(PlayBagNode, bag=str(folder / "bag"))]
    if name == "stereo_depth":
        return [make(StereoDepthNode, image_transport=kind) for kind in ("raw", "compressed")]
    if name == "detector":
        network: Any = None
        kind: Any = partial(DetectorNode, PersonDetector(network))
        return [
            make(kind, image_transport="raw", publish_silhouette=True),
            make(kind, image_transport="compressed"),
        ]
    if name == "tracker":
        # The network of hands is not part of the package.
        with patch.multiple(tracker_node, HandNetwork=DEFAULT, installed_hands=DEFAULT):
            looking = [
                make(TrackerNode, people=people, keypoints="KEYPOINTS", hands=True)
                for people in (0, 1)
            ]
        return [
            *looking,
            make(TrackerNode, rep155_id="ID", keypoints="KEYPOINTS"),
            make(TrackerNode, cameras=["CAMERA"], depth="DEPTH", keypoints="KEYPOINTS"),
        ]
    if name == "retarget":
        return [make(RetargetNode, **ARM)]
    if name == "teleoperation":
        return [make(TeleoperationNode, to=to) for to in ("isaac", "json")]
    if name == "rula":
        return [make(RulaNode)]
    return [
        make(InitializerNode),
        make(InitializerNode, cameras=["CAMERA"], depth="DEPTH"),
    ]


@pytest.mark.parametrize("name", NODES)
def test_the_document_has_every_topic_and_service(
    name: str, make: Callable[..., Any], tmp_path: Path
) -> None:
    topics: set[Topic] = set()
    services: set[str] = set()
    for node in nodes_called(name, make, tmp_path):
        found = interface_of(node)
        topics |= found[0]
        services |= found[1]
    assert topics, name
    written_topics, written_services = table(name)
    assert sorted(written_topics) == sorted(topics)
    assert written_services == services


def published() -> dict[str, Topic]:
    return {
        topic.name: topic for node in NODES for topic in table(node)[0] if topic.direction == "out"
    }


def displays() -> list[dict[str, Any]]:
    text = (ROOT / "config" / "cardbox.rviz").read_text(encoding="utf-8")
    found: list[dict[str, Any]] = yaml.safe_load(text)["Visualization Manager"]["Displays"]
    return found


KINDS = {
    "RobotModel": "std_msgs/String",
    "MarkerArray": "visualization_msgs/MarkerArray",
    "PoseArray": "geometry_msgs/PoseArray",
    "Image": "sensor_msgs/Image",
}


def test_rviz_subscribes_to_what_is_published_with_a_qos_that_fits() -> None:
    shown = [d for d in displays() if "Topic" in d or "Description Topic" in d]
    assert {d["Class"].split("/")[1] for d in shown} == set(KINDS)
    for display in shown:
        topic = display.get("Topic") or display["Description Topic"]
        source = published()[topic["Value"]]
        assert KINDS[display["Class"].split("/")[1]] == source.kind
        if source.qos.startswith("best effort"):
            assert topic["Reliability Policy"] == "Best Effort"
        latched = topic["Durability Policy"] == "Transient Local"
        assert latched == source.qos.startswith("latched")


def test_the_launch_file_moves_every_topic_of_the_layout_into_the_namespace() -> None:
    text = (ROOT / "launch" / "nodes.launch.py").read_text(encoding="utf-8")
    (names,) = re.findall(r"(?m)^LAYOUT_TOPICS = \((.*)\)$", text)
    shown = [d.get("Topic") or d.get("Description Topic") for d in displays()]
    assert set(re.findall(r'"(\w+)"', names)) == {t["Value"].lstrip("/") for t in shown if t}


def test_rviz_stands_on_the_root_of_the_person() -> None:
    text = (ROOT / "config" / "cardbox.rviz").read_text(encoding="utf-8")
    manager = yaml.safe_load(text)["Visualization Manager"]
    assert manager["Global Options"]["Fixed Frame"] == ROOT_LINK


def panels(layout: Any) -> set[str]:
    if isinstance(layout, str):
        return {layout}
    return panels(layout["first"]) | panels(layout["second"])


def test_foxglove_shows_what_is_published() -> None:
    layout = json.loads((ROOT / "config" / "cardbox_foxglove.json").read_text(encoding="utf-8"))
    assert panels(layout["layout"]) == set(layout["configById"])
    text = json.dumps(layout["configById"])
    named = set(re.findall(r'"(/[a-z_/]+)(?:[.\[][^"]*)?"', text))
    assert {"/overlay", "/markers", "/robot_description", "/diagnostics"} <= named
    assert "/joint_states" in named
    assert named <= set(published())
    plotted = re.findall(r'"/joint_states\.position\[(\d+)\]", "label": "(\w+)"', text)
    assert len(plotted) == 11
    for index, label in plotted:
        assert JOINT_NAMES[int(index)] == label


def test_foxgloves_person_moves_with_the_transforms_of_a_recording() -> None:
    """A URDF layer without a control mode follows the transforms of the bag's /tf."""
    layout = json.loads((ROOT / "config" / "cardbox_foxglove.json").read_text(encoding="utf-8"))
    panel = layout["configById"]["3D!person"]
    layer = panel["layers"]["person"]
    assert (layer["layerId"], layer["topic"]) == ("foxglove.Urdf", "/robot_description")
    assert layer["framePrefix"] == "" and layer.get("controlMode", "auto") == "auto"
    links = LinkTransforms(urdf_from_body(BodyModel(), "eye")).at(dict.fromkeys(ALL_NAMES, 0.0))
    assert panel["followTf"] in {link.parent for link in links} - {link.child for link in links}


PARAMETER = re.compile(r"-p (\w+):=")
REMAPPED = re.compile(r"-r ([\w/]+):=")


def lines_that_start(node: str) -> list[str]:
    """Return the command lines of a node in the documents, with or without ``ros2 run``."""
    text = "\n".join(
        path.read_text(encoding="utf-8").replace("\\\n", " ")
        for path in [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
    )
    return re.findall(rf"(?m)^    (?:ros2 run cardbox_tracker )?{node}(?: .*)?$", text)


@pytest.mark.parametrize("name", NODES)
def test_commands_give_nodes_what_they_have(
    name: str, make: Callable[..., Any], tmp_path: Path
) -> None:
    lines = lines_that_start(name)
    assert lines, f"no document starts {name}"
    node = nodes_called(name, make, tmp_path)[0]
    topics = {topic.name for topic in table(name)[0]}
    for line in lines:
        for parameter in PARAMETER.findall(line):
            assert node.has_parameter(parameter), line
        for topic in REMAPPED.findall(line):
            assert topic == "__ns" or full(topic) in topics, line


def test_commands_give_nodes_in_one_process_what_they_have(
    make: Callable[..., Any], tmp_path: Path
) -> None:
    lines = lines_that_start("cardbox_nodes")
    assert lines
    for line in lines:
        given = re.findall(r"-p (\w+):(\w+):=", line)
        assert len(given) == line.count(":="), line
        for node, parameter in given:
            assert nodes_called(node, make, tmp_path)[0].has_parameter(parameter), line


def test_command_lines_of_play_bag_parse() -> None:
    from cardbox_tracker.ros.nodes.play_bag_node import overrides_from

    for line in lines_that_start("play_bag"):
        own = line.split("play_bag", 1)[1].partition("--ros-args")[0]
        assert overrides_from(own.split())


def test_services_and_topics_in_commands_are_documented() -> None:
    text = "\n".join(
        path.read_text(encoding="utf-8")
        for path in [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
    )
    services = {service for node in NODES for service in table(node)[1]}
    called = re.findall(r"(?:ros2 service|cardbox) call ([\w/]+)", text)
    assert len(called) > 5
    assert {full(name) for name in called} <= services
    echoed = re.findall(r"ros2 topic echo ([\w/]+)", text)
    assert len(echoed) > 3
    assert set(echoed) <= set(published())
