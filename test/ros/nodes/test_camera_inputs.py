"""The tracker's cameras: their poses, and the synchronization of their messages."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from builtin_interfaces.msg import Time
from sensor_msgs.msg import CameraInfo, CompressedImage
from std_msgs.msg import Header

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.errors import CameraError
from cardbox_tracker.ros.messages.conversions import camera_info_message, image_message
from cardbox_tracker.ros.nodes import camera_poses, input_stream
from cardbox_tracker.ros.nodes.camera_inputs import CameraInputs, ObservationSet
from cardbox_tracker.ros.nodes.camera_poses import CameraPoses
from cardbox_tracker.ros.nodes.tracker_parameters import TrackerParameters

CAMERA = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)
S = 1_000_000_000


class Ears:
    """Replaces a node: passes messages to its subscriptions."""

    def __init__(self) -> None:
        self.callbacks: dict[str, Any] = {}
        self.kinds: dict[str, Any] = {}

    def resolve(self, topic: str) -> str:
        return f"/{topic.lstrip('/')}"

    def subscribe(self, kind: Any, topic: str, callback: Any, profile: Any) -> None:
        self.callbacks[self.resolve(topic)] = callback
        self.kinds[self.resolve(topic)] = kind

    def subscribe_info(self, topic: str, callback: Any) -> None:
        self.subscribe(CameraInfo, topic, callback, None)

    def hear(self, topic: str, message: Any, sent_ns: int = 1) -> None:
        self.callbacks[topic](message, sent_ns)


def header(stamp_ns: int = 0, frame: str = "left_frame") -> Header:
    return Header(frame_id=frame, stamp=Time(sec=stamp_ns // S, nanosec=stamp_ns % S))


def info(name: str, baseline_m: float = 0.0) -> CameraInfo:
    """Return the background node's CameraInfo for a camera at twice the working size."""
    large = camera_info_message(header(), CAMERA.scaled(128, 96))
    large.p[3] = -baseline_m * large.p[0]
    return camera_info_message(header(frame=f"{name}_frame"), CAMERA, large)


def transform(x_m: float, parent: str = "left_frame", child: str = "right_frame") -> Any:
    where = SimpleNamespace(
        rotation=SimpleNamespace(x=0.0, y=0.0, z=0.0, w=1.0),
        translation=SimpleNamespace(x=x_m, y=0.0, z=0.0),
    )
    stamped = SimpleNamespace(header=Header(frame_id=parent), child_frame_id=child, transform=where)
    return SimpleNamespace(transforms=[stamped])


class Listening:
    """The poses of two cameras, and the number of their changes."""

    def __init__(self, file: str = "") -> None:
        self.node = Ears()
        self.changes = 0
        self.poses = CameraPoses(self.node, ["left", "right"], file, self._changed)  # type: ignore[arg-type]

    def _changed(self) -> None:
        self.changes += 1

    def hear(self, name: str, baseline_m: float = 0.0) -> None:
        self.node.hear(f"/{name}/silhouette/camera_info", info(name, baseline_m))


@pytest.fixture
def listening(monkeypatch: pytest.MonkeyPatch) -> Listening:
    monkeypatch.setattr(camera_poses, "optional_class", lambda *_: object)
    return Listening()


def test_a_rectified_pair_says_itself_where_it_stands(listening: Listening) -> None:
    poses = listening.poses
    listening.hear("left")
    assert (poses.first, poses.missing) == (None, ["/right/silhouette/camera_info"])
    for _ in range(3):
        listening.hear("right", 0.12)
    assert listening.changes == 1
    assert poses.first == CAMERA
    np.testing.assert_allclose(poses.others[0].extrinsics.centre_m, [0.12, 0, 0], atol=1e-9)
    # The camera has moved, and the tracker must learn it.
    listening.hear("right", 0.24)
    assert listening.changes == 2
    np.testing.assert_allclose(poses.others[0].extrinsics.centre_m, [0.24, 0, 0], atol=1e-9)


def test_transforms_may_come_last_and_say_the_same_again(listening: Listening) -> None:
    for name in ("left", "right"):
        listening.hear(name)
    assert listening.poses.first is None
    with pytest.raises(CameraError, match="camera right"):
        listening.poses.check()
    for _ in range(3):
        listening.node.hear("/tf_static", transform(0.5))
    listening.poses.check()
    assert listening.changes == 2
    np.testing.assert_allclose(listening.poses.others[0].extrinsics.centre_m, [0.5, 0, 0])


def test_sources_that_disagree_stop_it_and_say_so(listening: Listening) -> None:
    listening.hear("left")
    listening.hear("right", 0.12)
    listening.node.hear("/tf_static", transform(0.2))
    assert listening.poses.first is None
    with pytest.raises(CameraError, match=r"8\.0 cm"):
        listening.poses.check()
    listening.node.hear("/tf_static", transform(0.12))
    assert listening.poses.first == CAMERA


