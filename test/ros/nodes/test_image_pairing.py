"""Silhouettes and images are paired by stamp, inside one process and over DDS."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.common.errors import CameraError
from cardbox_tracker.measuring.config import InitializationConfig
from cardbox_tracker.person.appearance import Appearance
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import save_body_model
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.ros.messages import conversions
from cardbox_tracker.ros.nodes.background_node import BackgroundNode
from cardbox_tracker.ros.nodes.camera_inputs import ImagePairing
from cardbox_tracker.ros.nodes.reference_capture import ReferenceCapture
from cardbox_tracker.ros.nodes.tracker_node import TrackerNode
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.node import IntraProcess
from cardbox_tracker.tracking.estimate import Estimate
from cardbox_tracker.tracking.observation import Observation
from cardbox_tracker.tracking.tracker import Tracker

BODY = BodyModel.of(distance_m=2.3, hip_height_m=-0.45)
CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)


def message(number: int) -> Image:
    return Image(header=Header(stamp=Time(sec=number)))


class Delivered:
    """Records the delivered numbers of silhouette and image."""

    def __init__(self) -> None:
        self.pairs: list[tuple[int, int | None]] = []
        self.pairing = ImagePairing(self._take)

    def _take(self, silhouette: Image, image: Image | None, sent_ns: int) -> None:
        assert sent_ns == 10 * silhouette.header.stamp.sec
        number = None if image is None else image.header.stamp.sec
        self.pairs.append((silhouette.header.stamp.sec, number))

    def image(self, *numbers: int) -> None:
        for number in numbers:
            self.pairing.add_image(message(number), 0)

    def silhouette(self, *numbers: int) -> None:
        for number in numbers:
            self.pairing.add_silhouette(message(number), 10 * number)


def test_an_image_that_came_first_goes_with_its_silhouette() -> None:
    delivered = Delivered()
    for number in range(3):
        delivered.image(number)
        delivered.silhouette(number)
    assert delivered.pairs == [(0, 0), (1, 1), (2, 2)]


def test_a_silhouette_waits_for_its_image_until_the_next_silhouette() -> None:
    delivered = Delivered()
    delivered.image(1)
    delivered.silhouette(1, 2)
    assert delivered.pairs == [(1, 1)]
    delivered.image(2)
    assert delivered.pairs == [(1, 1), (2, 2)]
    delivered.silhouette(3, 4)
    assert delivered.pairs[2:] == [(3, None)]
    delivered.image(3)  # too late
    delivered.image(4)
    assert delivered.pairs[3:] == [(4, 4)]


def test_nobody_waits_for_images_that_never_came_or_ceased() -> None:
    delivered = Delivered()
    delivered.silhouette(1, 2)
    assert delivered.pairs == [(1, None), (2, None)]
    delivered.image(3)
    delivered.silhouette(3, *range(10, 20))
    # After five silhouettes without an image, the next ones do not wait.
    assert delivered.pairs[2:] == [(3, 3), *((number, None) for number in range(10, 20))]


def test_without_waiting_an_image_that_is_there_is_used_all_the_same() -> None:
    delivered = Delivered()
    delivered.pairing.waits = False
    delivered.image(1)
    delivered.silhouette(1, 2)
    assert delivered.pairs == [(1, 1), (2, None)]


def test_only_the_latest_images_are_kept() -> None:
    delivered = Delivered()
    delivered.image(*range(10))
    delivered.silhouette(2, 7)
    assert delivered.pairs == [(2, None), (7, 7)]


def test_an_error_with_one_silhouette_does_not_lose_the_next() -> None:
    taken = []

    def take(silhouette: Image, image: Image | None, _: int) -> None:
        taken.append(silhouette.header.stamp.sec)
        if silhouette.header.stamp.sec == 1:
            raise CameraError("no")

    pairing = ImagePairing(take)
    pairing.add_image(message(0), 0)
    pairing.add_silhouette(message(1), 0)
    with pytest.raises(CameraError):
        pairing.add_silhouette(message(2), 0)
    pairing.add_image(message(2), 0)
    assert taken == [1, 2]


def test_an_image_of_another_size_is_refused() -> None:
    silhouette = np.zeros((240, 320), np.uint8)
    small = conversions.image_message(Header(), np.zeros((120, 160, 3), np.uint8))
    with pytest.raises(CameraError, match=r"160x120 .*320x240; take both"):
        conversions.image_behind(silhouette, small)
    assert conversions.image_behind(silhouette, None) is None
    grey = conversions.image_message(Header(), silhouette)
    assert grey.encoding == "mono8"
    assert conversions.image_behind(silhouette, grey).shape == (240, 320)


def test_captures_keep_the_images_of_their_silhouettes() -> None:
    references = ReferenceCapture("silhouette")
    silhouette = render(cardbox_patches(BODY, reference_posture("front")), CAMERA)
    for number in range(6):
        header = Header(stamp=Time(sec=10, nanosec=number * 100_000_000))
        if number != 4:  # lost
            image = np.full((240, 320, 3), number, np.uint8)
            references.add_image(conversions.image_message(header, image), 0)
        references.add(conversions.image_message(header, silhouette))
    references.capture("front", None, InitializationConfig())
    assert [int(image[0, 0, 0]) for image in references.images["front"]] == [1, 2, 3, 5]


@pytest.fixture
def graph(
    tmp_path: Path, make_node: Callable[..., Any]
) -> Iterator[Callable[[bool, bool], tuple[Any, Any]]]:
    """Return a function that starts background and tracker, in one process or over DDS."""
    probe = make_node(name="probe")
    executor = SingleThreadedExecutor(context=probe.context)
    executor.add_node(probe)
    made: list[Any] = []
    levels = np.zeros((5, 1728), np.uint8)
    path = tmp_path / "body.yaml"
    save_body_model(BODY.with_values(appearance=Appearance(levels, np.full(3, 100.0))), path)

    def start(inside: bool, use_image: bool) -> tuple[Any, Any]:
        shared = IntraProcess() if inside else None
        for kind, values in (
            (BackgroundNode, {"learn_images": 5}),
            (TrackerNode, {"model_file": str(path), "use_image": use_image}),
        ):
            overrides = [Parameter(name, value=value) for name, value in values.items()]
            node = kind(
                intra_process=shared,
                context=probe.context,
                parameter_overrides=overrides,
                enable_rosout=False,
            )
            executor.add_node(node)
            made.append(node)
        return probe, executor

    yield start
    for node in made:
        node.close()
        node.destroy_node()
    executor.shutdown()


@pytest.mark.parametrize(("inside", "use_image"), [(False, True), (True, True), (False, False)])
def test_the_tracker_gets_silhouette_and_image_of_one_stamp(
    graph: Callable[[bool, bool], tuple[Any, Any]],
    monkeypatch: pytest.MonkeyPatch,
    inside: bool,
    use_image: bool,
) -> None:
    seen: list[Any] = []

    def track(_: Tracker, observations: list[Observation]) -> Estimate:
        (one,) = observations
        assert one.silhouette is not None
        seen.append((one.silhouette.copy(), None if one.image is None else one.image.copy()))
        return Estimate("no_person")

    probe, executor = graph(inside, use_image)
    monkeypatch.setattr(Tracker, "track", track)
    images = probe.create_publisher(Image, "image_raw", qos.CAMERA)
    infos = probe.create_publisher(CameraInfo, "camera_info", qos.CAMERA)
    person = render(cardbox_patches(BODY, reference_posture("front")), CAMERA) > 0
    rng = np.random.default_rng(0)
    limit = time.monotonic() + 60
    number, shown = 0, {}
    while len(seen) < 8 and time.monotonic() < limit:
        number += 1
        image = np.clip(90 + rng.normal(0, 2, (240, 320, 3)), 0, 255).astype(np.uint8)
        if number > 12:
            # The colour of the image encodes its number.
            image[person] = (200, 30, number % 200)
        header = Header(frame_id="camera", stamp=Time(sec=number))
        infos.publish(conversions.camera_info_message(header, CAMERA))
        images.publish(conversions.image_message(header, image))
        shown[number] = image
        end = time.monotonic() + 0.05
        while time.monotonic() < end:
            executor.spin_once(timeout_sec=0.01)
    assert len(seen) >= 8
    with_image = [(silhouette, image) for silhouette, image in seen if image is not None]
    if not use_image:
        assert not with_image
        return
    assert len(with_image) >= len(seen) - 1
    for silhouette, image in with_image:
        assert any(np.array_equal(image, one) for one in shown.values())
        inside_px = image[silhouette > 0]
        if len(inside_px) > 1000:
            assert np.median(inside_px[:, 0]) == 200
            assert len(np.unique(inside_px[inside_px[:, 0] == 200][:, 2])) == 1
