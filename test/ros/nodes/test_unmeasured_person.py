"""Somebody who was not measured is tracked at once, with what the images show."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from std_msgs.msg import Header, String

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.extrinsics import Extrinsics, meeting_m
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.camera.view import OtherCamera
from cardbox_tracker.measuring.people_camera import PITCH_PRIOR, USUAL_PITCH
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.model import FOUND_STDDEV, body_from_proportions
from cardbox_tracker.person.model_file import dumps_body_model, loads_body_model
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.person.proportions import USUAL_STATURE_M
from cardbox_tracker.ros.messages.conversions import camera_info_message, image_message
from cardbox_tracker.ros.nodes.tracker_node import TrackerNode
from cardbox_tracker.ros.nodes.tracker_parameters import TrackerParameters
from cardbox_tracker.tracking.session import Session

CAMERA = Camera(160, 120, 150.0, 150.0, 79.5, 59.5)
PERSON = body_from_proportions(1.8, 2.3, hip_height_m=-0.4).with_values(unknown=())
OUTLINE = render(cardbox_patches(PERSON, reference_posture("front")), CAMERA)


@pytest.fixture
def start(bus: Any) -> Any:
    """Return a function that starts a tracker with a camera."""

    def begin(**parameters: Any) -> TrackerNode:
        node: TrackerNode = bus.start(TrackerNode, **parameters)
        bus.send("/silhouette/camera_info", camera_info_message(Header(frame_id="eye"), CAMERA))
        return node

    return begin


def show(bus: Any, second: int) -> None:
    header = Header(frame_id="eye", stamp=Time(sec=second))
    bus.send("/silhouette", image_message(header, OUTLINE, "mono8"))


def test_a_stature_is_enough(bus: Any, start: Any) -> None:
    start(stature=1.8)
    show(bus, 1)
    assert bus.sent["/joint_states"]
    (text,) = bus.texts("/body_model")
    found = loads_body_model(text)
    assert not found.unknown
    assert found.placement.distance_m == pytest.approx(2.3, rel=0.15)
    assert len(bus.sent["/robot_description"]) == 1
    # The node hears what it has published itself, and goes on.
    bus.send("/body_model", String(data=text))
    show(bus, 2)
    assert bus.texts("/body_model") == [text]


def test_a_loaded_body_is_told_to_others(bus: Any, start: Any, tmp_path: Path) -> None:
    (tmp_path / "model.yaml").write_text(dumps_body_model(PERSON))
    node = start(model_file=str(tmp_path / "model.yaml"))
    for second in (1, 2):
        show(bus, second)
    assert bus.texts("/body_model") == [dumps_body_model(PERSON)]
    assert len(bus.sent["/robot_description"]) == 1
    session = node._session
    bus.send("/body_model", String(data=dumps_body_model(PERSON)))
    assert node._session is session


def test_a_measured_body_replaces_it(bus: Any, start: Any) -> None:
    node = start(stature=1.8)
    show(bus, 1)
    measured = dumps_body_model(PERSON)
    bus.send("/body_model", String(data=measured))
    show(bus, 2)
    assert node._bodies == [loads_body_model(measured)]
    assert bus.texts("/body_model")[-1] == measured


def test_a_camera_of_unknown_pitch_is_not_sure_of_the_vertical(bus: Any, start: Any) -> None:
    """As in films: points will show the pitch, silhouettes alone never do."""
    node = start(keypoints="detector/keypoints")
    [body] = node._bodies
    assert body.sizes.tolist() == body_from_proportions(USUAL_STATURE_M).sizes.tolist()
    assert body.stature_stddev == pytest.approx(0.09 / 1.69)
    assert body.camera_pose.pitch_rad == USUAL_PITCH
    assert body.camera_pose.pitch_stddev_rad == PITCH_PRIOR > FOUND_STDDEV
    assert node._scene is not None
    [alone] = TrackerParameters(stature=1.8).guesses
    assert alone.camera_pose.pitch_rad == 0.0
    assert alone.camera_pose.pitch_stddev_rad > FOUND_STDDEV


def test_people_who_are_not_measured_stand_where_the_cameras_look() -> None:
    """The axes of the cameras, 90 degrees apart, meet 3 m before the first one."""
    turn = np.array([(0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0)])
    aside = Extrinsics(turn, turn @ (-2.0, 0.0, -3.0))
    assert meeting_m([aside]) == pytest.approx(3.0)
    assert meeting_m([Extrinsics(np.eye(3), np.array([-0.1, 0.0, 0.0]))]) is None
    settings = TrackerParameters(cameras=["a", "b"], statures=[1.75, 1.6], people=2)
    settings.check()
    others = [OtherCamera(CAMERA, aside)]
    session = Session(settings.guesses, CAMERA, settings.config(), others=others, people=2)
    assert [one.body.placement.distance_m for one in session.trackers] == [3.0, 3.0]


def test_what_is_given_of_people_and_camera_is_used(bus: Any, start: Any) -> None:
    given = {"statures": [1.75, 1.62], "people": 2}
    node = start(**given, person_distance_m=2.5, camera_pitch_deg=10.0)
    lengths_m = [body.size("upper_arm_length") for body in node._bodies]
    assert lengths_m == [
        body_from_proportions(stature_m).size("upper_arm_length") for stature_m in (1.75, 1.62)
    ]
    for body in node._bodies:
        assert body.placement.distance_m == 2.5 and "distance_m" not in body.unknown
        assert body.camera_pose.pitch_rad == pytest.approx(np.radians(10.0))


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"statures": [1.75, 1.62], "people": 1}, "statures has 2 heights"),
        ({"statures": [1.75], "people": 1, "stature": 1.7}, "instead of stature"),
        ({"statures": [0.3], "people": 1}, "stature is 0.3 m"),
        ({"person_distance_m": 2.0}, "give stature, statures or keypoints"),
        ({"camera_pitch_deg": 0.0, "model_file": "me.yaml"}, "a body model has its own"),
    ],
)
def test_what_would_have_no_effect_is_refused(given: dict[str, Any], expected: str) -> None:
    with pytest.raises(ValueError, match=expected):
        TrackerParameters(**given).check()


def test_an_impossible_stature_is_refused() -> None:
    with pytest.raises(ValueError, match=r"expected 1\.1 to 2\.2"):
        TrackerParameters(stature=0.5).check()


def test_without_either_a_measured_body_is_waited_for(bus: Any, start: Any) -> None:
    start()
    show(bus, 1)
    assert "body model" in bus.tick().message
    assert not bus.sent["/joint_states"] and "/body_model" not in bus.sent


def test_a_pitch_that_is_found_late_changes_nothing_of_who_is_tracked(bus: Any, start: Any) -> None:
    """Two people; the version that a message announces has the sizes and places of the last one."""
    outline, low = np.zeros_like(OUTLINE), PERSON.with_values(hip_height_m=-0.7)
    for aside_m in (-0.5, 0.5):
        posture = reference_posture("front")
        posture[0] = aside_m
        outline |= render(cardbox_patches(low, posture), CAMERA)

    def shown(tenth: int) -> list[np.ndarray]:
        header = Header(frame_id="eye", stamp=Time(sec=1, nanosec=tenth * 10**8))
        bus.send("/silhouette", image_message(header, outline, "mono8"))
        poses = (bus.sent[f"/person_{person}/keypoints"][-1].poses for person in (1, 2))
        at = [[(p.position.x, p.position.y, p.position.z) for p in one] for one in poses]
        return [np.array(one) for one in at]

    node = start(people=2, statures=[1.8, 1.8], use_image=False)
    for tenth in range(5):
        before = shown(tenth)
    trackers = node._session.trackers
    ages = [(one.filter, one.filter._age + 1) for one in trackers]
    bodies = [loads_body_model(bus.texts(f"/person_{n}/body_model")[-1]) for n in (1, 2)]
    counts = [len(bus.texts(f"/person_{n}/body_model")) for n in (1, 2)]
    tilted = [body.with_values(camera_pitch_rad=0.15) for body in node._bodies]
    node._session.tilt(tilted, 1_500_000_000)
    after = shown(5)
    assert node._session.trackers == trackers
    assert [(one.filter, one.filter._age) for one in trackers] == ages
    for person in (1, 2):
        texts = bus.texts(f"/person_{person}/body_model")
        body, last = loads_body_model(texts[-1]), bodies[person - 1]
        assert len(texts) == counts[person - 1] + 1
        assert (body.version, body.stamp_ns) == (last.version + 1, 1_500_000_000)
        assert body.camera_pose.pitch_rad == pytest.approx(0.15)
        assert body.person == last.person
        assert after[person - 1] == pytest.approx(before[person - 1], abs=0.1)
        assert len(bus.sent[f"/person_{person}/joint_states"][-1].velocity) == 0
    # What comes later has the pitch, too.
    assert [one.camera_pose.pitch_rad for one in node._session._bodies] == [0.15, 0.15]