def test_it_is_said_that_transforms_cannot_be_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(camera_poses, "optional_class", lambda *_: None)
    blind = Listening()
    for name in ("left", "right"):
        blind.hear(name)
    with pytest.raises(CameraError, match="tf2_msgs"):
        blind.poses.check()


class Watching:
    """Records the sets of two cameras and a depth image, or of one camera."""

    def __init__(self, depth: str = "depth", cameras: tuple[str, ...] = ("left", "right")) -> None:
        self.node = Ears()
        self.views: list[ObservationSet] = []
        settings = TrackerParameters(cameras=list(cameras), depth=depth)
        given = settings, lambda *_: None, self._take
        self.source = CameraInputs(self.node, *given)  # type: ignore[arg-type]
        for number, name in enumerate(cameras or ("",)):
            topic = f"/{name}/silhouette/camera_info".replace("//", "/")
            self.node.hear(topic, info(name, 0.12 * number))

    def _take(self, lead: Any, received: Any) -> None:
        self.views.append(self.source.observed(received))
        assert self.views[-1].header.stamp == lead.message.header.stamp

    def show(
        self, name: str, stamp_ns: int, size: tuple[int, int] = (48, 64), sent_ns: int = 1
    ) -> None:
        pixels = np.full(size, 255, np.uint8)
        message = image_message(header(stamp_ns, f"{name}_frame"), pixels, "mono8")
        self.node.hear(f"/{name}/silhouette".replace("//", "/"), message, sent_ns)

    def show_depth(self, stamp_ns: int, depth_m: np.ndarray) -> None:
        pixels = depth_m.astype(np.float32)
        self.node.hear("/depth", image_message(header(stamp_ns), pixels, "32FC1"))


@pytest.fixture
def watching(monkeypatch: pytest.MonkeyPatch) -> Watching:
    monkeypatch.setattr(camera_poses, "optional_class", lambda *_: None)
    return Watching()


def test_what_belongs_to_one_time_comes_together(watching: Watching) -> None:
    watching.show_depth(S, np.full((96, 128), 2.0))
    watching.show("right", S + 8_000_000)
    assert watching.views == []
    watching.show("left", S)
    (views,) = watching.views
    assert views.header == header(S)
    assert [h.frame_id for h in views.headers if h] == ["left_frame", "right_frame"]
    left, right = views.observations
    assert (left.image, right.image, left.stamp_ns) == (None, None, S)
    assert left.depth_m is not None
    assert left.depth_m.shape == (48, 64)
    assert np.all(left.depth_m == 2.0)


def test_packed_depth_is_read_too() -> None:
    watching = Watching("depth/compressedDepth")
    assert watching.node.kinds["/depth/compressedDepth"] is CompressedImage
    png = cv2.imencode(".png", np.full((48, 64), 1700, np.uint16))[1].tobytes()
    packed = CompressedImage(header=header(S), format="16UC1; compressedDepth png")
    packed.data = bytes(12) + png
    watching.node.hear("/depth/compressedDepth", packed)
    for name in ("left", "right"):
        watching.show(name, S)
    depth_m = watching.views[0].observations[0].depth_m
    assert depth_m is not None
    assert np.allclose(depth_m, 1.7)
    # The CameraInfo belongs to the topic without the plugin's name.
    assert "/depth/camera_info" in watching.node.callbacks


@pytest.mark.promise("Depth in another unit or of another view is refused with a reason")
def test_depth_in_millimetres_is_told_and_not_used(watching: Watching) -> None:
    for number, depth_m in enumerate((2.0, 2000.0, 2.0), 1):
        watching.show_depth(number * S, np.full((48, 64), depth_m))
        for name in ("left", "right"):
            watching.show(name, number * S)
        texts = [text for text in watching.source.warnings().values() if "/depth" in text]
        is_used = watching.views[-1].observations[0].depth_m is not None
        assert is_used == (depth_m == 2.0) == (not texts)
        if texts:
            assert "2e+03 or more" in texts[0] and "divide them by 1000" in texts[0]


def test_depth_of_another_view_is_moved_by_its_own_camera_info(watching: Watching) -> None:
    # The depth camera has twice the size, and its principal point is 10 px further to the right.
    own = Camera(128, 96, 120.0, 120.0, 73.5, 47.5)
    watching.node.hear("/depth/camera_info", camera_info_message(header(), own))
    depth = np.zeros((96, 128))
    depth[:, 74:] = 3.0
    watching.show_depth(S, depth)
    watching.show("right", S)
    watching.show("left", S)
    found = watching.views[0].observations[0].depth_m
    assert found is not None
    # A point to the right of one optical axis is to the right of the other.
    assert np.all(found[:, :31] == 0)
    assert np.all(found[:, 33:58] == 3.0)


