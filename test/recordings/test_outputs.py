"""One description of what the tracker says, and when each of it is sent."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.person.skeleton import (
    HAND_NAMES,
    HAND_OPEN_NAMES,
    JOINT_NAMES,
    LEG_NAMES,
    NECK_NAMES,
    PLACE_NAMES,
    KeypointState,
)
from cardbox_tracker.recordings import outputs
from cardbox_tracker.recordings.messages import message_of
from cardbox_tracker.recordings.outputs import (
    JointValues,
    OutputStream,
    joint_deviations,
    joint_values,
    open_hands,
)
from cardbox_tracker.tracking.estimate import (
    LOST,
    NO_PERSON,
    TRACKING,
    UNCERTAIN,
    Estimate,
    Hand,
    Legs,
    Place,
)
from cardbox_tracker.tracking.tracker import Tracker

STAMP_NS = 5_000_000_000
CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
TRACKER = cast(Tracker, SimpleNamespace(body=BodyModel(), camera=CAMERA))
POSTURE = reference_posture("arms")
POINTS_M = CAMERA.reference_to_optical(pose(BodyModel().rigid, POSTURE).keypoints_m)
STATES = tuple(KeypointState(one) for one in ("tracked", "uncertain", "lost") * 2)
CHANCES = np.array([0.01, 0.3, 0.8] * 2)
FOUND = Estimate(
    *(TRACKING, POSTURE, np.full(12, 0.1), POINTS_M, 812, 0.87654),
    keypoint_states=STATES,
    keypoint_chances=CHANCES,
    place=Place(np.array([0.15, 0.01, 0.05]), 0.046, "given stature", "the distance differs"),
)
PLACED = replace(
    FOUND,
    keypoints_m=POINTS_M + np.array([0.0, 0.05, -0.25]),
    offset_m=np.array([0.25, -0.05]),
    offset_stddev_m=np.array([0.03, 0.01]),
    clavicles_m=np.array([0.02, 0.03]),
    clavicles_stddev_m=np.array([0.002, 0.003]),
)
SEEN = replace(PLACED, neck=np.array([0.4, -0.1]), neck_stddev=np.array([0.1, 0.2]))
LEGS = Legs(
    *(np.arange(8) / 10, np.arange(8) / 100, np.zeros((6, 3)), np.zeros(6)),
    (KeypointState.TRACKED,) * 6,
)
BODY_NAMES = (*JOINT_NAMES, "torso_x", "torso_z")
CLAVICLES = ("left_clavicle_elevation", "right_clavicle_elevation")
ALL_NAMES = (*BODY_NAMES, "neck_yaw", "neck_pitch", *CLAVICLES, *LEG_NAMES)
NO_LEGS = [0.0] * 8
TOPICS = [
    *("tracking_state", "keypoint_states", "place_state", "joint_states", "joint_states_stddev"),
    *("keypoints", "markers"),
]


def topics(stream: OutputStream, estimate: Estimate, **options: Any) -> list[str]:
    return [topic for topic, _ in stream.values(STAMP_NS, estimate, TRACKER, **options)]


def test_a_posture_is_all_topics_in_their_order() -> None:
    found = dict(OutputStream().values(STAMP_NS, FOUND, TRACKER))
    assert list(found) == TOPICS
    kinds = {topic: message_of(lambda kind, **_: kind, None, found[topic]) for topic in found}
    assert kinds == {topic: outputs.TOPICS[topic] for topic in outputs.TOPICS if topic != "hands"}
    state, keypoints, place, joints, deviations, points, markers = cast(Any, list(found.values()))
    assert state == TRACKING
    assert keypoints.names[:4] == ("left_shoulder", "left_elbow", "left_hand", "right_shoulder")
    assert (keypoints.states, keypoints.chances.tolist()) == (STATES, CHANCES.tolist())
    (row,) = place.rows()
    assert row == (
        "place",
        KeypointState.UNCERTAIN,
        {
            "chance of an error beyond 0.3 m": "0.046",
            "rests on": "given stature",
            "standard deviation of the distance (m)": "0.150",
            "contradiction": "the distance differs",
        },
    )
    assert (joints.names, deviations.names) == (ALL_NAMES, (*BODY_NAMES, *CLAVICLES, *LEG_NAMES))
    np.testing.assert_array_equal(joints.values, [*POSTURE, *[0.0] * 14])
    np.testing.assert_array_equal(deviations.values[:16], [0.1] * 12 + [0.0] * 4)
    assert points.shape == (6, 3)
    patches, skeleton = markers
    assert (patches.namespace, patches.kind, patches.points_m.shape) == ("patches", 11, (90, 3))
    assert len(patches.colors) == 90
    assert (skeleton.namespace, skeleton.kind, skeleton.points_m.shape) == ("skeleton", 5, (16, 3))
    assert (skeleton.scale, skeleton.colors) == (0.02, ())


def test_what_is_not_known_is_not_sent() -> None:
    only_posture = Estimate(TRACKING, POSTURE)
    assert topics(OutputStream(), only_posture) == ["tracking_state", "joint_states", "markers"]


def test_joints_have_the_place_after_the_posture() -> None:
    joints, deviations = joint_values(PLACED), joint_deviations(PLACED)
    assert joints is not None
    assert deviations is not None
    assert (joints.names, deviations.names) == (ALL_NAMES, (*BODY_NAMES, *CLAVICLES, *LEG_NAMES))
    place = 0.25, -0.05, 0.0, 0.0, 0.02, 0.03
    np.testing.assert_array_equal(joints.values, [*POSTURE, *place, *NO_LEGS])
    np.testing.assert_array_equal(deviations.values[:16], [0.1] * 12 + [0.03, 0.01, 0.002, 0.003])


def test_the_neck_follows_and_has_deviations_if_it_was_seen() -> None:
    joints, deviations = joint_values(SEEN), joint_deviations(SEEN)
    assert joints is not None
    assert deviations is not None
    assert joints.names == deviations.names == ALL_NAMES
    place = 0.25, -0.05, 0.4, -0.1, 0.02, 0.03
    np.testing.assert_array_equal(joints.values, [*POSTURE, *place, *NO_LEGS])
    np.testing.assert_array_equal(deviations.values[-12:-8], (0.1, 0.2, 0.002, 0.003))
    np.testing.assert_array_equal(joints.of(NECK_NAMES), (0.4, -0.1))
    assert np.isnan(JointValues(BODY_NAMES, np.zeros(14)).of(NECK_NAMES)).all()


def test_without_the_place_there_are_the_twelve_joints() -> None:
    stream = OutputStream(torso_place=False)
    found: dict[str, Any] = dict(stream.values(STAMP_NS, SEEN, TRACKER))
    assert list(found) == TOPICS
    for topic, expected in (("joint_states", POSTURE), ("joint_states_stddev", 0.1)):
        assert found[topic].names == JOINT_NAMES
        np.testing.assert_array_equal(found[topic].values, np.full(12, expected))


def test_markers_are_where_the_estimate_is() -> None:
    """0.25 m nearer is less z of a level camera, 0.05 m lower is more y."""
    at_rest, moved = (
        cast(Any, dict(OutputStream().values(STAMP_NS, e, TRACKER))["markers"])
        for e in (FOUND, PLACED)
    )
    for before, after in zip(at_rest, moved, strict=True):
        shift = np.broadcast_to((0.0, 0.05, -0.25), after.points_m.shape)
        np.testing.assert_allclose(after.points_m - before.points_m, shift, atol=1e-12)


def test_an_uncertain_posture_is_sent_with_its_state() -> None:
    unsure = replace(FOUND, state=UNCERTAIN)
    found = list(OutputStream().values(STAMP_NS, unsure, TRACKER))
    assert found[0] == ("tracking_state", "uncertain")
    assert [topic for topic, _ in found] == TOPICS


@pytest.mark.parametrize("state", [NO_PERSON, LOST])
def test_markers_go_once_when_the_posture_does(state: str) -> None:
    stream = OutputStream()
    topics(stream, FOUND)
    gone = list(stream.values(STAMP_NS, Estimate(state), TRACKER))
    assert gone == [
        ("tracking_state", state),
        ("markers", ()),
    ]
    assert topics(stream, Estimate(state)) == ["tracking_state"]
    assert topics(stream, FOUND) == TOPICS


def test_what_nobody_wants_is_not_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "cardbox_tracker.recordings.outputs.marker_shapes", lambda *_: pytest.fail("computed")
    )
    stream = OutputStream()
    wanted = topics(stream, FOUND, wanted=lambda topic: topic == "keypoints")
    assert wanted == ["keypoints"]
    assert topics(stream, Estimate(LOST), wanted=lambda _: False) == []


def velocities_of(stream: OutputStream, at_s: float, *seen: Any) -> Any:
    """Velocities of the joint states that a stream gives for an estimate and a tracker."""
    found = dict(stream.values(round(at_s * 1e9), *seen))
    assert getattr(found.get("joint_states_stddev"), "velocities", None) is None
    return cast(JointValues, found["joint_states"]).velocities


def test_joints_have_velocities_from_the_second_image_on_by_hand() -> None:
    stream = OutputStream()
    assert velocities_of(stream, 1.0, FOUND, TRACKER) is None
    moved = replace(SEEN, posture=POSTURE + np.arange(12) / 100)
    found = velocities_of(stream, 1.1, moved, TRACKER)
    # The neck appears only now.
    np.testing.assert_allclose(
        found, [*np.arange(12) / 10, 2.5, -0.5, 0.0, 0.0, 0.2, 0.3, *NO_LEGS], atol=1e-12
    )
    turned = replace(moved, neck=np.array([0.5, -0.1]))
    found = velocities_of(stream, 1.3, turned, TRACKER)
    np.testing.assert_allclose(found, [*[0.0] * 14, 0.5, 0.0, 0.0, 0.0, *NO_LEGS], atol=1e-12)


def test_velocities_begin_anew_after_a_gap_another_tracker_or_a_jump_of_the_stamps() -> None:
    stream = OutputStream()
    velocities_of(stream, 1.0, FOUND, TRACKER)
    assert velocities_of(stream, 1.1, FOUND, TRACKER) is not None
    list(stream.values(1_200_000_000, Estimate(LOST), TRACKER))
    assert velocities_of(stream, 1.3, FOUND, TRACKER) is None
    another = cast(Tracker, SimpleNamespace(body=BodyModel(), camera=CAMERA))
    assert velocities_of(stream, 1.4, FOUND, another) is None
    assert velocities_of(stream, 1.4, FOUND, another) is None
    assert velocities_of(stream, 0.5, FOUND, another) is None
    assert velocities_of(stream, 1.0, FOUND, another) is not None
    assert velocities_of(stream, 3.5, FOUND, another) is None


def test_without_the_place_velocities_are_those_of_the_twelve_joints() -> None:
    stream = OutputStream(torso_place=False)
    velocities_of(stream, 1.0, FOUND, TRACKER)
    assert velocities_of(stream, 1.1, PLACED, TRACKER).tolist() == [0.0] * 12


@given(st.permutations(range(12)))
def test_a_posture_is_found_by_names_in_any_order(order: list[int]) -> None:
    names = ("torso_x", *(JOINT_NAMES[i] for i in order))
    values = np.concatenate([[9.0], POSTURE[order]])
    np.testing.assert_array_equal(JointValues(names, values).posture, POSTURE)


def test_some_joints_are_found_by_their_names() -> None:
    names = ("torso_z", *JOINT_NAMES, "torso_x")
    place = JointValues(names, np.array([-0.1, *POSTURE, 0.3])).of(PLACE_NAMES)
    np.testing.assert_array_equal(cast(Any, place), [0.3, -0.1])
    assert np.isnan(JointValues(JOINT_NAMES, POSTURE).of(PLACE_NAMES)).all()


def test_a_missing_joint_is_named() -> None:
    with pytest.raises(ValueError, match="torso_y"):
        _ = JointValues(JOINT_NAMES[1:], POSTURE[1:]).posture


def test_joints_of_the_legs_are_always_the_last_ones() -> None:
    """Knees that are not known may be bent by 0 to 150 degrees, all alike."""
    known = replace(SEEN, legs=LEGS)
    for found, knee, stddev in ((known, 0.7, 0.07), (SEEN, 0.0, np.radians(43.3))):
        joints, stddevs = joint_values(found), joint_deviations(found)
        assert joints is not None and stddevs is not None
        assert joints.names == stddevs.names == ALL_NAMES
        assert joints.values[-1] == pytest.approx(knee)
        assert stddevs.values[-1] == pytest.approx(stddev, rel=1e-3)
    only = joint_values(known, torso_place=False)
    assert only is not None and only.names == JOINT_NAMES


def test_legs_that_appear_have_no_velocity() -> None:
    stream = OutputStream()
    velocities_of(stream, 1.0, SEEN, TRACKER)
    found = velocities_of(stream, 1.1, replace(SEEN, legs=LEGS), TRACKER)
    np.testing.assert_array_equal(found, np.zeros(len(ALL_NAMES)))
    bent = replace(SEEN, legs=LEGS._replace(angles=LEGS.angles + 0.1))
    found = velocities_of(stream, 1.2, bent, TRACKER)
    np.testing.assert_allclose(cast(Any, found)[-8:], np.ones(8))


def test_joints_of_the_hands_are_0_without_deviation_while_one_is_not_known() -> None:
    hand = Hand(0.9, np.array([0.0, 0.0, -1.0]), np.array([0.2, 0.1, np.nan]), np.full(3, 0.3), 0.4)
    found = replace(SEEN, hands=(None, hand), legs=LEGS)
    joints, stddevs = joint_values(found), joint_deviations(found)
    assert joints is not None and stddevs is not None
    assert joints.names == (*ALL_NAMES[:-8], *HAND_NAMES, *LEG_NAMES)
    assert joints.values[-14:-8] == pytest.approx([0.0, 0.0, 0.0, 0.4, 0.2, 0.1])
    assert [name in stddevs.names for name in HAND_NAMES] == [False] * 3 + [True] * 3
    opened = open_hands(found)
    assert opened is not None and opened.names == ("right_hand_open",)
    np.testing.assert_array_equal(opened.of(HAND_OPEN_NAMES), [np.nan, 0.9])
    unknown = hand._replace(open=None)
    assert open_hands(replace(SEEN, hands=(unknown, None))) is open_hands(SEEN) is None
