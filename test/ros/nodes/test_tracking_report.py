"""What is said of the state of tracking: each change once, and the figures of the last posture."""

from __future__ import annotations

import numpy as np

from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.ros.nodes.tracking_report import TrackingReport
from cardbox_tracker.tracking.estimate import LOST, NO_PERSON, TRACKING, UNCERTAIN, Estimate

BODY = BodyModel()


def found(state: str) -> Estimate:
    points_m = np.zeros((6, 3))
    return Estimate(state, np.zeros(12), np.full(12, 0.1), points_m, 812, 0.75)


def test_each_change_of_state_is_told_once() -> None:
    report = TrackingReport()
    report.start(BODY)
    told = [report.add(found(state), BODY) for state in (TRACKING, TRACKING, UNCERTAIN)]
    assert [list(news) for news in told] == [["state"], [], ["state"]]
    # Uncertain images come and go: only what is worse is told after them.
    assert report.add(found(TRACKING), BODY) == {}
    report.add(found(UNCERTAIN), BODY)
    assert "tracker/reset" in report.add(Estimate(LOST), BODY)["state"]
    assert "tracker/reset" in report.warnings()[""]
    report.add(found(TRACKING), BODY)
    assert report.warnings() == {}


def test_another_body_is_told_with_its_sizes() -> None:
    report = TrackingReport()
    report.start(BODY)
    other = BodyModel.of(hip_height_m=-0.4)
    assert str(other) in report.add(found(TRACKING), other)["body"]
    assert "body" not in report.add(found(TRACKING), other)


def test_values_have_counts_then_those_of_the_cameras_then_figures() -> None:
    report = TrackingReport()
    assert report.values({}) == {"state": "not started"}
    for estimate in (found(TRACKING), found(TRACKING), Estimate(NO_PERSON)):
        report.add(estimate, BODY)
    values = report.values({"left late": "0"})
    assert values == {
        "state": NO_PERSON,
        f"images {TRACKING}": "2",
        f"images {NO_PERSON}": "1",
        "left late": "0",
    }
    report.add(found(TRACKING), BODY)
    values = report.values({"left late": "0"})
    assert values["largest deviation (deg)"] == "5.7"
    assert list(values).index("left late") < list(values).index("largest deviation (deg)")
