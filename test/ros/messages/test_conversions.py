"""Messages and the core agree on images, calibrations and results."""

from __future__ import annotations

import array
from typing import Any

import cv2
import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, RegionOfInterest
from std_msgs.msg import Header
from visualization_msgs.msg import Marker

from cardbox_tracker.camera.camera import Calibration, Camera
from cardbox_tracker.camera.camera_info import calibration_from_info
from cardbox_tracker.common.errors import CameraError, EncodingError, NotFiniteError
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.person.skeleton import JOINT_NAMES, KeypointState
from cardbox_tracker.recordings.markers import MarkerShape, marker_shapes
from cardbox_tracker.recordings.outputs import TOPICS, JointValues, KeypointStates, joints_of
from cardbox_tracker.ros.messages import conversions, results
from cardbox_tracker.ros.messages.types import class_of

HEADER = Header(frame_id="optical")
CAMERA = Camera(320, 240, 300.0, 310.0, 159.5, 119.5)


def info(**changes: object) -> CameraInfo:
    message = conversions.camera_info_message(HEADER, CAMERA)
    for name, value in changes.items():
        setattr(message, name, value)
    return message


@pytest.mark.parametrize(("width", "height"), [(12000, 12000), (60000, 60000), (2**32 - 1, 1)])
def test_the_camera_of_a_silhouette_is_no_larger_than_can_be_worked_on(
    width: int, height: int
) -> None:
    with pytest.raises(CameraError, match=f"{width}x{height} px; expected"):
        conversions.camera_of(info(width=width, height=height))


def test_an_image_is_not_much_larger_than_its_camera_info_says() -> None:
    small, large = (Calibration(width, 480, np.eye(3), np.zeros(5)) for width in (640, 64_000))
    assert conversions.most_pixels_of(small) == 16 * 640 * 480
    assert conversions.most_pixels_of(large) == 2**25
    data = cv2.imencode(".png", np.zeros((48, 64), np.uint8))[1].tobytes()
    with pytest.raises(EncodingError, match=r"64x48 .*0\.002 million"):
        conversions.image_of(CompressedImage(format="png", data=data), 2000)
    raw = conversions.image_message(HEADER, np.zeros((48, 64), np.uint8))
    with pytest.raises(EncodingError, match=r"64x48 .*0\.002 million"):
        conversions.image_of(raw, 2000)


def test_a_working_camera_keeps_its_place_in_a_stereo_pair() -> None:
    turned = [0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]
    source = conversions.camera_info_message(HEADER, CAMERA.scaled(640, 480))
    source.p[3], source.r = -0.12 * source.p[0], turned
    message = conversions.camera_info_message(HEADER, CAMERA, source)
    assert message.p[3] / message.p[0] == pytest.approx(-0.12)
    assert list(message.r) == turned
    assert conversions.camera_of(message) == CAMERA


@pytest.mark.parametrize("place", [(0.0, 1.0), (1e-300, 1e300), (1.0, np.nan), (np.inf, 1.0)])
def test_what_is_no_stereo_pair_changes_nothing(place: tuple[float, float]) -> None:
    source = info()
    source.p[0], source.p[3] = place
    source.r[4] = np.nan
    message = conversions.camera_info_message(HEADER, CAMERA, source)
    assert np.isfinite(message.p).all()
    assert np.isfinite(message.r).all()
    if not np.isfinite(source.p).all() or source.p[0] < 1e-9:
        assert message == info()


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf, 1e-300, 1e300])
def test_a_depth_camera_is_one_or_none(value: float) -> None:
    message = info()
    assert conversions.depth_camera_of(message) == CAMERA
    message.p[5] = value
    assert conversions.depth_camera_of(message) is None
    assert conversions.depth_camera_of(CameraInfo(p=info().p)) is None


