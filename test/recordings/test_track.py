"""Initialize and track on a recording: table, bag and video, and the same bytes for one seed."""

from __future__ import annotations

import csv
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from cardbox_tracker.applications.drawing.video import overlay_video
from cardbox_tracker.common.errors import BagError, CardboxError
from cardbox_tracker.measuring.config import InitializationConfig
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model_file import loads_body_model
from cardbox_tracker.person.skeleton import (
    JOINT_NAMES,
    KEYPOINT_NAMES,
    PLACE_NAMES,
    Group,
    names_of,
)
from cardbox_tracker.person.urdf import LinkTransforms
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.recordings.initialize import describe, initialize_from_recording
from cardbox_tracker.recordings.recording import Recording
from cardbox_tracker.recordings.result_bag import result_bag
from cardbox_tracker.recordings.result_table import result_table, units
from cardbox_tracker.recordings.silhouettes import SilhouetteSource, TimeSpan
from cardbox_tracker.recordings.track import TrackSummary, track_recording
from cardbox_tracker.search.config import default_preset
from cardbox_tracker.tracking.estimate import Estimate
from cardbox_tracker.tracking.session import Session
from cardbox_tracker.tracking.tracker import Tracker

CONFIG = default_preset()


def session_of(recording: Any, source: SilhouetteSource, seed: int = 0) -> Session:
    return Session([recording.body], source.camera, CONFIG, np.random.default_rng(seed))


def track(
    recording: Any, source: SilhouetteSource, path: Path, seed: int = 0, **rest: Any
) -> TrackSummary:
    span = TimeSpan(rest.get("start_s", recording.start_s()), np.inf)
    session = session_of(recording, source, seed)
    with result_table(path, is_smoothed=True) as add:
        observers = (lambda frame, estimate, _: add(frame, estimate), *rest.get("observers", ()))
        return track_recording(Recording([""], [source]), session, span, observers)


KNOWN = ("stamp", "stamp_ns", "time_s", "state", "state_reason")
"""Columns that are filled for every image."""


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_the_person_of_a_recording_is_measured(recording: Any) -> None:
    assert recording.result.mean_iou >= 0.80
    for name, expected_m in (
        ("shoulder_breadth", 0.36),
        ("upper_arm_length", 0.27),
        ("forearm_length", 0.36),
    ):
        assert recording.body.size(name) == pytest.approx(expected_m, rel=0.08), name


def test_the_persons_looks_are_learned(recording: Any) -> None:
    assert recording.body.appearance is not None
    assert recording.body.appearance.is_grey


