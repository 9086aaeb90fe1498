"""Results of a camera that is turned about its axis are in its frame as it stands."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from cardbox_tracker.camera.camera import Calibration, level_to_optical
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import dumps_body_model, loads_body_model
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.person.skeleton import KeypointState
from cardbox_tracker.person.urdf import LinkTransforms, urdf_from_body
from cardbox_tracker.recordings.given_camera import GivenCamera
from cardbox_tracker.recordings.outputs import OutputStream
from cardbox_tracker.tracking.estimate import Estimate, Hand, Legs
from cardbox_tracker.tracking.tracker import Tracker

ROLLS_DEG = (12.0, 25.0, -90.0)


@pytest.mark.parametrize("is_mirrored", [False, True])
@pytest.mark.parametrize("roll_deg", ROLLS_DEG)
def test_what_is_seen_in_the_turned_image_is_where_it_was(
    roll_deg: float, is_mirrored: bool
) -> None:
    """Points are found in the working image, along its rays, and given back in the true frame."""
    given = GivenCamera(60.0, roll_rad=np.radians(roll_deg), is_mirrored=is_mirrored)
    sent = given.rolled(Calibration.of_fov(640, 480, 60.0))
    true_m = np.array([(0.3, -0.2, 2.0), (-0.1, 0.4, 2.5), (0.2, 0.3, 1.8)] * 2)
    shown_m = true_m * ((-1.0, 1.0, 1.0) if is_mirrored else (1.0, 1.0, 1.0))
    size = sent.level_size(640, 480)
    px = sent.rectified(
        replace(sent, roll_rad=0.0, is_mirrored=False).camera(640, 480).project(shown_m), *size
    )
    found_m = sent.camera(*size).rays(px) * true_m[:, 2:]
    hand = Hand(1.0, found_m[0], np.zeros(3), np.zeros(3))
    legs = Legs(np.zeros(8), np.ones(8), found_m, np.ones(6), (KeypointState.TRACKED,) * 6)
    estimate = Estimate("tracking", keypoints_m=found_m, hands=(hand, None), legs=legs)
    standing = estimate.as_camera_stands(given.stands_rad)
    assert standing.keypoints_m == pytest.approx(true_m)
    assert standing.hands is not None and standing.hands[0] is not None
    assert standing.hands[0].palm == pytest.approx(true_m[0])
    assert standing.legs is not None and standing.legs.points_m == pytest.approx(true_m)
    # The body of such a film tells the next one how its images are turned.
    again = GivenCamera(60.0, is_mirrored=is_mirrored).standing(given.stands_rad)
    assert again.roll_rad == pytest.approx(given.roll_rad)


@pytest.mark.parametrize("roll_deg", [*ROLLS_DEG, 0.0])
def test_keypoints_markers_and_links_are_in_one_frame(roll_deg: float) -> None:
    body = BodyModel.of(
        camera_pitch_rad=0.2, camera_roll_rad=np.radians(roll_deg), hip_height_m=-0.4
    )
    assert loads_body_model(dumps_body_model(body)) == body
    posture = reference_posture("front")
    camera = Calibration.of_fov(320, 240, 60.0).camera(320, 240)
    tracker = Tracker(body, camera)
    level_m = pose(body.rigid, posture).keypoints_m
    estimate = Estimate(
        "tracking",
        posture,
        np.full(12, 0.1),
        tracker.camera.reference_to_optical(level_m),
        clavicles_m=np.zeros(2),
    )
    sent: dict[str, Any] = dict(OutputStream().values(0, estimate, tracker))
    keypoints_m = sent["keypoints"]
    expected_m = level_m @ level_to_optical(0.2, np.radians(roll_deg)).T
    assert keypoints_m == pytest.approx(expected_m)
    skeleton_m = sent["markers"][1].points_m
    hand_m = keypoints_m[2]
    assert np.linalg.norm(skeleton_m - hand_m, axis=1).min() < 0.03
    links = LinkTransforms(urdf_from_body(body, "camera")).at(
        dict.fromkeys(LinkTransforms(urdf_from_body(body)).joint_names, 0.0)
    )
    there = next(link for link in links if link.child == "camera")
    x, y, z, w = there.rotation
    cross = np.array([(0, -z, y), (z, 0, -x), (-y, x, 0)])
    to_root = np.eye(3) + 2 * w * cross + 2 * cross @ cross
    assert keypoints_m @ to_root.T == pytest.approx(level_m * (-1.0, -1.0, 1.0))
