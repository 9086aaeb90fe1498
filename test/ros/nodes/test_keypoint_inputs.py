"""Points for the tracker that are late, seldom, missing, malformed, or of another type."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import rclpy
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PolygonStamped, PoseArray
from rclpy.context import Context
from rclpy.qos import QoSProfile
from sensor_msgs.msg import Image, PointCloud2
from std_msgs.msg import Header

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.detectors.image_points import LEG_POINT_NAMES, POINT_INDEX, ImagePoints
from cardbox_tracker.detectors.pose_network import LANDMARKS, NOBODY
from cardbox_tracker.ros.messages.conversions import camera_info_message, image_message
from cardbox_tracker.ros.messages.keypoints import people_message
from cardbox_tracker.ros.nodes import input_stream, keypoint_inputs
from cardbox_tracker.ros.nodes.camera_inputs import CameraInputs, ObservationSet
from cardbox_tracker.ros.nodes.keypoint_inputs import KeypointInputs
from cardbox_tracker.ros.nodes.tracker_parameters import TrackerParameters
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.node import CardboxNode

MS = 1_000_000
T = 10_000 * MS
CAMERA = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)
FULL = CAMERA.scaled(640, 480)
SILHOUETTE = np.zeros((48, 64), np.uint8)
NOSE = POINT_INDEX["nose"]


def header(at_ns: int, frame: str = "eye") -> Header:
    return Header(frame_id=frame, stamp=Time(sec=at_ns // 10**9, nanosec=at_ns % 10**9))


def keypoints(at_ns: int, column: float = 100.0, frame: str = "eye", people: int = 1) -> Any:
    """Return people whose points are all in one place of the camera's image of 640x480."""
    count = len(LANDMARKS)
    points_px = np.tile([column, 100.0], (count, 1))
    spatial_m = np.arange(3.0 * count).reshape(count, 3)
    one = NOBODY._replace(points_px=points_px, scores=np.full(count, 0.5), spatial_m=spatial_m)
    return people_message(header(at_ns, frame), [one] * people)


def without(name: str) -> Any:
    message = keypoints(T)
    message.fields = [field for field in message.fields if field.name != name]
    return message


class Tracker:
    """A node that only asks for points."""

    def __init__(
        self,
        bus: Any,
        source: str = "points",
        cameras: tuple[str, ...] = ("",),
        roll_deg: float = 0.0,
    ) -> None:
        self.bus = bus
        self.node = bus.start(lambda **options: CardboxNode("tracker", **options))
        names = [name for name in cameras if name]
        settings = TrackerParameters(keypoints=source, cameras=names, camera_roll_deg=roll_deg)
        self.inputs = KeypointInputs(self.node, settings)
        self.node.diagnostics.advice = self.inputs.warnings
        self.cameras = cameras

    def calibrate(self) -> Tracker:
        for name in self.cameras:
            place = f"/{name}/camera_info".replace("//", "/")
            self.bus.send(place, camera_info_message(header(T), FULL))
        return self

    def ask(self, at_ns: int, number: int = 0, frame: str = "eye") -> ImagePoints | None:
        return self.inputs.cameras[number].points(header(at_ns, frame), CAMERA, SILHOUETTE)

    def warning(self) -> str:
        return "; ".join(self.inputs.warnings().values())


@pytest.fixture
def tracker(bus: Any) -> Tracker:
    return Tracker(bus).calibrate()


def nose_of(points: ImagePoints | None) -> tuple[float, float]:
    assert points is not None
    return float(points.px[NOSE, 0]), float(points.px[NOSE, 1])