def test_silhouette_goes_and_comes_back() -> None:
    silhouette = np.zeros((240, 320), np.uint8)
    silhouette[50:200, 100:150] = 255
    message = conversions.image_message(HEADER, silhouette, "mono8")
    assert isinstance(message.data, array.array) and message.step == 320
    received = conversions.silhouette_of(message)
    np.testing.assert_array_equal(received, silhouette)


def test_padded_rows_are_read() -> None:
    message = Image(height=2, width=3, step=4, encoding="mono8", data=bytes(range(8)))
    np.testing.assert_array_equal(conversions.image_of(message), [[0, 1, 2], [4, 5, 6]])
    message.data = bytes([0, 1, 1, 9, 1, 0, 1, 9])
    expected = [[0, 255, 255], [255, 0, 255]]
    np.testing.assert_array_equal(conversions.silhouette_of(message), expected)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"encoding": "rgb8"}, ("rgb8", "mono8")),
        ({"height": 480}, ("480", "bytes")),
        ({"width": 0}, ("0x240",)),
    ],
)
def test_a_malformed_silhouette_is_refused(
    changes: dict[str, object], words: tuple[str, ...]
) -> None:
    message = conversions.image_message(HEADER, np.zeros((240, 320), np.uint8), "mono8")
    for name, value in changes.items():
        setattr(message, name, value)
    with pytest.raises(EncodingError) as caught:
        conversions.silhouette_of(message)
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize("size", [(24, 32), (24, 32, 3)])
def test_a_compressed_image_keeps_the_colours_it_has(size: tuple[int, ...]) -> None:
    image = np.full(size, 120, np.uint8)
    data = cv2.imencode(".jpg", image)[1].tobytes()
    got = conversions.image_of(CompressedImage(format="jpeg", data=data))
    np.testing.assert_allclose(got, image, atol=2)


def test_camera_survives_its_camera_info() -> None:
    assert conversions.camera_of(info()) == CAMERA
    calibration = calibration_from_info(info(), "/image_raw", "/camera_info")
    assert calibration.camera(320, 240) == CAMERA
    assert calibration.frame_id == "optical"


def test_uncalibrated_camera_names_both_topics() -> None:
    with pytest.raises(CameraError, match=r"(?s)/eye/image_raw.*/eye/camera_info"):
        calibration_from_info(
            info(k=np.zeros(9), p=np.zeros(12)), "/eye/image_raw", "/eye/camera_info"
        )


def test_binning_and_region_of_interest_are_taken_into_the_camera() -> None:
    roi = RegionOfInterest(x_offset=40, y_offset=20, width=160, height=120)
    message = info(roi=roi, binning_x=2, binning_y=2)
    got = calibration_from_info(message, "a", "b").camera(80, 60)
    # A point at pixel (u, v) of the full image is at ((u - 40 + 0.5) / 2 - 0.5, ...) of this one.
    point = np.array([0.1, -0.05, 2.0])
    u, v = CAMERA.project(point)
    np.testing.assert_allclose(
        got.project(point), ((u - 40 + 0.5) / 2 - 0.5, (v - 20 + 0.5) / 2 - 0.5)
    )


def test_distorted_silhouette_is_refused() -> None:
    with pytest.raises(CameraError, match="distortion"):
        conversions.camera_of(info(d=[0.1, 0.0, 0.0, 0.0, 0.0]))


@pytest.mark.promise("No number that is not finite leaves a node")
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("entry", [0, 2, 4, 5])
def test_a_matrix_that_is_not_finite_is_refused_in_its_own_words(entry: int, value: float) -> None:
    k = list(info().k)
    k[entry] = value
    for read in (
        conversions.camera_of,
        lambda message: calibration_from_info(message, "/image_raw", "/camera_info"),
    ):
        with pytest.raises(CameraError, match=f"K.* not finite numbers .*{value:g}"):
            read(info(k=k))


def test_a_silhouettes_camera_without_size_or_with_a_lens_of_nan_is_refused() -> None:
    with pytest.raises(CameraError, match="0x240"):
        conversions.camera_of(info(width=0))
    with pytest.raises(CameraError, match="distortion"):
        conversions.camera_of(info(d=[np.nan, 0.0, 0.0, 0.0, 0.0]))


