"""A silhouette of another node is tracked whatever its encoding, or refused; the tracker stays."""

from __future__ import annotations

from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from sensor_msgs.msg import Image
from std_msgs.msg import Header, String

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import dumps_body_model
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.ros.messages.conversions import camera_info_message
from cardbox_tracker.ros.nodes.initializer_node import InitializerNode
from cardbox_tracker.ros.nodes.tracker_node import TrackerNode

CAMERA = Camera(96, 72, 99.0, 99.0, 47.5, 35.5)
BODY = BodyModel()
FRONT = reference_posture("front")
PERSON = render(cardbox_patches(BODY, FRONT), CAMERA) > 0


def header(number: int) -> Header:
    return Header(frame_id="eye", stamp=Time(sec=10 + number))


def message(number: int, pixels: np.ndarray, encoding: str) -> Image:
    """The pixels as they are, which ``image_message`` would not send."""
    height, width = pixels.shape[:2]
    step, data = pixels.nbytes // height, pixels.tobytes()
    is_big = pixels.dtype.byteorder == ">"
    return Image(
        header=header(number),
        height=height,
        width=width,
        step=step,
        encoding=encoding,
        is_bigendian=int(is_big),
        data=data,
    )


MASKS = (
    (PERSON.astype(np.uint8), "mono8"),
    (PERSON * np.uint8(255), "8UC1"),
    (np.where(PERSON, 200, 100).astype(np.uint8), "mono8"),
    (PERSON.astype(np.int8), "8SC1"),
    (PERSON.astype("<u2"), "mono16"),
    (PERSON.astype(">u2") * 255, "16UC1"),
    (PERSON.astype("<i4"), "32SC1"),
    (np.where(PERSON, 0.9, 0.1).astype("<f4"), "32FC1"),
    (np.where(PERSON, 255.0, 0.0), "64FC1"),
)
WRONG = (
    (np.where(PERSON, np.nan, 0).astype("<f4"), "32FC1", "nan"),
    (PERSON.astype("<u2") * 65535, "mono16", "to 65535; expected"),
    (-PERSON.astype(np.int8), "8SC1", "from -1"),
    (np.zeros((72, 96, 3), np.uint8), "bgr8", "expected mono8"),
    (PERSON[:40].astype(np.uint8), "mono8", "expected the same size"),
)


def error_m(bus: Any) -> float:
    """Mean distance of the last keypoints to those of the person in the mask."""
    places = [one.position for one in bus.sent["/keypoints"][-1].poses]
    found_m = np.array([(place.x, place.y, place.z) for place in places])
    true_m = CAMERA.reference_to_optical(pose(BODY, FRONT).keypoints_m)
    return float(np.linalg.norm(found_m - true_m, axis=1).mean())


def test_the_tracker_tracks_any_mask_and_stays_after_what_is_none(bus: Any) -> None:
    bus.start(TrackerNode, use_image=False)
    bus.send("/body_model", String(data=dumps_body_model(BODY)))
    bus.send("/silhouette/camera_info", camera_info_message(header(0), CAMERA))
    number = 0
    for pixels, encoding in MASKS:
        number += 1
        bus.send("/silhouette", message(number, pixels, encoding))
        states = bus.texts("/tracking_state")
        assert len(states) == number, encoding
        assert error_m(bus) < 0.05, encoding
    for pixels, encoding, words in WRONG:
        number += 1
        bus.send("/silhouette", message(number, pixels, encoding))
        status = bus.tick()
        assert words in status.message and "unexpected" not in status.message
    assert len(bus.texts("/tracking_state")) == len(MASKS)
    bus.send("/silhouette", message(number + 1, PERSON.astype(np.uint8), "mono8"))
    assert len(bus.texts("/tracking_state")) == len(MASKS) + 1 == len(bus.sent["/keypoints"])
    assert error_m(bus) < 0.05


def test_the_initializer_says_what_is_wrong_with_a_mask(bus: Any) -> None:
    bus.start(InitializerNode)
    for number, (pixels, encoding, words) in enumerate(WRONG[:4]):
        bus.send("/silhouette", message(number, pixels, encoding))
        status = bus.tick()
        assert words in status.message and "unexpected" not in status.message