def test_without_the_first_camera_the_earliest_image_gives_the_stamp(watching: Watching) -> None:
    for number in range(1, 12):
        watching.show("right", number * S // 10)
    assert watching.views[-1].header.frame_id == "left_frame"
    assert watching.views[-1].observations[0].silhouette is None
    assert not watching.views[-1].picture().any()
    # A set with only a depth image is not delivered.
    count = len(watching.views)
    for number in range(20, 30):
        watching.show_depth(number * S // 10, np.ones((48, 64)))
    assert len(watching.views) == count


def test_what_cannot_be_read_is_left_out_and_said(watching: Watching) -> None:
    for name, size in (("left", (48, 64)), ("right", (24, 32))):
        watching.show(name, S, size)
    watching.show_depth(S, np.ones((48, 64)))
    (views,) = watching.views
    assert views.observations[0].silhouette is not None
    assert views.observations[1].silhouette is None
    (text,) = watching.source.warnings().values()
    assert "/right/silhouette" in text and "32x24" in text
    with pytest.raises(CameraError, match="32x24"):
        for name in ("left", "right", "depth"):
            if name == "depth":
                watching.show_depth(2 * S, np.ones((48, 64)))
            else:
                watching.show(name, 2 * S, (24, 32))


def test_silence_and_other_clocks_are_said(
    watching: Watching, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_s = input_stream.time.monotonic()
    monkeypatch.setattr(input_stream.time, "monotonic", lambda: now_s)
    for number in range(10):
        assert not watching.source.warnings()
        stamp_ns = 100 * S + number * S // 10
        watching.show("left", stamp_ns)
        watching.show("right", stamp_ns - 10 * S)
        watching.show_depth(stamp_ns, np.ones((48, 64)))
    (text,) = watching.source.warnings().values()
    assert "10.00 s apart" in text
    now_s += 5.0
    watching.show("left", 106 * S)
    watching.show_depth(106 * S, np.ones((48, 64)))
    (text,) = watching.source.warnings().values()
    assert "/right/silhouette for 5 s" in text
    values = watching.source.values([0.9, None])
    assert values["left iou"] == "0.900"
    assert values["right iou"] == "sees nobody"
    assert (values["left age (s)"], values["right age (s)"]) == ("0.0", "5.0")
    assert values["right rate (Hz)"] == "2.0"


def test_stamps_that_stand_still_are_said(watching: Watching) -> None:
    for number in range(15):
        stamp_ns = 100 * S + number * S // 10
        watching.show("left", stamp_ns)
        watching.show("right", 100 * S)
        watching.show_depth(stamp_ns, np.ones((48, 64)))
    text = "; ".join(watching.source.warnings().values())
    assert "the stamps of the last 14 messages on /right/silhouette stand still" in text
    assert watching.views[-1].observations[1].silhouette is None
    watching.show("right", 102 * S)
    assert not any("stand still" in text for text in watching.source.warnings().values())


CLOCKS = "Cameras that disagree, or that come and go, are reported"


@pytest.mark.promise(CLOCKS)
@pytest.mark.parametrize("apart_s", [2, -2, 1000])
def test_clocks_that_are_apart_are_told(watching: Watching, apart_s: int) -> None:
    for number in range(2000, 2020):
        for name, stamp_s in (("left", 0), ("right", apart_s)):
            watching.show(name, number * S // 10 + (stamp_s + 2000) * S)
        watching.show_depth(number * S // 10 + 2000 * S, np.ones((48, 64)))
    (text,) = watching.source.warnings().values()
    assert f"{abs(apart_s)}.00 s apart" in text
    # One camera goes on alone: the one whose clock is behind.
    behind = int(apart_s < 0)
    assert sum(view.headers[behind] is not None for view in watching.views) == 20
    assert all(None in view.headers for view in watching.views)


@pytest.mark.promise(CLOCKS)
@pytest.mark.parametrize(
    ("apart_s", "drift", "delay_s", "told"),
    [
        (0.2, 0.0, 0.0, "0.20 s"),  # a steady difference, in which images still pair
        (-0.2, 0.0, 0.04, "0.24 s"),
        (0.0, 0.01, 0.0, "0.17 s"),  # the mean of two to four seconds ago, at 1 % faster
        (0.0, 0.0, 0.08, ""),  # a camera whose images take longer than the interval
        (0.0, 0.0, 0.0, ""),
    ],
)
def test_clocks_a_little_apart_or_adrift_are_told(
    watching: Watching,
    monkeypatch: pytest.MonkeyPatch,
    apart_s: float,
    drift: float,
    delay_s: float,
    told: str,
) -> None:
    """At 15 Hz, for 19 s; an image is sent when it is taken, or ``delay_s`` later."""
    now_s = 1000.0
    monkeypatch.setattr(input_stream.time, "monotonic", lambda: now_s)
    times = [(number / 15, "left") for number in range(285)]
    times += [(number / 15 + delay_s, "right") for number in range(285)]
    for at_s, name in sorted(times):
        now_s = 1000.0 + at_s
        taken_s = at_s if name == "left" else at_s - delay_s
        own_s = taken_s if name == "left" else apart_s + taken_s * (1 + drift)
        watching.show(name, round((500 + own_s) * S))
        if name == "left":
            watching.show_depth(round((500 + at_s) * S), np.ones((48, 64)))
    texts = watching.source.warnings()
    assert list(texts) == (["clock of right"] if told else [])
    assert all(f"are {told} apart" in text for text in texts.values())


@pytest.mark.parametrize("clock_s", [0.0, -0.5])
def test_only_other_clocks_are_to_be_synchronized(watching: Watching, clock_s: float) -> None:
    """The stamps are 0.5 s apart: the images take so long, or their computer's clock is behind."""
    for number in range(20):
        now_ns, stamp_ns = input_stream.time.time_ns(), (100 + number) * S
        watching.show("left", stamp_ns, sent_ns=now_ns)
        watching.show("right", stamp_ns - S // 2, sent_ns=now_ns + round(clock_s * S))
        watching.show_depth(stamp_ns, np.ones((48, 64)))
    text = watching.source.warnings()["clock of right"]
    assert "0.50 s apart" in text
    assert ("synchronize them" in text) is (clock_s != 0.0)
    assert ("smaller or fewer images" in text) is (clock_s == 0.0)


def test_of_nothing_at_all_it_is_not_said_that_tracking_goes_on(
    watching: Watching, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_s = input_stream.time.monotonic()
    monkeypatch.setattr(input_stream.time, "monotonic", lambda: now_s + 10.0)
    assert not watching.source.warnings()
    watching.show("left", S)
    assert len(watching.source.warnings()) == 2


@pytest.mark.promise(CLOCKS)
def test_a_camera_that_dies_and_returns_with_another_size(watching: Watching) -> None:
    def go_on(begin: int, names: tuple[str, ...], size: tuple[int, int] = (48, 64)) -> list[bool]:
        count = len(watching.views)
        for number in range(begin, begin + 20):
            for name in names:
                watching.show(name, number * S // 10, size if name == "right" else (48, 64))
            watching.show_depth(number * S // 10, np.ones((48, 64)))
        seen = [view.observations for view in watching.views[count:]]
        assert all(left.silhouette is not None for left, _ in seen)
        return [right.silhouette is not None for _, right in seen]

    both = ("left", "right")
    assert all(go_on(10, both))
    assert not any(go_on(30, ("left",)))
    assert go_on(50, both)[-10:] == [True] * 10
    assert not any(go_on(70, both, (24, 32))[2:])
    assert "32x24" in " ".join(watching.source.warnings().values())
    assert go_on(90, both)[-10:] == [True] * 10
    assert not watching.source.warnings()


def test_a_camera_that_pauses_has_no_other_clock(
    watching: Watching, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_s = input_stream.time.monotonic()
    monkeypatch.setattr(input_stream.time, "monotonic", lambda: now_s)
    watching.show("right", 100 * S)
    now_s += 1.5
    watching.show("left", 100 * S + 3 * S // 2)
    watching.show_depth(100 * S + 3 * S // 2, np.ones((48, 64)))
    assert not watching.source.warnings()


def test_one_camera_is_a_list_of_one() -> None:
    alone = Watching(depth="", cameras=())
    alone.source.wait_for_images(False)
    pixels = np.zeros((48, 64), np.uint8)
    alone.node.hear("/silhouette/image", image_message(header(S), pixels, "mono8"))
    # Every message is delivered, because the node counts repeated and late ones.
    for stamp_ns in (S, S, 3 * S, 2 * S):
        alone.show("", stamp_ns)
    assert [view.observations[0].stamp_ns for view in alone.views] == [S, S, 3 * S, 2 * S]
    assert [view.observations[0].image is None for view in alone.views] == [False, True, True, True]
    assert alone.views[0].header.frame_id == "_frame"
    assert (alone.source.values([0.9]), alone.source.warnings()) == ({}, {})
    with pytest.raises(CameraError, match="32x24"):
        alone.show("", 4 * S, (24, 32))


def test_one_camera_with_a_name_has_values_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = input_stream.time.monotonic()
    monkeypatch.setattr(input_stream.time, "monotonic", lambda: now_s)
    alone = Watching(depth="", cameras=("left",))
    for step in range(10):
        alone.show("left", S + step * S // 5)
    now_s += 2.0
    assert alone.source.values([0.9]) == {"left rate (Hz)": "5.0", "left age (s)": "2.0"}
    assert alone.source.warnings() == {}
