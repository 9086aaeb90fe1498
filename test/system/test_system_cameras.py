"""Two independent cameras in separate namespaces do not influence each other.

Each node of the left camera has its own process; those of the right camera share one process.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from geometry_msgs.msg import PoseArray
from sensor_msgs.msg import CameraInfo, Image, JointState
from std_msgs.msg import Header, String

from cardbox_tracker.person.model_file import loads_body_model, save_body_model
from cardbox_tracker.ros.messages.conversions import camera_info_message, image_message
from cardbox_tracker.ros.runtime import qos

LEARN_IMAGES = 10
LATERAL_M = {"left": -0.35, "right": 0.3}


class Eye:
    """One camera and the outputs of its nodes."""

    def __init__(self, graph: Any, scene: Any, name: str) -> None:
        self.graph, self.scene, self.name = graph, scene, name
        self.model_file = Path(graph.folder) / f"{name}.yaml"
        save_body_model(scene.body, self.model_file)
        self.images = graph.node.create_publisher(Image, f"{name}/image_raw", qos.CAMERA)
        self.infos = graph.node.create_publisher(CameraInfo, f"{name}/camera_info", qos.CAMERA)
        self.silhouettes = graph.collect(Image, f"{name}/silhouette", qos.REPLAY)
        self.states = graph.collect(JointState, f"{name}/joint_states", qos.REPLAY)
        self.keypoints = graph.collect(PoseArray, f"{name}/keypoints", qos.REPLAY)
        self.models = graph.collect(String, f"{name}/body_model", qos.LATCHED)
        self.descriptions = graph.collect(String, f"{name}/robot_description", qos.LATCHED)
        self.stamps: set[tuple[int, int]] = set()
        self.takers = 0

    def start(self, *, single_process: bool) -> None:
        space = ("--ros-args", "-r", f"__ns:=/{self.name}")
        # In one process silhouettes bypass DDS, so only the test subscribes to them.
        self.takers = 1 if single_process else 3
        if single_process:
            given = {
                "background": {"learn_images": LEARN_IMAGES},
                "initializer": {"model_file": str(self.model_file)},
            }
            parameters = Path(self.graph.folder) / "nodes.yaml"
            sections = {f"/**/{node}": {"ros__parameters": own} for node, own in given.items()}
            parameters.write_text(yaml.safe_dump(sections))
            self.graph.start("cardbox_nodes", *space, "--params-file", str(parameters))
        else:
            self.graph.start("background", *space, learn_images=LEARN_IMAGES)
            self.graph.start("initializer", *space, model_file=self.model_file)
            self.graph.start("tracker", *space)

    def found(self) -> bool:
        count = self.graph.node.count_subscribers
        return (
            self.images.get_subscription_count() == self.infos.get_subscription_count() == 1
            and count(f"/{self.name}/silhouette") == self.takers
            and self.graph.node.count_publishers(f"/{self.name}/keypoints") == 1
            and bool(self.models)
        )

    def show(self, posture: str | None) -> None:
        header = Header(frame_id=f"{self.name}_optical", stamp=self.graph.next_stamp())
        self.stamps.add((header.stamp.sec, header.stamp.nanosec))
        self.infos.publish(camera_info_message(header, self.scene.camera))
        self.images.publish(image_message(header, self.scene.image(posture), "mono8"))


@pytest.fixture(scope="module")
def eyes(graph: Any, make_scene: Any) -> list[Eye]:
    eyes = [Eye(graph, make_scene(at_m), name) for name, at_m in LATERAL_M.items()]
    for eye in eyes:
        eye.start(single_process=eye.name == "right")
    graph.wait(lambda: all(eye.found() for eye in eyes), "the nodes of both cameras")

    def learned() -> bool:
        for eye in eyes:
            eye.show(None)
        graph.spin(0.05)
        return all(eye.silhouettes for eye in eyes)

    graph.wait(learned, "both backgrounds")

    def tracked() -> bool:
        for eye in eyes:
            eye.show("front")
        graph.spin(0.05)
        return all(len(eye.states) >= 15 for eye in eyes)

    graph.wait(tracked, "joint states of both cameras")
    return eyes


def test_each_camera_has_its_own_person(eyes: list[Eye]) -> None:
    for eye in eyes:
        assert loads_body_model(eye.models[-1].data) == eye.scene.body
        where_m = [state.position[0] for state in eye.states[5:]]
        assert np.median(where_m) == pytest.approx(LATERAL_M[eye.name], abs=0.1)


def test_nothing_of_the_other_camera_comes_out(eyes: list[Eye]) -> None:
    for eye in eyes:
        for message in [*eye.silhouettes, *eye.states, *eye.keypoints]:
            assert message.header.frame_id == f"{eye.name}_optical"
            assert (message.header.stamp.sec, message.header.stamp.nanosec) in eye.stamps
        assert f"{eye.name}_optical" in eye.descriptions[-1].data


def test_diagnostics_tell_the_nodes_apart(eyes: list[Eye]) -> None:
    graph = eyes[0].graph
    for eye in eyes:
        for node in ("background", "initializer", "tracker"):
            assert graph.diagnosis(f"{eye.name}/{node}").values


def test_the_single_process_ends_on_a_signal(eyes: list[Eye]) -> None:
    process = eyes[0].graph.processes[-1]
    assert process.log.name.startswith("cardbox_nodes")
    assert process.stop() == 0, process.text()
