"""What a node takes, mends or refuses, a recording of the same messages does, too."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from rclpy.serialization import serialize_message
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header

from cardbox_tracker.camera.camera import Calibration
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.recordings.bag_writer import BagWriter
from cardbox_tracker.recordings.given_camera import GivenCamera
from cardbox_tracker.recordings.open_images import open_images
from cardbox_tracker.ros.nodes.camera_images import CameraImages
from cardbox_tracker.ros.runtime.node import CardboxNode
from cardbox_tracker.segmentation.silhouettes import SilhouettePipeline

K = [165.0, 0.0, 79.5, 0.0, 165.0, 59.5, 0.0, 0.0, 1.0]
BENT = [-0.03, 0.035, -0.0001, -0.0001, -0.012]
GREY = np.random.default_rng(0).integers(0, 256, (120, 160)).astype(np.uint8)
# The same with brightness from 16 to 235.
LIMITED = np.rint(16 + GREY * (219 / 255)).astype(np.uint8)
START_S = 1_700_000_000


class Outcome(NamedTuple):
    images: list[np.ndarray]
    calibration: Calibration | None
    fault: str


Messages = Sequence[CameraInfo | Image]


def info(model: str = "plumb_bob", d: Sequence[float] = (), **changes: Any) -> CameraInfo:
    header = Header(frame_id=changes.pop("frame_id", "left"))
    values = {"width": 160, "height": 120, "k": K} | changes
    return CameraInfo(header=header, distortion_model=model, d=list(d), **values)


def image(
    number: int = 0,
    encoding: str = "mono8",
    data: np.ndarray = GREY,
    step: int = 160,
    stamp: tuple[int, int] | None = None,
) -> Image:
    sec, nanosec = (START_S, number * 66_000_000) if stamp is None else stamp
    message = Image(header=Header(stamp=Time(sec=sec, nanosec=nanosec), frame_id="left"))
    message.height, message.width, message.encoding, message.step = 120, 160, encoding, step
    message.data = data.tobytes()
    return message


def live(
    messages: Messages,
    _: Path,
    hands: Any,
    make_node: Callable[..., Any],
    roll_deg: float = 0.0,
) -> Outcome:
    found: list[Calibration] = []
    images: list[np.ndarray] = []
    node = CardboxNode("tested", hands, context=make_node().context, enable_rosout=False)
    CameraImages(
        node,
        "raw",
        found.append,
        lambda _, seen, __: images.append(seen.copy()),
        roll_deg=roll_deg,
    )
    for message in messages:
        is_image = isinstance(message, Image)
        hands.give("/image_raw" if is_image else "/camera_info", message)
    status = node.diagnostics.status()
    node.destroy_node()
    fault = "" if images else status.message
    return Outcome(images, found[-1] if found else None, fault)


def recorded(messages: Messages, path: Path, *_: Any, roll_deg: float = 0.0) -> Outcome:
    with BagWriter(path / "bag") as bag:
        for number, message in enumerate(messages):
            name = "Image" if isinstance(message, Image) else "CameraInfo"
            topic = "/image_raw" if name == "Image" else "/camera_info"
            at_ns = START_S * 10**9 + number * 66_000_000
            bag.write_raw(topic, f"sensor_msgs/msg/{name}", serialize_message(message), at_ns)
    images: list[np.ndarray] = []
    given = GivenCamera(roll_rad=np.radians(roll_deg))
    with open_images(path / "bag", given) as source:
        try:
            calibration = source.calibration()
            images = [one.as_sent for one in source.images()]
        except CardboxError as error:
            return Outcome(images, None, str(error))
    return Outcome(images, calibration, "")


WAYS = pytest.mark.parametrize("way", [live, recorded])


@WAYS
@pytest.mark.parametrize(
    ("infos", "expected"),
    [
        ([info()], info()),
        ([info(width=0, height=0, k=[0.0] * 9), info(k=[0.0] * 9), info()], info()),
        ([info(k=[0.0] * 9, p=[*K[:3], 0.0, *K[3:6], 0.0, *K[6:], 0.0])], info()),
        ([info("plumb_bob", [*BENT, 0.0, 0.0, 0.0])], info("plumb_bob", BENT)),
        ([info("rational_polynomial", BENT)], info("plumb_bob", BENT)),
        ([info("plumb_bob", BENT[:2])], info("plumb_bob", [*BENT[:2], 0.0, 0.0, 0.0])),
        ([info("", BENT)], info("plumb_bob", BENT)),
        ([info("fisheye", BENT[:4])], info("equidistant", BENT[:4])),
        ([info(frame_id="/left")], info(frame_id="left")),
        ([info(frame_id="")], info(frame_id="camera_optical_frame")),
    ],
)
def test_a_camera_info_is_mended(
    way: Callable[..., Outcome],
    infos: list[CameraInfo],
    expected: CameraInfo,
    tmp_path: Path,
    hands: Any,
    make_node: Callable[..., Any],
) -> None:
    found = way([*infos, image(0), image(1)], tmp_path, hands, make_node)
    assert (found.fault, len(found.images)) == ("", 2)
    assert found.calibration is not None
    assert found.calibration.frame_id == expected.header.frame_id
    assert found.calibration.distortion_model == expected.distortion_model
    np.testing.assert_array_equal(found.calibration.k.ravel(), expected.k)
    assert (
        np.trim_zeros(found.calibration.distortion, "b").tolist()
        == list(expected.d)[: len(np.trim_zeros(found.calibration.distortion, "b"))]
    )


@WAYS
@pytest.mark.parametrize(
    ("one", "fault"),
    [
        (
            info(width=1280, height=720),
            "/camera_info is for images of 1280x720, but .* are 160x120",
        ),
        (info(width=120, height=160), "another shape; calibrate the camera at the size"),
        (info(k=[0.0] * 9), "/image_raw is not calibrated: .* K in /camera_info is all zero"),
        (info("plumb_bob", [0.1] * 3), "3 coefficients; expected 4 or 5"),
        (info("fov", [0.1]), "'fov' is unknown"),
    ],
)
def test_a_camera_info_is_refused_in_the_same_words(
    way: Callable[..., Outcome],
    one: CameraInfo,
    fault: str,
    tmp_path: Path,
    hands: Any,
    make_node: Callable[..., Any],
) -> None:
    found = way([one, image(0), image(1)], tmp_path, hands, make_node)
    assert re.search(fault, found.fault)


def pairs(u_first: bool) -> np.ndarray:
    grey = np.full_like(GREY, 128)
    return np.dstack([grey, GREY] if u_first else [GREY, grey])


@WAYS
@pytest.mark.parametrize(
    ("encoding", "data", "step"),
    [
        ("8UC1", GREY, 160),
        ("8UC3", np.dstack([GREY] * 3), 480),
        ("yuyv", pairs(False), 320),
        ("uyvy", pairs(True), 320),
        ("nv12", np.concatenate([LIMITED, np.full((60, 160), 128, np.uint8)]), 160),
        ("nv24", np.concatenate([GREY, np.full((240, 160), 128, np.uint8)]), 160),
        ("mono16", GREY.astype("<u2") << 2, 320),
        ("16UC1", GREY.astype("<u2") << 6, 320),
    ],
)
def test_an_encoding_gives_its_brightness(
    way: Callable[..., Outcome],
    encoding: str,
    data: np.ndarray,
    step: int,
    tmp_path: Path,
    hands: Any,
    make_node: Callable[..., Any],
) -> None:
    sent = [image(n, encoding, data, step) for n in range(2)]
    found = way([info(), *sent], tmp_path, hands, make_node)
    assert (found.fault, len(found.images)) == ("", 2)
    brightness = found.images[0] if found.images[0].ndim == 2 else found.images[0][..., 1]
    np.testing.assert_allclose(brightness, GREY, atol=1)


@WAYS
@pytest.mark.parametrize(
    ("stamps", "count"),
    [
        ([(0, 0)] * 4, 4),
        ([(START_S, n * 66_000_000) for n in (0, 1, 1, 2)], 3),
        # A recording that plays again begins anew with the image after the first one.
        ([(START_S, n * 66_000_000) for n in (0, 1, 2, 0, 1, 2, 3)], 6),
        ([(START_S + n, 0) for n in (0, 1, 2, 0, 1, 2)], 6),
        ([(5, 1), (START_S, 0), (START_S, 66_000_000)], 3),
    ],
)
def test_images_are_left_out_by_their_stamps(
    way: Callable[..., Outcome],
    stamps: list[tuple[int, int]],
    count: int,
    tmp_path: Path,
    hands: Any,
    make_node: Callable[..., Any],
) -> None:
    sent = [image(n, stamp=stamp) for n, stamp in enumerate(stamps)]
    found = way([info(), *sent], tmp_path, hands, make_node)
    assert len(found.images) == count


@WAYS
@pytest.mark.parametrize("roll_deg", [-90, 0, 30, 90, 180])
def test_a_turned_camera_is_made_level(
    way: Callable[..., Outcome],
    roll_deg: float,
    tmp_path: Path,
    hands: Any,
    make_node: Callable[..., Any],
) -> None:
    found = way([info(), image(0)], tmp_path, hands, make_node, roll_deg=roll_deg)
    assert found.calibration is not None
    level = SilhouettePipeline(found.calibration, (160, 120)).prepare(found.images[0])
    if roll_deg % 90 == 0:
        np.testing.assert_array_equal(level, np.rot90(GREY, -roll_deg // 90))
    else:
        assert level.shape == (120, 160)
