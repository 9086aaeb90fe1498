"""Posed bodies, frames, and what a term says unless it overrides it."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.terms.kernel_arguments import body_tuple
from cardbox_tracker.terms.term import ARM, TRUNK, WHOLE, Frame, Posed, TermObservation

PITCH = 0.2
CAMERA = Camera(320, 240, 300.0, 310.0, 159.5, 119.5, PITCH)
BODY = BodyModel.of(distance_m=2.3, hip_height_m=-0.4, camera_pitch_rad=PITCH)
POSABLE = body_tuple(BODY, CAMERA)
STATES = np.zeros((3, 14))
STATES[:, [4, 8]] = np.radians([[20.0, 30.0], [86.0, 100.0], [149.0, 160.0]])
STATES[:, 12:] = 0.2, -0.05


def test_joints_are_those_of_pose_in_the_image_of_the_camera() -> None:
    posed = Posed(POSABLE, STATES)
    expected_m = CAMERA.reference_to_optical(pose(BODY, STATES).keypoints_m)
    np.testing.assert_allclose(posed.keypoints_m, expected_m, atol=1e-12)
    np.testing.assert_allclose(posed.keypoints_px, CAMERA.project(expected_m), atol=1e-9)


@pytest.mark.parametrize(
    ("parts", "known"),
    [
        (WHOLE, [0, 1, 2, 3, 4, 5]),
        (TRUNK, [0, 3]),
        (ARM[0], [0, 1, 2]),
        (ARM[1], [3, 4, 5]),
    ],
)
def test_joints_of_parts_that_do_not_count_are_nan(
    parts: tuple[bool, bool, bool], known: list[int]
) -> None:
    points_m = Posed(POSABLE, STATES, parts).keypoints_m
    assert np.flatnonzero(np.isfinite(points_m).all(axis=(0, 2))).tolist() == known
    whole_m = Posed(POSABLE, STATES).keypoints_m
    np.testing.assert_array_equal(points_m[:, known], whole_m[:, known])


def test_shoulders_of_a_trunk_rise_with_the_arms_of_another_state() -> None:
    trunks = Posed(POSABLE, STATES, TRUNK, lifted=STATES[2])
    expected = STATES.copy()
    expected[:, 4:12] = STATES[2, 4:12]
    np.testing.assert_allclose(
        trunks.keypoints_m[:, [0, 3]], Posed(POSABLE, expected).keypoints_m[:, [0, 3]], atol=1e-12
    )


def test_a_frame_has_what_its_channels_have() -> None:
    silhouette, depth_m = np.zeros((240, 320), np.uint8), np.ones((240, 320), np.float32)
    frame = Frame(CAMERA, {"silhouette": silhouette, "depth_m": depth_m, "mine": 7}, 200, 5)
    assert frame.silhouette is silhouette and frame.depth_m is depth_m and frame["mine"] == 7
    assert frame.image is None and frame.points is None and frame["yours"] is None
    other = frame.changed(foreground_px=9)
    assert (other.foreground_px, other.rows, other["mine"]) == (9, 200, 7)


def test_an_observation_says_nothing_unless_it_overrides() -> None:
    nothing, posed = TermObservation(), Posed(POSABLE, STATES)
    assert nothing.rate(posed).tolist() == [0.0, 0.0, 0.0]
    assert nothing.residuals(posed) is None
    assert not nothing.evidence(posed) and not nothing.locates
