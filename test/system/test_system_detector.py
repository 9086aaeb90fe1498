"""From images through the detector's points and silhouettes to joint states, over DDS."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import CameraInfo, Image, JointState, PointCloud2
from std_msgs.msg import Header

from cardbox_tracker.detectors.detector import PersonDetector
from cardbox_tracker.detectors.pose_network import LANDMARKS, NOBODY, Detection
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model_file import save_body_model
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.ros.messages.conversions import camera_info_message, image_message
from cardbox_tracker.ros.messages.keypoints import people_message
from cardbox_tracker.ros.nodes.detector_node import DetectorNode
from cardbox_tracker.ros.runtime import qos

JOINTS = [f"{side}_{name}" for side in ("left", "right") for name in ("shoulder", "elbow", "wrist")]


class Network:
    """Stands for the network files: it sees who is bright and knows how they stand."""

    several = 0

    def __init__(self, scene: Any) -> None:
        posture = reference_posture("front")
        posture[0] = scene.body.placement.lateral_m
        points_m = scene.camera.reference_to_optical(pose(scene.body.rigid, posture).keypoints_m)
        self._px, self._scores = np.zeros((len(LANDMARKS), 2)), np.zeros(len(LANDMARKS))
        of = [LANDMARKS.index(name) for name in JOINTS]
        self._px[of], self._scores[of] = scene.camera.project(points_m), 0.9

    def forget(self) -> None:
        pass

    def __call__(self, image: np.ndarray, _: int | None = None) -> Detection | None:
        mask = np.where(image[..., 0] > 140, 255, 0).astype(np.uint8)
        return Detection(self._px, self._scores, mask) if mask.any() else None


class Room:
    """A camera, the node detector in this process, and a tracker in another one."""

    def __init__(self, graph: Any, scene: Any, folder: Path) -> None:
        self.graph, self.scene = graph, scene
        network: Any = Network(scene)
        make: Any = rclpy.parameter.Parameter
        self.detector = DetectorNode(
            PersonDetector(network),
            context=graph.context,
            enable_rosout=False,
            parameter_overrides=[make("publish_silhouette", value=True)],
        )
        graph.executor.add_node(self.detector)
        self.images = graph.node.create_publisher(Image, "image_raw", qos.CAMERA)
        self.infos = graph.node.create_publisher(CameraInfo, "camera_info", qos.CAMERA)
        self.states = graph.collect(JointState, "joint_states")
        self.diagnostics = graph.collect(DiagnosticArray, "/diagnostics")
        save_body_model(scene.body, folder / "body.yaml")
        self.tracker = graph.start(
            "tracker", model_file=folder / "body.yaml", keypoints="detector/keypoints"
        )

    def close(self) -> None:
        self.graph.executor.remove_node(self.detector)
        self.detector.close()
        self.detector.destroy_node()

    def show(self) -> None:
        """Show the person in one image."""
        header = Header(frame_id="eye", stamp=self.graph.next_stamp())
        self.infos.publish(camera_info_message(header, self.scene.camera))
        self.images.publish(image_message(header, self.scene.image("front")))
        self.graph.spin(0.03)

    def values(self) -> dict[str, str]:
        """Return the last values of the tracker's diagnostics."""
        own = [
            status
            for array in self.diagnostics
            for status in array.status
            if status.name.startswith("tracker:")
        ]
        return {value.key: value.value for value in own[-1].values} if own else {}

    def until(self, condition: Any, what: str) -> None:
        def holds() -> Any:
            self.show()
            return condition()

        self.graph.wait(holds, what)


def bad_messages(header: Header) -> list[PointCloud2]:
    """Return messages that nobody can use: their points are too many, nowhere, or elsewhere."""
    elsewhere = Header(frame_id="elsewhere", stamp=header.stamp)
    there = NOBODY._replace(scores=np.full(len(LANDMARKS), 0.5))
    nowhere = there._replace(points_px=np.full((len(LANDMARKS), 2), np.nan))
    endless = there._replace(points_px=np.full((len(LANDMARKS), 2), np.inf))
    return [
        people_message(header, [NOBODY] * 101),
        people_message(header, [nowhere]),
        people_message(header, [endless]),
        people_message(elsewhere, [there]),
    ]


def test_the_detector_alone_leads_to_joint_states(
    own_graph: Any, scene: Any, tmp_path: Path
) -> None:
    room = Room(own_graph, scene, tmp_path)
    try:
        # Nothing was learned before: the person is in view from the first image on.
        room.until(lambda: len(room.states) >= 10, "joint states")
        lateral_m = np.median([state.position[0] for state in room.states[5:]])
        assert lateral_m == pytest.approx(scene.body.placement.lateral_m, abs=0.05)
        room.until(lambda: int(room.values().get("keypoints used", "0")) >= 10, "points")
        assert float(room.values()["keypoints behind the image (ms)"]) <= 300.0

        publisher = own_graph.node.create_publisher(PointCloud2, "detector/keypoints", 10)
        own_graph.wait(lambda: publisher.get_subscription_count() == 1, "the tracker")
        for number in range(40):
            header = Header(frame_id="eye", stamp=own_graph.next_stamp())
            publisher.publish(bad_messages(header)[number % 4])
            room.show()
        before, used = len(room.states), int(room.values()["keypoints used"])
        room.until(lambda: len(room.states) >= before + 5, "joint states after bad points")
        room.until(lambda: int(room.values()["keypoints used"]) >= used + 5, "good points")
        said = room.tracker.text()
        assert "Traceback" not in said
        assert "3333 points" in said and "expected a place" in said
        assert said.count("detector/keypoints:") <= 6, "a sender of nonsense fills the log"
    finally:
        room.close()