def test_points_are_placed_in_the_silhouette(tracker: Tracker) -> None:
    tracker.bus.send("/points", keypoints(T))
    points = tracker.ask(T)
    # A pixel of the silhouette is ten of the image.
    assert nose_of(points) == pytest.approx((100.5 / 10 - 0.5, 100.5 / 10 - 0.5))
    assert points is not None and points.stamp_ns == T
    assert points.scores[NOSE] == 0.5
    # Nothing that the detector found is lost on the way.
    assert points.spatial_m is not None and points.spatial_m[NOSE].tolist() == [0.0, 1.0, 2.0]
    assert points.legs is not None and points.legs.spatial_m is not None
    assert points.legs.px[-1].tolist() == pytest.approx([9.55, 9.55])
    at = 3.0 * LANDMARKS.index(LEG_POINT_NAMES[-1])
    assert points.legs.spatial_m[-1].tolist() == [at, at + 1, at + 2]


def test_points_in_space_are_turned_as_the_image_is(bus: Any) -> None:
    """Down in the image of a camera that lies on its right side is to the right in the room."""
    tracker = Tracker(bus, roll_deg=90.0).calibrate()
    bus.send("/points", keypoints(T))
    camera = Camera(48, 64, 60.0, 60.0, 23.5, 31.5)
    points = tracker.inputs.cameras[0].points(header(T), camera, np.zeros((64, 48), np.uint8))
    assert points is not None and points.spatial_m is not None
    assert points.spatial_m[NOSE].tolist() == pytest.approx([-1.0, 0.0, 2.0])


@pytest.mark.parametrize(
    ("late_ms", "expected_ms"), [(0, 0), (100, 100), (300, 300), (301, None), (-50, 0), (-51, None)]
)
def test_points_join_in_time_with_their_stamp(
    tracker: Tracker, late_ms: int, expected_ms: int | None
) -> None:
    tracker.bus.send("/points", keypoints(T))
    points = tracker.ask(T + late_ms * MS)
    assert (points is None) == (expected_ms is None)
    if points is not None:
        assert points.stamp_ns == T + (late_ms - (expected_ms or 0)) * MS


def test_a_lens_throws_no_point_far_away(bus: Any) -> None:
    tracker = Tracker(bus)
    info = camera_info_message(header(T), FULL)
    info.d = [-0.9, 0.9, 0.0, 0.0, 0.0]
    bus.send("/camera_info", info)
    for number, column in enumerate((300.0, 1200.0, -600.0)):
        bus.send("/points", keypoints(T + number * 33 * MS, column))
        points = tracker.ask(T + number * 33 * MS)
        if points is not None:
            assert np.all(np.abs(points.px[points.scores > 0.0]) < 2 * CAMERA.width)
        assert column != 300.0 or points is not None


def test_points_are_used_once_and_the_newest_ones(tracker: Tracker) -> None:
    for number in range(3):
        tracker.bus.send("/points", keypoints(T + number * 33 * MS, 100.0 + 10 * number))
    assert nose_of(tracker.ask(T + 80 * MS))[0] == pytest.approx(12.05 - 0.5)
    assert tracker.ask(T + 113 * MS) is None


def test_points_that_come_seldom_join_every_sixth_image(tracker: Tracker) -> None:
    joined = []
    for image in range(30):
        if image % 6 == 3 and image > 3:
            # They were found in an image that is three images old.
            tracker.bus.send("/points", keypoints(T + (image - 3) * 33 * MS))
        joined.append(tracker.ask(T + image * 33 * MS) is not None)
    # The second ones tell how the person moves, which holds for 0.15 s.
    there = [image for image, is_there in enumerate(joined) if is_there]
    assert there == [9, 15, 16, 21, 22, 27, 28]
    values = tracker.inputs.values()
    assert values["keypoints behind the image (ms)"] == "99"


