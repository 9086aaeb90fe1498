"""Tracker and pairing with stamps that are zero, repeat or jump."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from rclpy.parameter import Parameter
from sensor_msgs.msg import Image
from std_msgs.msg import Header

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import save_body_model
from cardbox_tracker.ros.messages.conversions import camera_info_message, image_message, stamp_ns
from cardbox_tracker.ros.nodes.camera_inputs import ImagePairing
from cardbox_tracker.ros.nodes.tracker_node import TrackerNode
from cardbox_tracker.tracking.estimate import Estimate
from cardbox_tracker.tracking.tracker import Tracker

CAMERA = Camera(160, 120, 150.0, 150.0, 79.5, 59.5)
EMPTY = np.zeros((120, 160), np.uint8)
S = 10**9


class Fed:
    """A tracker node with its tracked stamps and its number of starts."""

    def __init__(self, node: TrackerNode, hands: Any, monkeypatch: pytest.MonkeyPatch) -> None:
        self.node, self._hands = node, hands
        self.trackers: list[Tracker] = []

        def track(tracker: Tracker, observations: Any) -> Estimate:
            self.trackers.append(tracker)
            return Estimate("no_person")

        monkeypatch.setattr(Tracker, "track", track)
        hands.give("/silhouette/camera_info", camera_info_message(Header(), CAMERA))

    def show(self, *stamps_ns: int) -> None:
        for stamp in stamps_ns:
            header = Header(stamp=Time(sec=stamp // S, nanosec=stamp % S))
            self._hands.give("/silhouette", image_message(header, EMPTY, "mono8"))

    @property
    def starts(self) -> int:
        return len({id(tracker) for tracker in self.trackers})


@pytest.fixture
def fed(
    make_node: Callable[..., Any], hands: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Fed]:
    path = tmp_path / "body.yaml"
    save_body_model(BodyModel(), path)
    node = TrackerNode(
        intra_process=hands,
        context=make_node().context,
        enable_rosout=False,
        parameter_overrides=[Parameter("model_file", value=str(path))],
    )
    yield Fed(node, hands, monkeypatch)
    node.destroy_node()


@pytest.mark.promise("Whatever the stamps, each image has one place in the order")
def test_images_without_stamps_are_tracked_in_one_go(fed: Fed) -> None:
    fed.show(*[0] * 10)
    assert (len(fed.trackers), fed.starts) == (10, 1)
    status = fed.node.diagnostics.status()
    assert any("the images have no stamp" in value.value for value in status.values)


@pytest.mark.promise("Whatever the stamps, each image has one place in the order")
def test_an_image_that_comes_twice_is_used_once(fed: Fed) -> None:
    fed.show(*[stamp for i in range(1, 6) for stamp in (i * S // 10, i * S // 10)])
    assert (len(fed.trackers), fed.starts) == (5, 1)


def test_images_that_were_overtaken_do_not_restart_tracking(fed: Fed) -> None:
    fed.show(10 * S, 11 * S, 10 * S + S // 2, 12 * S)
    assert (len(fed.trackers), fed.starts) == (3, 1)


def test_a_jump_back_restarts_and_a_jump_ahead_does_not(fed: Fed) -> None:
    fed.show(100 * S, 101 * S, 5000 * S, 5001 * S)
    assert fed.starts == 1
    fed.show(50 * S, 51 * S)
    assert (len(fed.trackers), fed.starts) == (6, 2)


def test_without_stamps_each_silhouette_goes_with_the_latest_image() -> None:
    pairs = []
    pairing = ImagePairing(lambda silhouette, image, _: pairs.append((silhouette, image)))
    images = [Image(encoding=str(number)) for number in range(4)]
    for image in images:
        pairing.add_image(image, 0)
        pairing.add_silhouette(Image(), 0)
    assert [image.encoding for _, image in pairs] == ["0", "1", "2", "3"]
    assert all(stamp_ns(image.header.stamp) == 0 for _, image in pairs)
