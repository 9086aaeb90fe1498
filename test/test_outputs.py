"""One description of what the tracker says, and when each of it is sent."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import JOINT_NAMES, reference_posture
from cardbox_tracker.estimation.tracker import LOST, NO_PERSON, TRACKING, Estimate, Tracker
from cardbox_tracker.outputs import (
    FIGURES,
    OUTPUTS,
    JointValues,
    Markers,
    OutputStream,
    posture_from,
)
from cardbox_tracker.vision.camera import Camera

CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
TRACKER = cast(Tracker, SimpleNamespace(body=BodyModel(), camera=CAMERA))
POSTURE = reference_posture("arms")
FOUND = Estimate(TRACKING, POSTURE, np.full(12, 0.1), np.zeros((6, 3)), 812, 0.87654)
TOPICS = ["joint_states", "joint_states_stddev", "keypoints", "markers"]


def topics(stream: OutputStream, estimate: Estimate, **options: Any) -> list[str]:
    return [output.topic for output, _ in stream.values(estimate, TRACKER, **options)]


def test_a_posture_is_all_topics_in_their_order() -> None:
    found = {output.topic: value for output, value in OutputStream().values(FOUND, TRACKER)}
    assert list(found) == TOPICS
    assert {output.topic: output.kind for output in OUTPUTS} == {
        topic: type(value) for topic, value in found.items()
    }
    joints, deviations, points, markers = cast(Any, list(found.values()))
    assert joints.names == deviations.names == JOINT_NAMES
    np.testing.assert_array_equal(joints.values, POSTURE)
    np.testing.assert_array_equal(deviations.values, 0.1)
    assert points.points_m.shape == (6, 3)
    patches, skeleton = markers.shapes
    assert (patches.namespace, patches.kind, patches.points_m.shape) == ("patches", 11, (90, 3))
    assert len(patches.colors) == 90
    assert (skeleton.namespace, skeleton.kind, skeleton.points_m.shape) == ("skeleton", 5, (16, 3))
    assert (skeleton.scale, skeleton.colors) == (0.02, ())


def test_what_is_not_known_is_not_sent() -> None:
    only_posture = Estimate(TRACKING, POSTURE)
    assert topics(OutputStream(), only_posture) == ["joint_states", "markers"]


@pytest.mark.parametrize("state", [NO_PERSON, LOST])
def test_markers_go_once_when_the_posture_does(state: str) -> None:
    stream = OutputStream()
    topics(stream, FOUND)
    gone = list(stream.values(Estimate(state), TRACKER))
    assert [(output.topic, value) for output, value in gone] == [("markers", Markers(()))]
    assert topics(stream, Estimate(state)) == []
    assert topics(stream, FOUND) == TOPICS


def test_what_nobody_wants_is_not_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cardbox_tracker.outputs.marker_shapes", lambda *_: pytest.fail("computed"))
    stream = OutputStream()
    wanted = topics(stream, FOUND, wanted=lambda output: output.topic == "keypoints")
    assert wanted == ["keypoints"]
    assert topics(stream, Estimate(LOST), wanted=lambda _: False) == []


def test_figures_as_text() -> None:
    assert {figure.label: figure.text(FOUND) for figure in FIGURES} == {
        "cost (px)": "812",
        "iou": "0.8765",
    }
    assert [figure.text(Estimate(LOST)) for figure in FIGURES] == ["", ""]


@given(st.permutations(range(12)))
def test_a_posture_is_found_by_names_in_any_order(order: list[int]) -> None:
    names = ("torso_x", *(JOINT_NAMES[i] for i in order))
    values = np.concatenate([[9.0], POSTURE[order]])
    np.testing.assert_array_equal(posture_from(JointValues(names, values)), POSTURE)


def test_a_missing_joint_is_named() -> None:
    with pytest.raises(ValueError, match="joints torso_y are missing"):
        posture_from(JointValues(JOINT_NAMES[1:], POSTURE[1:]))