def test_the_tracker_gets_the_images(
    recording: Any,
    source: SilhouetteSource,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    seen = []
    follow = Tracker.track

    def spy(tracker: Tracker, observations: Any) -> Any:
        seen.append(observations[0].image)
        return follow(tracker, observations)

    monkeypatch.setattr(Tracker, "track", spy)
    session = session_of(recording, source)
    session.configure(default_preset().changed({"whole_body": {"effort": 0.25}}))
    track_recording(Recording([""], [source]), session, TimeSpan(recording.start_s(), np.inf))
    assert seen
    assert all(image.shape == (240, 320) for image in seen)


def test_of_several_people_there_may_be_nobody(recording: Any, source: SilhouetteSource) -> None:
    session = Session([recording.body], source.camera, people=0)
    summary = track_recording(Recording([""], [source]), session, TimeSpan(0.0, 1.0))
    assert (summary.frames_tracked, summary.people) == (0, {})


def test_the_measures_are_described_for_a_person(recording: Any) -> None:
    text = describe(recording.result)
    for part in (
        "upper_arm_length",
        " cm",
        "below the camera, 2 m away",
        "fit (IoU) front 0.",
        "mean 0.",
    ):
        assert part in text


def test_a_reference_outside_of_the_recording_is_refused(
    recording: Any, source: SilhouetteSource
) -> None:
    spans = {name: TimeSpan(7.0, 8.0) for name in ("front", "side")} | {"arms": TimeSpan(70, 80)}
    with pytest.raises(CardboxError, match=r"arms.* 70:80 s"):
        initialize_from_recording(source, spans, InitializationConfig())


def test_there_is_one_row_an_image_with_its_stamp(
    recording: Any, source: SilhouetteSource, tmp_path: Path
) -> None:
    summary = track(recording, source, tmp_path / "person.csv")
    text = (tmp_path / "person.csv").read_text()
    assert text.splitlines()[0] == ",".join(units(is_smoothed=True))
    assert text.endswith("\n")
    assert "\r" not in text
    rows = rows_of(tmp_path / "person.csv")
    frames = list(source.frames(recording.start_s()))
    assert [row["stamp_ns"] for row in rows] == [str(frame.stamp_ns) for frame in frames]
    times_s = [float(row["time_s"]) for row in rows]
    assert times_s == pytest.approx([frame.time_s for frame in frames], abs=1e-6)
    assert recording.start_s() <= times_s[0] < recording.start_s() + 0.5
    assert summary.frames == summary.frames_tracked == len(rows)
    assert summary.mean_cost_px == pytest.approx(np.mean([int(row["cost"]) for row in rows]))
    assert summary.mean_iou == pytest.approx(np.mean([float(row["iou"]) for row in rows]), abs=1e-4)


def test_the_numbers_of_a_row_belong_together(
    recording: Any, source: SilhouetteSource, tmp_path: Path
) -> None:
    track(recording, source, tmp_path / "person.csv")
    errors_m = []
    for row in rows_of(tmp_path / "person.csv"):
        assert row["state"] in ("tracking", "uncertain")
        posture = np.array([float(row[name]) for name in JOINT_NAMES])
        points_m = np.array(
            [[float(row[f"{name}_{axis}"]) for axis in "xyz"] for name in KEYPOINT_NAMES]
        )
        place = np.array([float(row[name]) for name in PLACE_NAMES])
        body = Estimate("tracking", posture, offset_m=place).placed(recording.body)
        expected = source.camera.reference_to_optical(pose(body.rigid, posture).keypoints_m)
        # The tracker lifts the shoulder of a raised arm a little, which the kinematics do not.
        np.testing.assert_allclose(points_m, expected, atol=2e-3)
        assert 0.5 < float(row["iou"]) <= 1.0
        assert int(row["cost"]) > 0
        stamp_ns = int(row["stamp_ns"])
        errors_m.append(
            np.linalg.norm(points_m - recording.truth.frames[stamp_ns].keypoints_m, axis=1)
        )
    assert np.mean(errors_m) < 0.15


def test_what_is_not_known_is_left_empty(
    recording: Any, source: SilhouetteSource, tmp_path: Path
) -> None:
    """From the start of the recording on: first there is nobody."""
    summary = track(recording, source, tmp_path / "person.csv", start_s=0.0)
    rows = rows_of(tmp_path / "person.csv")
    assert summary.frames == len(rows)
    empty = [row for row in rows if row["state"] == "no_person"]
    assert len(empty) >= 20
    assert summary.frames_tracked <= len(rows) - len(empty)
    for row in rows:
        names = [name for name in units() if name not in KNOWN]
        # The plane of a hanging arm is not determined.
        values = {row[name] for name in names if not name.endswith("_plane_deg")}
        assert ("" in values) == (row["state"] in ("lost", "no_person"))
        if "" in values:
            assert values == {""}


def test_uncertain_images_are_counted(
    recording: Any,
    source: SilhouetteSource,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    real, seen = Tracker.track, iter(range(10_000))

    def doubting(self: Tracker, *images: Any) -> Estimate:
        return replace(real(self, *images), state="uncertain" if next(seen) < 3 else "tracking")

    monkeypatch.setattr(Tracker, "track", doubting)
    summary = track(recording, source, tmp_path / "person.csv")
    assert summary.frames_uncertain == 3
    assert summary.frames_tracked == summary.frames
    states = [row["state"] for row in rows_of(tmp_path / "person.csv")]
    assert states == ["uncertain"] * 3 + ["tracking"] * (len(states) - 3)


def test_one_seed_gives_the_same_bytes_and_another_others(
    recording: Any, source: SilhouetteSource, tmp_path: Path
) -> None:
    for name, seed in (("first", 4), ("second", 4), ("other", 5)):
        track(recording, source, tmp_path / name, seed)
    first, second, other = ((tmp_path / n).read_bytes() for n in ("first", "second", "other"))
    assert first == second
    assert first != other


def test_a_start_after_the_end_is_refused_and_leaves_nothing(
    recording: Any, source: SilhouetteSource, tmp_path: Path
) -> None:
    with pytest.raises(CardboxError, match="--start 99 s; give seconds"):
        track(recording, source, tmp_path / "person.csv", start_s=99.0)
    assert os.listdir(tmp_path) == []


def test_observers_see_every_image(
    recording: Any, source: SilhouetteSource, tmp_path: Path
) -> None:
    seen = []

    def observe(frame: Any, estimate: Estimate, tracker: Tracker) -> None:
        assert isinstance(tracker, Tracker)
        seen.append((frame.stamp_ns, estimate.state))

    track(recording, source, tmp_path / "person.csv", observers=(observe,))
    rows = rows_of(tmp_path / "person.csv")
    assert [(str(stamp_ns), state) for stamp_ns, state in seen] == [
        (row["stamp_ns"], row["state"]) for row in rows
    ]


def test_the_video_has_every_image(
    recording: Any, source: SilhouetteSource, tmp_path: Path
) -> None:
    with overlay_video(tmp_path / "person.mp4", Recording([""], [source])) as film:
        summary = track(recording, source, tmp_path / "person.csv", observers=(film,))
    video = cv2.VideoCapture(str(tmp_path / "person.mp4"))
    count = 0
    while (image := video.read()[1]) is not None:
        assert image.shape == (480, 640, 3)
        # The model is drawn in colour over grey.
        assert cv2.absdiff(image, np.roll(image, 1, axis=2)).max() > 60
        count += 1
    assert count == summary.frames
    assert sorted(os.listdir(tmp_path)) == ["person.csv", "person.mp4"]


def test_the_bag_of_results_holds_what_the_tracker_would_publish(
    recording: Any, source: SilhouetteSource, tmp_path: Path
) -> None:
    with result_bag(tmp_path / "results", source.frame_id) as results:
        track(recording, source, tmp_path / "person.csv", observers=(results,))
    rows = rows_of(tmp_path / "person.csv")
    with BagReader(tmp_path / "results") as bag:
        assert {
            "body_model": "std_msgs/msg/String",
            "robot_description": "std_msgs/msg/String",
            "joint_states": "sensor_msgs/msg/JointState",
            "keypoints": "geometry_msgs/msg/PoseArray",
            "tf": "tf2_msgs/msg/TFMessage",
        }.items() <= {name.strip("/"): kind for name, kind in bag.topics.items()}.items()
        messages: dict[str, list[Any]] = {}
        for message in bag.messages():
            messages.setdefault(message.topic.strip("/"), []).append(bag.deserialize(message))
    assert loads_body_model(messages["body_model"][0].data, "bag") == recording.body
    assert messages["robot_description"][0].data.lstrip().startswith("<")
    assert len(messages["joint_states"]) == len(messages["keypoints"]) == len(rows)
    for state, points, row in zip(
        messages["joint_states"], messages["keypoints"], rows, strict=True
    ):
        for header in (state.header, points.header):
            assert header.stamp.sec * 10**9 + header.stamp.nanosec == int(row["stamp_ns"])
        assert tuple(state.name) == names_of(*{*Group} - {Group.HAND})
        # Without a detector the table has no neck, which does not turn.
        expected = [float(row.get(name, 0.0)) for name in state.name]
        np.testing.assert_allclose(state.position, expected, atol=5.1e-7)
        assert points.header.frame_id == source.frame_id
        assert points.poses[2].position.x == pytest.approx(float(row["left_hand_x"]), abs=1e-6)
    first, *later = messages["joint_states"]
    assert list(first.velocity) == []
    for before, state, row_before, row in zip(
        messages["joint_states"], later, rows, rows[1:], strict=False
    ):
        step_s = float(row["time_s"]) - float(row_before["time_s"])
        moved = (np.array(state.position) - before.position) / step_s
        np.testing.assert_allclose(state.velocity, moved, atol=1e-4)
    links = LinkTransforms(messages["robot_description"][0].data)
    assert len(messages["tf"]) == len(rows)
    for message, state in zip(messages["tf"], messages["joint_states"], strict=True):
        expected = links.at(dict(zip(state.name, state.position, strict=True)))
        for sent, link in zip(message.transforms, expected, strict=True):
            assert sent.header.stamp == state.header.stamp
            assert (sent.header.frame_id, sent.child_frame_id) == (link.parent, link.child)
            turn, place = sent.transform.rotation, sent.transform.translation
            assert (turn.x, turn.y, turn.z, turn.w) == link.rotation
            assert (place.x, place.y, place.z) == link.translation_m


def test_images_without_a_person_have_no_results(
    recording: Any, source: SilhouetteSource, tmp_path: Path
) -> None:
    with result_bag(tmp_path / "results", source.frame_id) as results:
        summary = track(
            recording, source, tmp_path / "person.csv", start_s=0.0, observers=(results,)
        )
    with BagReader(tmp_path / "results") as bag:
        states = [name for name in bag.topics if name.endswith("joint_states")]
        assert bag.count(states) == summary.frames_tracked < summary.frames


def test_a_recording_of_that_name_is_kept(recording: Any, tmp_path: Path) -> None:
    before = sorted(os.listdir(recording.folder))
    with (
        pytest.raises(BagError, match="exists and is a recording"),
        result_bag(recording.folder, "camera"),
    ):
        pytest.fail("it must not be opened")
    assert sorted(os.listdir(recording.folder)) == before


def test_after_an_error_no_bag_is_left(recording: Any, tmp_path: Path) -> None:
    with (
        pytest.raises(RuntimeError),
        result_bag(tmp_path / "results", "camera"),
    ):
        raise RuntimeError("half way")
    assert os.listdir(tmp_path) == []
