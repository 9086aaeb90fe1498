"""Images in, joint states out: background, initializer and tracker as separate processes.

The tests share one running graph and follow a user's session in order.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as Xml

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseArray
from numpy.typing import NDArray
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.parameter import Parameter
from sensor_msgs.msg import CameraInfo, Image, JointState
from std_msgs.msg import Header, String
from visualization_msgs.msg import Marker, MarkerArray

from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model_file import loads_body_model
from cardbox_tracker.person.posture import N_STATE, reference_posture
from cardbox_tracker.person.skeleton import JOINT_NAMES, Group, names_of
from cardbox_tracker.ros.messages.conversions import camera_info_message, image_message
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.tracking.estimate import Estimate

LEARN_IMAGES = 10
ALL_NAMES = names_of(*{*Group} - {Group.HAND})


class Session:
    """A camera that shows the scene to the three nodes."""

    def __init__(self, graph: Any, scene: Any) -> None:
        self.graph, self.scene = graph, scene
        self.model_file = Path(graph.folder) / "model.yaml"
        graph.start("background", learn_images=LEARN_IMAGES)
        graph.start("initializer", model_file=self.model_file, person_distance_m=2.3)
        self.tracker = graph.start("tracker", rep155_id="p1")
        self.images = graph.node.create_publisher(Image, "image_raw", qos.CAMERA)
        self.infos = graph.node.create_publisher(CameraInfo, "camera_info", qos.CAMERA)
        self.silhouettes = graph.collect(Image, "silhouette")
        self.joint_states = graph.collect(JointState, "joint_states")
        graph.wait(
            lambda: (
                self.images.get_subscription_count() == 1
                and self.infos.get_subscription_count() == 1
                and graph.node.count_subscribers("silhouette") == 3
                and graph.node.count_publishers("joint_states") == 1
            ),
            "the nodes find each other",
        )

    def header(self) -> Header:
        return Header(frame_id="test_optical", stamp=self.graph.next_stamp())

    def show(self, posture: NDArray[np.float64] | str | None, count: int = 1) -> list[Any]:
        """Publish images and wait for the silhouette of each; return the stamps."""
        stamps = []
        for _ in range(count):
            header = self.header()
            before = len(self.silhouettes)
            self.infos.publish(camera_info_message(header, self.scene.camera))
            self.images.publish(image_message(header, self.scene.image(posture), "mono8"))
            self.graph.wait(lambda before=before: len(self.silhouettes) > before, "a silhouette")
            stamps.append(header.stamp)
        return stamps

    def hold(self, posture: NDArray[np.float64] | str | None) -> None:
        """Show images slowly, so that a busy initializer, which may lose some, sees the last."""
        for _ in range(8):
            self.show(posture)
            self.graph.spin(0.1)

    def track(self, posture: NDArray[np.float64] | str, count: int) -> list[Any]:
        """Show images and wait for the joint state of each; return the joint states."""
        first = len(self.joint_states)
        for number in range(1, count + 1):
            self.show(posture)
            self.graph.wait(
                lambda number=number: len(self.joint_states) >= first + number, "a joint state"
            )
        return list(self.joint_states[first:])


@pytest.fixture(scope="module")
def session(graph: Any, scene: Any) -> Iterator[Session]:
    yield Session(graph, scene)


@pytest.fixture(scope="module")
def learned(session: Session) -> Session:
    """Return the session after the background is learned."""
    graph = session.graph
    for _ in range(LEARN_IMAGES - 1):
        header = session.header()
        session.infos.publish(camera_info_message(header, session.scene.camera))
        session.images.publish(image_message(header, session.scene.image(None), "mono8"))
        graph.spin(0.03)
    for _ in range(100):
        if session.silhouettes:
            break
        header = session.header()
        session.infos.publish(camera_info_message(header, session.scene.camera))
        session.images.publish(image_message(header, session.scene.image(None), "mono8"))
        graph.spin(0.05)
    assert session.silhouettes
    return session


@pytest.fixture(scope="module")
def measured(learned: Session) -> tuple[Session, str, str]:
    """Return the session after the measurement, the service's answer and the body model's text."""
    models = learned.graph.collect(String, "body_model", qos.LATCHED)
    for name in ("front", "side", "arms"):
        learned.hold(name)
        response = learned.graph.call(f"initializer/capture_{name}")
        assert response.success, response.message
    response = learned.graph.call("initializer/initialize", timeout_s=90)
    assert response.success, response.message
    learned.graph.wait(lambda: models, "body_model")
    return learned, response.message, models[-1].data


@pytest.mark.parametrize(
    ("service", "words"),
    [
        ("initializer/capture_front", ("no silhouette was received yet on /silhouette",)),
        ("background/learn", ("no image was received yet on /image_raw", "/camera_info")),
        ("tracker/reset", ("nothing to reset", "/body_model")),
    ],
)
def test_a_service_called_too_early_says_what_is_missing(
    session: Session, service: str, words: tuple[str, ...]
) -> None:
    response = session.graph.call(service)
    assert not response.success
    for word in words:
        assert word in response.message


def test_every_node_says_what_it_waits_for(session: Session) -> None:
    for node, words in (
        ("background", "waiting for images on /image_raw"),
        ("initializer", "waiting for silhouettes on /silhouette"),
        ("tracker", "waiting for a body model on /body_model"),
    ):
        session.graph.diagnosis(node, words)


def test_images_without_camera_info_are_waited_for_in_words(session: Session) -> None:
    session.images.publish(image_message(session.header(), session.scene.image(None), "mono8"))
    session.graph.diagnosis("background", "waiting for the CameraInfo on /camera_info")


def test_uncalibrated_camera_is_refused_with_both_topics(session: Session) -> None:
    session.infos.publish(CameraInfo(header=session.header(), width=320, height=240))
    status = session.graph.diagnosis("background", "not calibrated")
    assert "/image_raw" in status.message and "/camera_info" in status.message


def test_background_is_learned_and_latched(learned: Session) -> None:
    means = learned.graph.collect(Image, "background/mean", qos.LATCHED)
    deviations = learned.graph.collect(Image, "background/stddev", qos.LATCHED)
    learned.graph.wait(lambda: means and deviations, "the latched background")
    mean = np.frombuffer(means[0].data, np.float32)
    assert means[0].encoding == "32FC1" and mean.size == 320 * 240
    assert mean.mean() == pytest.approx(90, abs=1)
    assert np.frombuffer(deviations[0].data, np.float32).mean() == pytest.approx(2, abs=0.5)


def test_silhouette_has_the_stamp_size_and_camera_info_of_its_image(learned: Session) -> None:
    infos = learned.graph.collect(CameraInfo, "silhouette/camera_info")
    learned.graph.wait(
        lambda: learned.graph.node.count_subscribers("silhouette/camera_info") == 3, "discovery"
    )
    learned.graph.spin(0.3)
    (stamp,) = learned.show("front")
    silhouette = learned.silhouettes[-1]
    learned.graph.wait(lambda: infos, "silhouette/camera_info")
    assert silhouette.header.stamp == infos[-1].header.stamp == stamp
    assert silhouette.header.frame_id == "test_optical"
    assert (silhouette.width, silhouette.height, silhouette.encoding) == (320, 240, "mono8")
    assert (infos[-1].width, infos[-1].height, list(infos[-1].d)) == (320, 240, [0.0] * 5)
    assert infos[-1].k[0] == pytest.approx(300.0)
    got = np.frombuffer(silhouette.data, np.uint8).reshape(240, 320)
    assert set(np.unique(got)) == {0, 255}
    assert np.mean(got != learned.scene.silhouette("front")) < 0.01


def test_unsupported_encoding_is_refused_in_words_and_the_node_goes_on(learned: Session) -> None:
    message = image_message(learned.header(), learned.scene.image(None), "mono8")
    message.encoding = "32SC2"
    learned.images.publish(message)
    status = learned.graph.diagnosis("background", "32SC2")
    assert "mono8" in status.message and "bgr8" in status.message
    learned.show(None)


def test_too_few_bytes_are_refused_and_the_node_goes_on(learned: Session) -> None:
    message = image_message(learned.header(), learned.scene.image(None), "mono8")
    message.height = 480
    learned.images.publish(message)
    learned.show(None)


def test_capture_refuses_an_empty_image(learned: Session) -> None:
    learned.hold(None)
    response = learned.graph.call("initializer/capture_front")
    assert not response.success and "nobody is in the image" in response.message


def test_capture_refuses_a_person_cut_off(learned: Session) -> None:
    aside = reference_posture("front")
    aside[0] = 1.1
    learned.hold(aside)
    response = learned.graph.call("initializer/capture_front")
    assert not response.success and "cut off at the right border" in response.message


def test_capture_refuses_a_person_who_did_not_turn(learned: Session) -> None:
    learned.hold("front")
    assert learned.graph.call("initializer/capture_front").success
    response = learned.graph.call("initializer/capture_side")
    assert not response.success and "'side': it looks like 'front'" in response.message


def test_initialize_answers_with_sizes_and_fit(measured: tuple[Session, str, str]) -> None:
    session, answer, _ = measured
    for word in ("fit (IoU) front", "mean", "torso_height", str(session.model_file)):
        assert word in answer
    status = session.graph.diagnosis("initializer")
    assert {value.key: value.value for value in status.values}["body model"] == "published"


def test_body_model_message_is_the_saved_file(measured: tuple[Session, str, str]) -> None:
    session, _, text = measured
    assert session.model_file.read_text() == text
    body = loads_body_model(text)
    assert body.placement.distance_m == pytest.approx(2.3)
    # The images of the silhouettes were received, and the camera is grey.
    assert body.appearance is not None
    assert body.appearance.is_grey
    assert body.size("upper_arm_length") == pytest.approx(
        session.scene.body.size("upper_arm_length"), abs=0.06
    )


def test_robot_description_is_latched_and_has_the_joints(
    measured: tuple[Session, str, str],
) -> None:
    session, _, _ = measured
    descriptions = session.graph.collect(String, "robot_description", qos.LATCHED)
    session.graph.wait(lambda: descriptions, "robot_description")
    robot = Xml.fromstring(descriptions[-1].data)
    joints = {j.get("name") for j in robot.findall("joint") if j.get("type") != "fixed"}
    assert joints == set(ALL_NAMES)
    assert "test_optical" in {link.get("name") for link in robot.findall("link")}


def test_each_image_gives_joint_states_of_its_stamp(measured: tuple[Session, str, str]) -> None:
    session, _, _ = measured
    first = len(session.joint_states)
    stamps = []
    for number in range(1, 16):
        stamps += session.show("front")
        # A busy tracker takes the newest silhouette and leaves out those before it.
        session.graph.wait(
            lambda number=number: len(session.joint_states) == first + number, "a joint state"
        )
    messages = session.joint_states[first:]
    assert [message.header.stamp for message in messages] == stamps
    assert all(tuple(message.name) == ALL_NAMES for message in messages)
    posture, place, others = np.split(np.array(messages[-1].position), [len(JOINT_NAMES), N_STATE])
    # Neither the neck nor the clavicles of hanging arms.
    np.testing.assert_array_equal(others, 0.0)
    body, camera = session.scene.body, session.scene.camera
    truth = reference_posture("front")
    truth[0] = body.placement.lateral_m
    found = pose(body, np.concatenate([posture, place])).keypoints_m
    error_m = np.linalg.norm(found - pose(body.rigid, truth).keypoints_m, axis=1)
    assert error_m.mean() < 0.15
    assert camera.width == 320


def test_keypoints_markers_overlay_and_deviations_go_with_the_image(
    measured: tuple[Session, str, str],
) -> None:
    session, _, _ = measured
    graph = session.graph
    keypoints = graph.collect(PoseArray, "keypoints")
    markers = graph.collect(MarkerArray, "markers")
    overlays = graph.collect(Image, "overlay", qos.SENSOR_DATA)
    deviations = graph.collect(JointState, "joint_states_stddev")
    graph.spin(0.5)

    def shown() -> Any:
        # DDS matches topics one by one, and best effort may lose an overlay.
        state = session.track("front", 1)[-1]
        graph.spin(0.2)
        latest = [m[-1].header.stamp for m in (keypoints, overlays, deviations) if m]
        return state if markers and latest == [state.header.stamp] * 3 else None

    state = graph.wait(shown, "all outputs of one image")
    assert keypoints[-1].header.stamp == state.header.stamp
    assert keypoints[-1].header.frame_id == "test_optical"
    points = np.array([(p.position.x, p.position.y, p.position.z) for p in keypoints[-1].poses])
    body, camera = session.scene.body, session.scene.camera
    posture, place, _ = np.split(np.array(state.position), [len(JOINT_NAMES), N_STATE])
    placed = Estimate("tracking", posture, offset_m=place).placed(body)
    expected = camera.reference_to_optical(pose(placed.rigid, posture).keypoints_m)
    assert points.shape == (6, 3)
    np.testing.assert_allclose(points, expected, atol=0.1)
    kinds = {marker.ns: marker.type for marker in markers[-1].markers}
    assert kinds == {"patches": Marker.TRIANGLE_LIST, "skeleton": Marker.LINE_LIST}
    assert markers[-1].markers[0].header.frame_id == "test_optical"
    # Small pictures are enlarged, so that the text is readable.
    assert (overlays[-1].width, overlays[-1].height, overlays[-1].encoding) == (640, 480, "bgr8")
    assert np.all(np.array(deviations[-1].position) >= 0)

    before = len(session.joint_states)
    states = graph.collect(String, "tracking_state")
    graph.wait(lambda: graph.node.count_publishers("tracking_state") == 1, "tracking_state")
    graph.spin(0.5)
    session.show(None, 2)
    graph.wait(
        lambda: any(m.action == Marker.DELETEALL for a in markers for m in a.markers),
        "markers removed when nobody is there",
    )
    assert len(session.joint_states) == before

    def both() -> bool:
        # A tracker that is busy takes the newest silhouette only.
        session.show(None, 1)
        graph.spin(0.1)
        return len(states) >= 2

    graph.wait(both, "the states of two images")
    assert {state.data for state in states} == {"no_person"}
    arrays = graph.collect(DiagnosticArray, "/diagnostics")

    def told() -> bool:
        # Diagnostics come once a second, and other words follow when the images cease.
        session.show(None, 1)
        graph.spin(0.2)
        return any("nobody is in the image" in s.message for a in arrays for s in a.status)

    graph.wait(told, "diagnostics of an image without a person")


def test_joints_and_urdf_of_rep155_put_the_hands_at_the_keypoints(
    measured: tuple[Session, str, str],
) -> None:
    yourdfpy = pytest.importorskip("yourdfpy", reason="yourdfpy is not installed")
    session, _, _ = measured
    graph = session.graph
    humans = graph.collect(JointState, "/humans/bodies/p1/joint_states")
    keypoints = graph.collect(PoseArray, "keypoints")
    descriptions = graph.collect(String, "/humans/bodies/p1/robot_description", qos.LATCHED)
    graph.spin(0.5)

    def shown() -> bool:
        session.track("front", 1)
        return bool(humans and descriptions and keypoints)

    graph.wait(shown, "joint states of REP-155")
    stamps = {(k.header.stamp.sec, k.header.stamp.nanosec): k for k in keypoints}
    human = next(h for h in humans if (h.header.stamp.sec, h.header.stamp.nanosec) in stamps)
    points = stamps[human.header.stamp.sec, human.header.stamp.nanosec].poses
    robot = yourdfpy.URDF.load(io.BytesIO(descriptions[-1].data.encode()))
    robot.update_cfg(dict(zip(human.name, human.position, strict=True)))
    assert all(name.endswith("_p1") for name in human.name)
    for link, number in (("l_shoulder", 0), ("l_elbow", 1), ("l_wrist", 2), ("r_wrist", 5)):
        place = robot.get_transform(f"{link}_p1", "test_optical")[:3, 3]
        point = points[number].position
        np.testing.assert_allclose(place, (point.x, point.y, point.z), atol=2e-3)


def test_reset_starts_from_the_front_reference(measured: tuple[Session, str, str]) -> None:
    session, _, _ = measured
    session.track("front", 2)
    response = session.graph.call("tracker/reset")
    assert response.success and "front reference" in response.message
    session.track("front", 2)


def test_wrong_parameter_is_refused_and_a_right_one_is_live(
    measured: tuple[Session, str, str],
) -> None:
    session, _, _ = measured
    graph = session.graph
    client = graph.node.create_client(SetParametersAtomically, "tracker/set_parameters_atomically")
    graph.wait(client.service_is_ready, "parameter service")

    def set_parameter(name: str, value: Any) -> Any:
        request = SetParametersAtomically.Request(
            parameters=[Parameter(name, value=value).to_parameter_msg()]
        )
        future = client.call_async(request)
        graph.wait(future.done, "answer")
        return future.result().result

    refused = set_parameter("preset", "magic")
    assert not refused.successful and "paper, default" in refused.reason
    refused = set_parameter("lost_frames", -1)
    assert not refused.successful and "lost_frames" in refused.reason
    reads = graph.node.create_client(GetParameters, "tracker/get_parameters")
    graph.wait(reads.service_is_ready, "parameter service")
    future = reads.call_async(GetParameters.Request(names=["preset", "lost_frames"]))
    graph.wait(future.done, "answer")
    kept = [value.string_value or value.integer_value for value in future.result().values]
    assert kept == ["default", 5]
    session.track("front", 2)

    assert set_parameter("lost_iou", 1.0).successful
    assert set_parameter("lost_frames", 1).successful
    before = len(session.joint_states)
    session.show("front")
    graph.diagnosis("tracker", "the person was lost")
    assert len(session.joint_states) == before, "it takes effect at the very next image"
    assert set_parameter("lost_iou", 0.3).successful
    assert set_parameter("effort", 0.5).successful
    session.track("front", 2)


def publish_as_it_is(session: Session, image: np.ndarray) -> None:
    """Publish the same image a few times."""
    for _ in range(3):
        header = session.header()
        session.infos.publish(camera_info_message(header, session.scene.camera))
        session.images.publish(image_message(header, image, "mono8"))
        session.graph.spin(0.1)


def test_a_brighter_scene_is_followed(learned: Session) -> None:
    """Automatic exposure makes the whole image brighter at once."""
    graph = learned.graph
    brighter = np.clip(learned.scene.image(None).astype(int) + 40, 0, 255).astype(np.uint8)
    publish_as_it_is(learned, brighter)
    values: dict[str, str] = {}

    def followed() -> bool:
        values.update((v.key, v.value) for v in graph.diagnosis("background", "working").values)
        return abs(float(values["scene brightness drift (grey levels)"]) - 40) < 3

    graph.wait(followed, "the drift of the brighter scene")
    assert float(values["foreground (% of the image)"]) < 1


def test_a_scene_that_cannot_be_followed_names_the_controls_of_the_camera(
    learned: Session,
) -> None:
    blocks = np.random.default_rng(0).choice([10, 160, 250], (15, 20)).astype(np.uint8)
    publish_as_it_is(learned, np.kron(blocks, np.ones((16, 16), np.uint8)))
    status = learned.graph.diagnosis("background", "the whole scene changed its brightness")
    for word in ("auto_exposure=1", "white_balance_automatic=0", "background/learn"):
        assert word in status.message
    learned.show(None, 2)
    learned.graph.diagnosis("background", "working")


def test_a_restarted_tracker_goes_on_with_the_latched_model(
    measured: tuple[Session, str, str],
) -> None:
    session, _, _ = measured
    assert session.tracker.stop() == 0
    graph = session.graph
    graph.wait(lambda: graph.node.count_publishers("joint_states") == 0, "the tracker is gone")
    session.tracker = graph.start("tracker")
    graph.wait(
        lambda: (
            graph.node.count_publishers("joint_states") == 1
            and graph.node.count_subscribers("silhouette") == 3
        ),
        "the new tracker",
    )
    graph.diagnosis("tracker", "waiting for silhouettes")
    first = len(session.joint_states)

    def sees() -> bool:
        # The background node may find the new tracker later than this test does.
        session.show("front")
        graph.spin(0.1)
        return len(session.joint_states) > first

    graph.wait(sees, "the new tracker's first joint state")
    states = session.track("front", 3)
    assert len(states) >= 3


def test_diagnostics_have_state_rates_latency_and_fit(measured: tuple[Session, str, str]) -> None:
    session, _, _ = measured
    states = session.graph.collect(String, "tracking_state")
    session.track("front", 3)
    common = {"rate in (Hz)", "rate out (Hz)", "latency p95 (ms)", "dropped (by stamps)", "late"}
    for node, keys in (
        ("background", {"scene brightness drift (grey levels)", "foreground (% of the image)"}),
        ("tracker", {"state", "iou", "cost (px)"}),
    ):
        status = session.graph.diagnosis(node, "working")
        values = {value.key: value.value for value in status.values}
        assert common | keys <= set(values)
        assert float(values["latency p95 (ms)"]) > 0
        assert int(values["published"]) > 0
    assert values["state"] == states[-1].data in ("tracking", "uncertain")
    counts = {state: int(values.get(f"images {state}", 0)) for state in ("tracking", "uncertain")}
    assert counts[values["state"]] > 0 and sum(counts.values()) >= 3
    assert 0.8 < float(values["iou"]) <= 1


def test_learning_again_stops_silhouettes_until_it_is_done(
    measured: tuple[Session, str, str],
) -> None:
    session, _, _ = measured
    response = session.graph.call("background/learn")
    assert response.success and f"{LEARN_IMAGES} images" in response.message
    before = len(session.silhouettes)
    for _ in range(LEARN_IMAGES):
        header = session.header()
        session.images.publish(image_message(header, session.scene.image(None), "mono8"))
        session.graph.spin(0.03)
    session.graph.wait(lambda: len(session.silhouettes) > before, "silhouettes again")
    assert len(session.silhouettes) <= before + 2