def test_what_is_not_used_of_a_camera_info_may_be_anything() -> None:
    odd = info(p=np.full(12, np.nan), r=np.full(9, np.inf))
    assert conversions.camera_of(odd) == CAMERA
    assert calibration_from_info(odd, "a", "b").camera(320, 240) == CAMERA


@pytest.mark.promise("No number that is not finite leaves a node")
@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize(
    "make",
    [
        lambda values: JointValues(JOINT_NAMES, values[:12]),
        lambda values: values.reshape(6, 3),
        lambda values: (MarkerShape("patches", 5, 1.0, values.reshape(6, 3), (0, 0, 0, 1)),),
    ],
)
def test_what_is_not_finite_becomes_no_message(make: Any, value: float) -> None:
    values = np.zeros(18)
    assert results.message_of(HEADER, make(values)) is not None
    values[7] = value
    with pytest.raises(NotFiniteError, match="not published"):
        results.message_of(HEADER, make(values))


def test_joint_state_has_names_positions_and_header() -> None:
    posture = reference_posture("arms")
    message = results.message_of(HEADER, JointValues(JOINT_NAMES, posture))
    assert tuple(message.name) == JOINT_NAMES
    np.testing.assert_array_equal(message.position, posture)
    assert message.header.frame_id == "optical"
    assert len(message.velocity) == len(message.effort) == 0
    read = joints_of(message)
    assert read.names == JOINT_NAMES
    np.testing.assert_array_equal(read.values, posture)


def test_joint_state_has_velocities_where_they_are_known() -> None:
    moving = JointValues(("a", "b"), np.zeros(2), np.array([0.5, -2.0]))
    assert list(results.message_of(HEADER, moving).velocity) == [0.5, -2.0]
    with pytest.raises(NotFiniteError, match="velocities"):
        results.message_of(HEADER, moving._replace(velocities=np.array([0.0, np.inf])))


def test_markers_are_the_patches_and_the_skeleton_in_the_optical_frame() -> None:
    body, posture = BodyModel(), reference_posture("front")
    patches, skeleton = results.message_of(HEADER, marker_shapes(body, posture)).markers
    corners = CAMERA.reference_to_optical(cardbox_patches(body, posture))
    assert (patches.type, len(patches.points), len(patches.colors)) == (
        Marker.TRIANGLE_LIST,
        15 * 6,
        15 * 6,
    )
    first = patches.points[0]
    np.testing.assert_allclose((first.x, first.y, first.z), corners[0, 0])
    assert (skeleton.type, len(skeleton.points)) == (Marker.LINE_LIST, 2 * 8)
    assert all(point.z > 0 for point in patches.points + skeleton.points)


def test_keypoints_are_poses_of_the_optical_frame() -> None:
    points = np.arange(18.0).reshape(6, 3)
    message = results.message_of(HEADER, points)
    got = [(p.position.x, p.position.y, p.position.z) for p in message.poses]
    np.testing.assert_array_equal(got, points)
    assert all(pose.orientation.w == 1.0 for pose in message.poses)


def test_no_markers_remove_those_before() -> None:
    (marker,) = results.message_of(HEADER, ()).markers
    assert marker.action == Marker.DELETEALL


def test_a_state_is_a_word() -> None:
    assert results.message_of(HEADER, "uncertain").data == "uncertain"


def test_every_output_has_its_message() -> None:
    states = KeypointStates(("a",), (KeypointState.LOST,), np.array([0.75]))
    values = (JointValues(("a",), np.zeros(1)), np.zeros((1, 3)), (), "a", states)
    found = {type(results.message_of(HEADER, value)) for value in values}
    assert found == set(map(class_of, TOPICS.values()))
    (status,) = results.message_of(HEADER, states).status
    assert (status.name, status.message, status.level) == ("a", "lost", DiagnosticStatus.ERROR)
    assert status.values[0].value == "0.750"
