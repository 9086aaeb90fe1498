"""The node detector: points in the camera's pixels and silhouettes, with a fake network."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from std_msgs.msg import Header

from cardbox_tracker.camera.camera import Calibration
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.detectors.detector import PersonDetector
from cardbox_tracker.detectors.image_points import POINT_INDEX
from cardbox_tracker.detectors.pose_network import Detection
from cardbox_tracker.ros.messages.conversions import calibration_message, image_message
from cardbox_tracker.ros.messages.keypoints import persons_of_cloud
from cardbox_tracker.ros.nodes.background_node import BackgroundNode
from cardbox_tracker.ros.nodes.detector_node import DetectorNode

WIDTH, HEIGHT = 640, 480
K = np.array([(500.0, 0.0, 319.5), (0.0, 500.0, 239.5), (0.0, 0.0, 1.0)])
STRAIGHT = Calibration(WIDTH, HEIGHT, K, np.zeros(5))
CURVED = Calibration(WIDTH, HEIGHT, K, np.array([-0.2, 0.05, 0.0, 0.0, 0.0]))
ELBOW = POINT_INDEX["left_elbow"]


class Network:
    """Finds the centre of what is bright, and marks it."""

    several = 0

    def __init__(self) -> None:
        self.shapes: list[tuple[int, ...]] = []
        self.forgotten = 0

    def forget(self) -> None:
        self.forgotten += 1

    def __call__(self, image: np.ndarray, _: int | None = None) -> Detection | None:
        self.shapes.append(image.shape)
        bright = image[..., 0] > 128
        if not bright.any():
            return None
        place = np.argwhere(bright).mean(axis=0)[::-1]
        mask = np.where(bright, 128, 127).astype(np.uint8)
        return Detection(np.tile(place, (33, 1)), np.full(33, 0.75), mask)


def camera_image(column: float | None) -> np.ndarray:
    """Return an image (H, W) with a bright spot in a column, in the row 120."""
    image = np.full((HEIGHT, WIDTH), 60, np.uint8)
    if column is not None:
        image[112:129, int(column) - 8 : int(column) + 9] = 250
    return image


class Driver:
    """A detector node and a camera in front of it."""

    def __init__(self, bus: Any, calibration: Calibration = STRAIGHT, **parameters: Any) -> None:
        self.bus, self.network = bus, Network()
        person: Any = PersonDetector(self.network)  # type: ignore[arg-type]
        self.node = bus.start(lambda **options: DetectorNode(person, **options), **parameters)
        bus.send("/camera_info", calibration_message(Header(frame_id="eye"), calibration))

    def show(self, column: float | None, tenth: int = 10) -> None:
        """Show an image with a stamp in tenths of a second."""
        stamp = Time(sec=tenth // 10, nanosec=tenth % 10 * 10**8)
        header = Header(frame_id="eye", stamp=stamp)
        self.bus.send("/image_raw", image_message(header, camera_image(column), "mono8"))


@pytest.mark.parametrize("calibration", [STRAIGHT, CURVED])
def test_points_are_pixels_of_the_cameras_image(bus: Any, calibration: Calibration) -> None:
    driver = Driver(bus, calibration)
    driver.show(100.0)
    assert driver.network.shapes == [(240, 320, 3)]
    (message,) = bus.sent["/detector/keypoints"]
    assert (message.header.frame_id, message.header.stamp.sec) == ("eye", 1)
    (person,) = persons_of_cloud(message, (WIDTH, HEIGHT))
    assert person.px[ELBOW].tolist() == pytest.approx([100.0, 120.0], abs=1.0)
    assert person.scores[ELBOW] == pytest.approx(0.75)
    assert person.legs is not None and person.legs.scores.min() == 0.75
    assert "/silhouette" not in bus.sent


def test_without_a_person_the_message_has_no_points(bus: Any) -> None:
    driver = Driver(bus, publish_silhouette=True)
    driver.show(None)
    (message,) = bus.sent["/detector/keypoints"]
    assert (message.height, len(message.data)) == (0, 0)
    assert not np.any(np.frombuffer(bus.sent["/silhouette"][0].data, np.uint8))
    values = {value.key: value.value for value in bus.tick().values}
    assert values["images without a person"] == "1"


def test_the_mask_is_the_silhouette(bus: Any) -> None:
    driver = Driver(bus, publish_silhouette=True)
    driver.show(100.0)
    (silhouette,), (info,) = bus.sent["/silhouette"], bus.sent["/silhouette/camera_info"]
    pixels = np.frombuffer(silhouette.data, np.uint8).reshape(240, 320)
    assert set(np.unique(pixels)) == {0, 255}
    assert np.argwhere(pixels).mean(axis=0)[::-1] == pytest.approx((49.75, 59.75), abs=0.5)
    assert (silhouette.header.frame_id, info.header.stamp.sec) == ("eye", 1)
    assert (info.width, info.k[0]) == (320, 250.0)
    assert bus.sent["/silhouette/image"][0].height == 240


def test_a_recording_that_starts_again_is_a_new_person(bus: Any) -> None:
    driver = Driver(bus)
    for tenth in (50, 51, 52):
        driver.show(100.0, tenth)
    before = driver.network.forgotten
    driver.show(100.0, 10)
    assert driver.network.forgotten == before + 1
    assert len(bus.sent["/detector/keypoints"]) == 4


def test_the_rate_can_be_limited(bus: Any) -> None:
    driver = Driver(bus, rate_hz=2.5)
    for tenth in range(100, 120):
        driver.show(100.0, tenth)
    sent = [message.header.stamp for message in bus.sent["/detector/keypoints"]]
    tenths = [10 * stamp.sec + stamp.nanosec // 10**8 for stamp in sent]
    assert np.diff(tenths).tolist()[1:] == [4] * (len(tenths) - 2)


@pytest.mark.parametrize(("publish_silhouette", "looked"), [(False, 10), (True, 30)])
def test_points_alone_leave_time_to_the_tracker(
    bus: Any, publish_silhouette: bool, looked: int
) -> None:
    driver = Driver(bus, publish_silhouette=publish_silhouette)
    for number in range(30):
        header = Header(frame_id="eye", stamp=Time(sec=7, nanosec=number * 33_333_333))
        bus.send("/image_raw", image_message(header, camera_image(100.0), "mono8"))
    assert len(driver.network.shapes) == pytest.approx(looked, abs=1)
    assert bus.tick().message == "working"


def test_an_image_that_cannot_be_read_is_reported(bus: Any) -> None:
    driver = Driver(bus)
    message = image_message(Header(stamp=Time(sec=3)), camera_image(None), "mono8")
    message.encoding = "nonsense"
    bus.send("/image_raw", message)
    assert "nonsense" in bus.tick().message
    driver.show(100.0, 40)
    assert len(bus.sent["/detector/keypoints"]) == 1


def test_a_second_source_of_silhouettes_is_reported(
    bus: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    driver = Driver(bus, publish_silhouette=True)
    driver.show(100.0)
    assert bus.tick().message == "working"
    ends = [SimpleNamespace(node_namespace="/", node_name=n) for n in ("background", "detector")]
    found = {"/silhouette": ends}
    monkeypatch.setattr(
        driver.node, "get_publishers_info_by_topic", lambda topic: found.get(topic, [])
    )
    assert "/background, /detector" in bus.tick().message


@pytest.mark.parametrize("points", [18, 0])
def test_with_hri_msgs_there_is_a_skeleton_if_it_has_the_points_of_rep155(
    bus: Any, monkeypatch: pytest.MonkeyPatch, points: int
) -> None:
    class Skeleton2D:
        def __init__(self, header: Any = None) -> None:
            self.header = header
            self.skeleton = [SimpleNamespace(x=0.0, y=0.0, c=0.0) for _ in range(points)]

    Skeleton2D.__module__ = "hri_msgs.msg"
    module = ModuleType("hri_msgs.msg")
    module.__dict__["Skeleton2D"] = Skeleton2D
    monkeypatch.setitem(sys.modules, "hri_msgs", ModuleType("hri_msgs"))
    monkeypatch.setitem(sys.modules, "hri_msgs.msg", module)
    driver = Driver(bus)
    driver.show(100.0)
    assert len(bus.sent["/detector/keypoints"]) == 1
    if not points:
        assert "/detector/skeleton2d" not in bus.sent
        return
    (message,) = bus.sent["/detector/skeleton2d"]
    assert message.skeleton[0].x == pytest.approx(100.5 / WIDTH, abs=2 / WIDTH)
    assert message.header.frame_id == "eye"


def test_without_the_network_files_it_is_said_what_to_do(
    bus: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    with pytest.raises(CardboxError, match="cardbox detector --install"):
        bus.start(DetectorNode)


def test_several_people_are_in_one_message(bus: Any) -> None:
    driver = Driver(bus, people=2, publish_silhouette=True)
    places = (np.full((33, 2), column / 2 - 0.25) for column in (60.0, 200.0))
    pair = [Detection(place, np.full(33, 0.75), np.zeros((240, 320), np.uint8)) for place in places]
    driver.node._person.all_in = lambda at_ns, image: pair  # type: ignore[method-assign]
    driver.show(100.0)
    (message,) = bus.sent["/detector/keypoints"]
    people = persons_of_cloud(message, (640, 480))
    assert (message.height, message.width, len(people)) == (2, 33, 2)
    columns = [person.px[ELBOW, 0] for person in people]
    assert columns == pytest.approx([60.0, 200.0], abs=1.0)


@pytest.mark.parametrize(
    ("sent", "expected"),
    [((640, 360), (368, 208)), ((480, 480), (280, 280)), ((360, 640), (208, 370))],
)
@pytest.mark.parametrize("most", [{}, {"width": 240, "height": 320}])
def test_silhouettes_keep_the_aspect_of_the_images(
    bus: Any, sent: tuple[int, int], expected: tuple[int, int], most: dict[str, int]
) -> None:
    """Width and height are a number of pixels, the nodes detector and background alike."""
    k = np.array([(500.0, 0.0, sent[0] / 2), (0.0, 500.0, sent[1] / 2), (0.0, 0.0, 1.0)])
    calibration = Calibration(*sent, k, np.zeros(5))
    driver = Driver(bus, calibration, publish_silhouette=True, **most)
    image = np.full(sent[::-1], 60, np.uint8)
    bus.send("/image_raw", image_message(Header(stamp=Time(sec=1)), image, "mono8"))
    (info,) = bus.sent["/silhouette/camera_info"]
    assert (info.width, info.height) == expected
    assert info.k[0] == pytest.approx(info.k[4], rel=0.005)
    assert driver.network.shapes == [(*expected[::-1], 3)]
    node = bus.start(BackgroundNode, within_m=0.0, **most)
    node._on_calibration(calibration)
    assert (node._pipeline.camera.width, node._pipeline.camera.height) == expected