@pytest.mark.parametrize("people", [1, 2])
def test_points_go_on_as_the_person_moves(tracker: Tracker, people: int) -> None:
    """A person moves by 10 px between two images; another one, who stands, is named first."""
    trunk = {"left_shoulder": (20, 0), "right_shoulder": (-20, 0), "left_hip": (10, 60)}
    trunk |= {"right_hip": (-10, 60), "nose": (0, -20), "left_knee": (10, 90)}

    def figure(column: float) -> Any:
        px, scores = np.zeros((len(LANDMARKS), 2)), np.zeros(len(LANDMARKS))
        for name, (across, down) in trunk.items():
            px[LANDMARKS.index(name)] = column + across, 100 + down
            scores[LANDMARKS.index(name)] = 0.9
        return NOBODY._replace(points_px=px, scores=scores)

    def seen(column: float) -> list[Any]:
        return [figure(500.0), figure(column)][2 - people :]

    def columns(at_ns: int) -> list[float] | None:
        found = tracker.inputs.cameras[0].people(header(at_ns), CAMERA)
        return None if not found else [round(10 * one.px[NOSE, 0] + 4.5, 3) for one in found]

    still = [500.0][2 - people :]
    for number, column in enumerate((100.0, 110.0)):
        message = people_message(header(T + 33 * number * MS), seen(column)[:: (-1) ** number])
        tracker.bus.send("/points", message)
    order = (-1) ** (people - 1)
    assert columns(T + 33 * MS) == [*still, 110.0][::order]
    assert columns(T + 66 * MS) == [*still, 120.0][::order]
    # A motion of 33 ms is too noisy for more than 66.
    assert columns(T + 132 * MS) == [*still, 130.0][::order]
    assert columns(T + 200 * MS) is None
    # Somebody else is where nobody was: nothing tells how they move.
    tracker.bus.send("/points", people_message(header(T + 233 * MS), seen(300.0)))
    assert columns(T + 266 * MS) == [*still, 300.0]
    assert columns(T + 300 * MS) is None


def test_points_of_a_newer_image_wait_for_their_silhouette(tracker: Tracker) -> None:
    tracker.bus.send("/points", keypoints(T + 200 * MS))
    assert tracker.ask(T) is None
    assert tracker.ask(T + 200 * MS) is not None


def test_nobody_gives_no_points(tracker: Tracker) -> None:
    tracker.bus.send("/points", people_message(header(T), []))
    assert tracker.ask(T) is None
    assert tracker.warning() == ""


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        (without("landmark"), "33 points with the fields u, v, score"),
        (without("score"), "expected u, v, score and landmark"),
        (keypoints(T, people=101), "3333 points"),
        (keypoints(T, float("nan")), "expected a place"),
        (keypoints(T, float("inf")), "expected a place"),
        (keypoints(0), "no stamp"),
    ],
)
def test_bad_messages_are_reported_and_not_used(
    tracker: Tracker, message: Any, expected: str
) -> None:
    for _ in range(3):
        tracker.bus.send("/points", message)
    assert tracker.ask(T) is None
    assert expected in tracker.warning() and "/points" in tracker.warning()
    # A good one follows, and the warning ends.
    tracker.bus.send("/points", keypoints(T + 33 * MS))
    assert tracker.ask(T + 33 * MS) is not None
    assert tracker.warning() == ""


def test_another_release_of_a_foreign_message_is_reported(tracker: Tracker) -> None:
    tracker.bus.send("/points", SimpleNamespace(header=header(T), people=[]))
    assert tracker.ask(T) is None
    assert "fields of sensor_msgs/msg/PointCloud2" in tracker.warning()


def test_points_of_another_camera_are_not_used(tracker: Tracker) -> None:
    tracker.bus.send("/points", keypoints(T, frame="other_eye"))
    assert tracker.ask(T) is None
    assert "'other_eye'" in tracker.warning() and "'eye'" in tracker.warning()


@pytest.mark.parametrize(("apart_s", "word"), [(-4, "older"), (4, "newer")])
def test_stamps_of_another_clock_are_reported(tracker: Tracker, apart_s: int, word: str) -> None:
    for image in range(20):
        tracker.bus.send("/points", keypoints(T + apart_s * 1000 * MS + image * 33 * MS))
        assert tracker.ask(T + image * 33 * MS) is None
    assert word in tracker.warning() and "s must be that of the image" not in tracker.warning()
    assert int(tracker.inputs.values()["keypoints not used"]) >= 5


def test_memory_is_bounded_while_no_silhouette_comes(tracker: Tracker) -> None:
    for image in range(1000):
        tracker.bus.send("/points", keypoints(T + image * 33 * MS))
    topic = tracker.inputs._topics[0]
    assert len(topic._kept) <= 8


