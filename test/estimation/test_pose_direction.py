"""Gross errors of a camera's pose, which the tops of two silhouettes show."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.body.keypoint_state import KeypointState
from cardbox_tracker.estimation.camera_agreement import CameraAgreement
from cardbox_tracker.estimation.camera_pose import Sighting
from cardbox_tracker.estimation.config import default_preset
from cardbox_tracker.estimation.cost.view import OtherCamera, View
from cardbox_tracker.estimation.estimate import TRACKING, Estimate
from cardbox_tracker.estimation.observation import Observation
from cardbox_tracker.estimation.pose_direction import PoseDirection, PoseFault
from cardbox_tracker.estimation.tracker import Tracker
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.extrinsics import Extrinsics
from test.estimation.test_camera_pose import BODY, CAMERA, OTHER, TRUE, aside, sightings, waving

TURNED_UP = Extrinsics(
    np.array([(1.0, 0.0, 0.0), (0.0, 0.996195, -0.087156), (0.0, 0.087156, 0.996195)]), np.zeros(3)
)


def judged(extrinsics: Extrinsics, is_exchanged: bool = False) -> PoseDirection:
    cameras = (OTHER, CAMERA) if is_exchanged else (CAMERA, OTHER)
    found = PoseDirection(*cameras, extrinsics, 0.0)
    for frame in sightings(waving(12)):
        pair = (frame.other, frame.first) if is_exchanged else (frame.first, frame.other)
        found.see(*pair)
    return found


def turned_up(pose: Extrinsics) -> Extrinsics:
    """The pose with a further camera that is said to look 5 degrees higher or lower."""
    return Extrinsics(TURNED_UP.rotation @ pose.rotation, TURNED_UP.rotation @ pose.translation_m)


@pytest.mark.parametrize(
    ("extrinsics", "is_exchanged", "fault"),
    [
        (TRUE, False, None),
        (TRUE.inverse(), False, PoseFault.INVERTED),
        (TRUE, True, PoseFault.INVERTED),
        (TRUE.inverse(), True, None),
        (turned_up(TRUE), False, PoseFault.CONTRADICTED),
    ],
)
def test_the_direction_of_a_pose_is_judged(
    extrinsics: Extrinsics, is_exchanged: bool, fault: PoseFault | None
) -> None:
    found = judged(extrinsics, is_exchanged)
    assert found.fault is fault
    if fault is PoseFault.CONTRADICTED:
        assert np.degrees(found.height_rad) == pytest.approx(5.0, abs=0.7)


def test_a_few_frames_and_empty_images_say_nothing() -> None:
    found = PoseDirection(CAMERA, OTHER, TRUE.inverse(), 0.0)
    (frame,) = sightings(waving(1))
    for _ in range(10):
        found.see(frame.first, np.zeros_like(frame.other))
        found.see(np.full_like(frame.first, 255), frame.other)
    assert found.fault is None
    for _ in range(2 * 5):
        found.see(frame.first, frame.other)
    assert found.fault is None
    found.see(frame.first, frame.other)
    found.see(frame.first, frame.other)
    assert found.fault is PoseFault.INVERTED


def test_a_pose_that_was_put_right_is_trusted_again() -> None:
    found = PoseDirection(CAMERA, OTHER, TRUE, 0.0)
    frames = sightings(waving(4))
    for _ in range(6):
        for frame in frames:
            lower = np.zeros_like(frame.other)
            lower[40:] = frame.other[:-40]
            found.see(frame.first, lower)
    assert found.fault is PoseFault.CONTRADICTED
    for _ in range(30):
        for frame in frames:
            found.see(frame.first, frame.other)
    assert found.fault is None


def agreement(extrinsics: Extrinsics) -> CameraAgreement:
    view = View.of(BODY, CAMERA, OtherCamera(OTHER, extrinsics))
    asked = CameraAgreement(BODY, CAMERA, [view])
    for frame in sightings(waving(12)):
        asked.look(frame.first, [view.upright(frame.other, is_mask=True)])
    return asked


def test_an_inverted_pose_is_told_once_and_a_right_one_is_not() -> None:
    right, wrong = agreement(TRUE), agreement(TRUE.inverse())
    assert not right.is_contradicted
    assert right.remarks(["cam1"]) == []
    assert wrong.is_contradicted
    (text,) = wrong.remarks(["cam1"])
    assert "cam1 seem to be inverted, or the images of the two cameras exchanged" in text
    view = View.of(BODY, CAMERA, OtherCamera(OTHER, TRUE.inverse()))
    assert CameraAgreement(BODY, CAMERA, [view], wrong).is_contradicted
    (text,) = agreement(turned_up(TRUE)).remarks(["cam1"])
    assert "contradict" in text
    assert "degrees in height" in text


def followed(
    frames: list[Sighting], cameras: tuple[Camera, Camera], given: Extrinsics
) -> list[Estimate]:
    """Results from the twelfth frame on, since a verdict takes that many."""
    tracker = Tracker(BODY, cameras[0], default_preset(), others=[OtherCamera(cameras[1], given)])
    pairs = [[Observation(frame.first), Observation(frame.other)] for frame in frames]
    return [tracker.track(pair) for pair in pairs][12:]


@pytest.mark.parametrize("degrees", [9.0, 29.0, 69.0])
def test_nothing_is_tracked_with_an_inverted_pose_or_exchanged_images(degrees: float) -> None:
    pose = aside(np.radians(degrees))
    frames = sightings(waving(30, 1.0 / 15.0), pose=pose)
    swapped = [Sighting(one.state, one.other, one.first) for one in frames]
    right = followed(frames, (CAMERA, OTHER), pose)
    assert np.mean([one.state == TRACKING for one in right]) > 0.3
    inverted = followed(frames, (CAMERA, OTHER), pose.inverse())
    exchanged = followed(swapped, (OTHER, CAMERA), pose)
    for wrong in (*inverted, *exchanged):
        assert wrong.state != TRACKING
        assert KeypointState.TRACKED not in (wrong.keypoint_states or ())
