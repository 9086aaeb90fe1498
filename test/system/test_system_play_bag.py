"""``play_bag`` plays a recording with its stamps, and pauses at the requested times."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import String

from cardbox_tracker.recordings.bag_writer import BagWriter
from cardbox_tracker.ros.messages.conversions import stamp_ns
from cardbox_tracker.ros.runtime import qos

START_NS = 1_700_000_000_000_000_000
PERIOD_NS = 50_000_000
COUNT = 40


@pytest.fixture(scope="module")
def bag(scene: Any, tmp_path_factory: Any) -> Path:
    return written(Path(tmp_path_factory.mktemp("bags")) / "mcap", "mcap", scene)


@pytest.fixture(autouse=True)
def _no_earlier_subscribers(graph: Any) -> Iterator[None]:
    """A player waits for subscribers, and those of an earlier test would be taken for them."""
    yield
    for subscription in list(graph.node.subscriptions):
        graph.node.destroy_subscription(subscription)


def written(path: Path, storage: str, scene: Any) -> Path:
    with BagWriter(path, storage=storage) as writer:
        for number in range(COUNT):
            now_ns = START_NS + number * PERIOD_NS
            writer.write_camera_info("/camera_info", now_ns, "optical", scene.camera)
            image = np.full((24, 32), number, np.uint8)
            writer.write_image("/image_raw", now_ns, "optical", image, "mono8")
    return path


def test_topics_of_the_player_itself_are_left_out(graph: Any, tmp_path: Path, scene: Any) -> None:
    bag = tmp_path / "bag"
    with BagWriter(bag, storage="mcap") as writer:
        for topic in ("/image_raw", "/rosout", "/play_bag/status", "/diagnostics"):
            writer.write_image(topic, START_NS, "optical", np.zeros((24, 32), np.uint8), "mono8")
    images = graph.collect(Image, "image_raw", qos.REPLAY)
    player = graph.start("play_bag", str(bag))
    assert graph.ended(player) == 0
    assert len(images) == 1
    for topic in ("/rosout", "/play_bag/status", "/diagnostics"):
        assert f"not played: {topic} is a topic of the player itself" in player.text()


def test_every_message_comes_with_its_stamp_in_order(
    graph: Any, scene: Any, tmp_path: Path
) -> None:
    """The other tests play MCAP."""
    bag = written(tmp_path / "sqlite3", "sqlite3", scene)
    images = graph.collect(Image, "image_raw", qos.REPLAY)
    infos = graph.collect(CameraInfo, "camera_info", qos.REPLAY)
    started = time.monotonic()
    process = graph.start("play_bag", str(bag), "--rate", "4", "--delay", "1")
    assert graph.ended(process) == 0
    assert time.monotonic() - started > COUNT * PERIOD_NS / 1e9 / 4
    graph.wait(lambda: len(images) == len(infos) == COUNT, "all messages")
    expected = [START_NS + number * PERIOD_NS for number in range(COUNT)]
    assert [stamp_ns(image.header.stamp) for image in images] == expected
    assert [image.data[0] for image in images] == list(range(COUNT))
    assert infos[0].k[0] == pytest.approx(300.0)


def test_a_second_camera_s_subscriber_that_comes_later_misses_nothing(
    own_graph: Any, tmp_path: Path
) -> None:
    graph = own_graph
    with BagWriter(tmp_path / "bag") as writer:
        for number in range(2 * COUNT):
            topic = f"/cam{number % 2}/image_raw"
            image = np.full((24, 32), number, np.uint8)
            writer.write_image(topic, START_NS + number * PERIOD_NS, "optical", image, "mono8")
    first = graph.collect(Image, "cam0/image_raw", qos.REPLAY)
    process = graph.start("play_bag", str(tmp_path / "bag"), "--rate", "4")
    graph.wait(lambda: graph.node.count_publishers("cam1/image_raw"), "the publisher")
    graph.spin(1.2)
    assert not first
    second = graph.collect(Image, "cam1/image_raw", qos.REPLAY)
    assert graph.ended(process) == 0
    graph.wait(lambda: len(first) == len(second) == COUNT, "all images")


def test_it_pauses_where_told_and_resumes_on_call(graph: Any, bag: Path) -> None:
    images = graph.collect(Image, "image_raw", qos.REPLAY)
    statuses = graph.collect(String, "play_bag/status", qos.LATCHED)
    process = graph.start(
        "play_bag", str(bag), "--rate", "4", "--delay", "1", "--pause-at", "0.5", "1.0"
    )

    def says(text: str) -> Any:
        return graph.wait(lambda: statuses and statuses[-1].data == text, f"status '{text}'")

    says("paused at 0.500 s")
    graph.spin(0.3)
    assert len(images) == 10
    assert graph.call("play_bag/resume").success
    says("paused at 1.000 s")
    graph.spin(0.3)
    assert len(images) == 20
    assert graph.call("play_bag/resume").success
    says("playing")
    response = graph.call("play_bag/pause")
    assert response.success and "paused at" in response.message
    assert graph.call("play_bag/resume").success
    assert graph.ended(process) == 0
    graph.wait(lambda: len(images) == COUNT, "all images")


def test_part_and_topics_can_be_chosen(graph: Any, bag: Path) -> None:
    images = graph.collect(Image, "image_raw", qos.REPLAY)
    infos = graph.collect(CameraInfo, "camera_info", qos.REPLAY)
    options = ("--start", "0.5", "--duration", "0.49", "--topics", "/image_raw", "--delay", "1")
    process = graph.start("play_bag", str(bag), *options)
    assert graph.ended(process) == 0
    graph.wait(lambda: len(images) == 10, "ten images")
    assert [image.data[0] for image in images] == list(range(10, 20))
    assert not infos


def test_it_waits_until_a_topic_is_published(graph: Any, bag: Path) -> None:
    images = graph.collect(Image, "image_raw", qos.REPLAY)
    process = graph.start("play_bag", str(bag), "--rate", "4", wait_for_topics="[keypoints]")
    graph.wait(lambda: "waiting for a publisher of /keypoints" in process.text(), "the words")
    graph.spin(1.0)
    assert not images
    publisher = graph.node.create_publisher(String, "keypoints", 1)
    assert graph.ended(process) == 0
    graph.wait(lambda: len(images) == COUNT, "all images")
    graph.node.destroy_publisher(publisher)


def test_resume_while_playing_is_refused(graph: Any, bag: Path) -> None:
    process = graph.start("play_bag", str(bag), "--no-wait", "--loop")
    response = graph.call("play_bag/resume")
    assert not response.success and "not paused" in response.message
    assert process.stop() == 0


def test_it_plays_in_the_process_of_the_nodes_and_ends_on_a_signal(graph: Any, bag: Path) -> None:
    images = graph.collect(Image, "image_raw", qos.REPLAY)
    given = ("-p", f"play_bag:bag:={bag}", "-p", "play_bag:loop:=true")
    process = graph.start("cardbox_nodes", "--with", "play_bag", "--ros-args", *given)
    graph.wait(lambda: len(images) > COUNT + 5, "images of the second round")
    assert process.stop() == 0, process.text()
    graph.processes.remove(process)
    assert "Traceback" not in process.text()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((), ("no bag is given",)),
        (("/nowhere/bag",), ("/nowhere/bag",)),
        (("BAG", "--topics", "/nothing"), ("no topic /nothing", "/image_raw")),
    ],
)
def test_a_bag_that_cannot_be_played_is_named(
    graph: Any, bag: Path, arguments: tuple[str, ...], words: tuple[str, ...]
) -> None:
    process = graph.start("play_bag", *(word.replace("BAG", str(bag)) for word in arguments))
    assert graph.ended(process) == 1
    for word in words:
        assert word in process.text()
    assert "Traceback" not in process.text()