def test_a_loop_of_the_recording_starts_anew(tracker: Tracker) -> None:
    tracker.bus.send("/points", keypoints(T))
    tracker.bus.send("/points", keypoints(T - 5000 * MS))
    assert tracker.ask(T - 5000 * MS) is not None


def test_without_the_cameras_calibration_it_is_said(
    bus: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    tracker = Tracker(bus)
    tracker.bus.send("/points", keypoints(T))
    assert tracker.ask(T) is None
    now_s = input_stream.time.monotonic()
    monkeypatch.setattr(input_stream.time, "monotonic", lambda: now_s + 5.0)
    assert "no CameraInfo has come on /camera_info" in tracker.warning()


def test_silence_is_reported(tracker: Tracker, monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = input_stream.time.monotonic()
    monkeypatch.setattr(input_stream.time, "monotonic", lambda: now_s + 5.0)
    assert "no points have come on /points" in tracker.warning()
    tracker.bus.send("/points", keypoints(T))
    assert tracker.warning() == ""
    monkeypatch.setattr(input_stream.time, "monotonic", lambda: now_s + 15.0)
    assert "nothing has come on /points for 10 s" in tracker.warning()


def test_one_camera_of_two_may_have_points(bus: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    tracker = Tracker(bus, cameras=("cam0", "cam1")).calibrate()
    tracker.bus.send("/cam1/points", keypoints(T))
    assert tracker.ask(T, 0) is None
    assert tracker.ask(T, 1) is not None
    now_s = input_stream.time.monotonic()
    monkeypatch.setattr(input_stream.time, "monotonic", lambda: now_s + 2.9)
    assert "cam1 keypoints rate (Hz)" in tracker.inputs.values()
    assert tracker.inputs.values()["cam0 keypoints age (s)"] == "never"
    assert tracker.warning() == ""


def table(folder: Path, *rows: str, camera: bool = False) -> Path:
    path = folder / "points.csv"
    names = "stamp_ns,joint,u,v,score" + (",camera" if camera else "")
    path.write_text("\n".join([names, *rows]), encoding="utf-8")
    return path


@pytest.mark.parametrize("is_zoomed", [False, True])
def test_a_calibration_that_the_silhouettes_contradict_is_not_followed(
    tracker: Tracker, is_zoomed: bool
) -> None:
    """The node that sees the images goes on with the calibration before, or follows, too."""
    other, silhouette = replace(FULL, fx=2 * FULL.fx, fy=2 * FULL.fy), CAMERA
    if is_zoomed:
        silhouette = replace(CAMERA, fx=2 * CAMERA.fx, fy=2 * CAMERA.fy)
    (source,) = tracker.inputs.cameras
    for number in range(65):
        source.points(header(T + number * 33 * MS), silhouette, SILHOUETTE)
        tracker.bus.send("/camera_info", camera_info_message(header(T), other))
    assert source._calibration is not None
    assert source._calibration.k[0, 0] == (other if is_zoomed else FULL).fx


def test_a_table_is_looked_up_by_the_stamp(bus: Any, tmp_path: Path) -> None:
    path = table(tmp_path, f"{T},nose,100,100,0.5", f"{T},left_knee,9,9,1")
    tracker = Tracker(bus, str(path))
    assert tracker.ask(T) is None
    tracker.calibrate()
    assert nose_of(tracker.ask(T)) == pytest.approx((9.55, 9.55))
    assert tracker.ask(T + 33 * MS) is None
    assert nose_of(tracker.ask(T)) == pytest.approx((9.55, 9.55))


def test_a_table_joins_the_nearest_image_and_says_how_many(bus: Any, tmp_path: Path) -> None:
    tracker = Tracker(bus, str(table(tmp_path, f"{T + 1},nose,100,100,0.5"))).calibrate()
    for at_ns in (T, T + 15 * MS, T + 17 * MS):
        tracker.ask(at_ns)
    assert tracker.inputs.values()["keypoints in images"] == "2 of 3"


def test_points_beside_the_silhouette_are_not_used(bus: Any) -> None:
    tracker = Tracker(bus).calibrate()
    silhouette = np.zeros((48, 64), np.uint8)
    silhouette[5:40, 28:44] = 255
    for image in range(12):
        at_ns = T + image * 33 * MS
        tracker.bus.send("/points", keypoints(at_ns))
        assert tracker.inputs.cameras[0].points(header(at_ns), CAMERA, silhouette) is None
    assert "the points of the last 12 images are not used: they lie beside" in tracker.warning()
    assert tracker.inputs.values()["keypoints in images"] == "0 of 12"


@pytest.mark.parametrize(
    ("row", "words"),
    [
        (f"{T},nose,nan,100,0.5", "line 2: nose is at"),
        (f"{T},nose,100,100,15", "line 2: nose has the score 15"),
        ("\n".join(f"{T},{name},0.5,0.5,1" for name in ("nose", "left_eye", "left_ear")), "shares"),
    ],
)
def test_a_table_is_checked_as_messages_are(bus: Any, tmp_path: Path, row: str, words: str) -> None:
    with pytest.raises(CardboxError, match=words):
        Tracker(bus, str(table(tmp_path, row)))


def test_a_point_of_a_table_far_outside_the_image_is_not_used(bus: Any, tmp_path: Path) -> None:
    tracker = Tracker(bus, str(table(tmp_path, f"{T},nose,9000,100,0.5"))).calibrate()
    assert tracker.ask(T) is None
    assert "nose is at (9000.0, 100.0) px; expected a place in the camera's" in tracker.warning()


def test_the_node_needs_a_table_with_stamps(bus: Any, tmp_path: Path) -> None:
    path = tmp_path / "points.csv"
    path.write_text("frame,joint,u,v,score\n0,nose,1,1,1\n")
    with pytest.raises(CardboxError, match="has no column stamp_ns"):
        Tracker(bus, str(path))


def test_a_table_of_several_cameras_names_them(bus: Any, tmp_path: Path) -> None:
    path = table(tmp_path, f"{T},nose,100,100,0.5,cam1", camera=True)
    tracker = Tracker(bus, str(path), ("cam0", "cam1")).calibrate()
    assert tracker.ask(T, 0) is None
    assert tracker.ask(T, 1) is not None


def test_a_table_that_cannot_be_read_ends_the_start(bus: Any, tmp_path: Path) -> None:
    with pytest.raises(CardboxError, match=r"nowhere\.csv"):
        Tracker(bus, str(tmp_path / "nowhere.csv"))
    with pytest.raises(CardboxError, match="no number"):
        Tracker(bus, str(table(tmp_path, f"{T},nose,x,100,0.5")))


def test_an_absolute_topic_is_of_one_camera(bus: Any) -> None:
    tracker = Tracker(bus, "/yolo/points", ("cam0",)).calibrate()
    tracker.bus.send("/yolo/points", keypoints(T))
    assert tracker.ask(T) is not None
    TrackerParameters(keypoints="/points.csv", cameras=["cam0", "cam1"]).check()
    with pytest.raises(ValueError, match="one topic for 2 cameras"):
        TrackerParameters(keypoints="/yolo/points", cameras=["cam0", "cam1"]).check()


def test_an_impossible_topic_ends_the_start(bus: Any) -> None:
    with pytest.raises(CardboxError, match="topic"):
        Tracker(bus, "not a topic")


@pytest.mark.parametrize("late", [0, 1])
def test_silhouettes_wait_for_the_points_of_a_detector_that_keeps_up(bus: Any, late: int) -> None:
    """Points come after the silhouette of their image, or of the image after it."""
    found: list[ObservationSet] = []
    node = bus.start(lambda **options: CardboxNode("tracker", **options))
    settings = TrackerParameters(keypoints="points", use_image=False)
    inputs = CameraInputs(
        node, settings, lambda *_: None, lambda _, all_: found.append(inputs.observed(all_))
    )
    bus.send("/silhouette/camera_info", camera_info_message(header(T), CAMERA))
    bus.send("/camera_info", camera_info_message(header(T), FULL))
    delivered = []
    for image in range(12):
        at_ns = T + image * 33 * MS
        bus.send("/silhouette", image_message(header(at_ns), SILHOUETTE, "mono8"))
        delivered.append(len(found))
        if image >= late:
            bus.send("/points", keypoints(at_ns - late * 33 * MS))
    points = [one.observations[0].points for one in found]
    if late:
        # The first images wait until the next one, in vain; later ones do not wait.
        assert delivered == [0, 1, 2, *range(4, 13)]
        assert all(one is not None for one in points[4:])
    else:
        assert delivered == [*range(12)] and len(found) == 12
        stamps = [one.stamp_ns for one in points if one is not None]
        assert stamps == [T + image * 33 * MS for image in range(12)]
    assert "keypoints rate (Hz)" in inputs.values([])


class Foreign:
    """A detector of another package: a node that other nodes reach over DDS only."""

    def __init__(self, kind: Any) -> None:
        self.context = Context()
        rclpy.init(context=self.context, args=[])
        self.node = rclpy.create_node("foreign", context=self.context, enable_rosout=False)
        self.publisher = self.node.create_publisher(kind, "points", qos.RESULT)

    def close(self) -> None:
        self.node.destroy_node()
        self.context.try_shutdown()


@pytest.fixture
def tracker_node() -> Iterator[CardboxNode]:
    rclpy.init(args=[])
    node = CardboxNode("tracker", enable_rosout=False)
    yield node
    node.destroy_node()
    rclpy.shutdown()


def until(node: Any, condition: Callable[[], Any]) -> None:
    """Spin a node until a condition holds."""
    for _ in range(600):
        if condition():
            return
        rclpy.spin_once(node, timeout_sec=0.05)
    raise AssertionError("it did not come")


def test_the_type_of_the_publisher_is_used_when_it_comes(
    tracker_node: CardboxNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    """PoseArray stands for a message of a package that may be installed."""
    persons = [ImagePoints.of({"nose": (100.0, 100.0, 0.5)})]
    types = keypoint_inputs.CONVERSIONS | {"geometry_msgs/msg/PoseArray": lambda _, __: persons}
    monkeypatch.setattr(keypoint_inputs, "CONVERSIONS", types)
    inputs = KeypointInputs(tracker_node, TrackerParameters(keypoints="points"))
    topic = inputs._topics[0]
    topic.size = (640, 480)

    def said(words: str) -> bool:
        return any(words in text for text in inputs.warnings().values())

    wrong = Foreign(Image)
    until(tracker_node, lambda: said("sensor_msgs/msg/Image"))
    assert said("expected one of") and said("hri_msgs/msg/Skeleton2D")
    wrong.close()
    for kind, count in ((PoseArray, 1), (PolygonStamped, 0), (PointCloud2, 0)):
        foreign = Foreign(kind)

        def arrived(foreign: Foreign = foreign, count: int = count) -> bool:
            at_ns = T + topic.stream.statistics.received * 33 * MS
            foreign.publisher.publish(foreign.publisher.msg_type(header=header(at_ns)))
            return bool(topic._kept) and len(topic._kept[-1].persons) == count

        until(tracker_node, arrived)
        assert not said("cannot be read") and tracker_node.diagnostics.remarks() == {}
        foreign.close()


def test_a_package_that_is_missing_is_named(bus: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    tracker = Tracker(bus)
    profile = QoSProfile(depth=1)
    ends = [SimpleNamespace(topic_type="yolo_msgs/msg/DetectionArray", qos_profile=profile)]
    monkeypatch.setattr(tracker.node, "get_publishers_info_by_topic", lambda _: ends)
    monkeypatch.setattr(keypoint_inputs, "optional_class", lambda *_: None)
    bus.tick()
    assert "install that package (ros-jazzy-yolo-msgs" in tracker.warning()
