"""Sessions: what is cut out of a recording, and what is refused."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker.applications.simulation.person import person_frames
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.model import BodyModel
from lab.experiments.sessions import (
    SEQUENCE_LENGTH,
    Session,
    motions_of,
    recorded_session,
    synthetic_session,
)


def test_it_starts_before_the_motion_in_the_front_posture(session: Session) -> None:
    assert session.motions == ["bow"]
    assert session.segments[0] == "neutral"
    assert {"front", "side", "arms", "empty"}.isdisjoint(session.segments)
    np.testing.assert_allclose(session.postures[0, 1:4], 0.0, atol=1e-9)
    assert np.degrees(session.postures[:, 2].max()) == pytest.approx(35.0, abs=2.0)


def test_silhouettes_and_truth_belong_together(session: Session) -> None:
    """The true hands lie in the silhouette, or within two pixels of it."""
    pixels = session.camera.project(session.keypoints_m)
    for silhouette, joints in zip(session.silhouettes, pixels, strict=True):
        for u, v in joints[[0, 1, 3, 4]]:
            column, row = round(u), round(v)
            assert np.any(silhouette[row - 2 : row + 3, column - 2 : column + 3])


def test_the_truth_is_that_of_the_kinematics(session: Session) -> None:
    person = BodyModel.of(hip_height_m=-0.51)
    expected = session.camera.reference_to_optical(
        person_frames(person, session.postures).keypoints_m
    )
    np.testing.assert_allclose(session.keypoints_m, expected, atol=1e-4)


def test_images_for_the_sequence_are_of_the_motion(session: Session) -> None:
    assert len(session.shown) == len(session.images) == SEQUENCE_LENGTH
    assert set(session.segments[session.shown]) == {"bow"}


def test_the_same_seed_gives_the_same_session(session: Session) -> None:
    again = synthetic_session("bow", 0, 2.0, (160, 120))
    np.testing.assert_array_equal(again.silhouettes, session.silhouettes)
    assert again.body == session.body


def test_motions_are_what_is_neither_reference_nor_pause() -> None:
    segments = np.array(["neutral", "wave", "wave", "transition", "bow", "neutral", "wave"])
    assert motions_of(segments) == ["wave", "bow"]


def test_a_recording_in_the_folder_bag_is_found(recording: Path, tmp_path: Path) -> None:
    shutil.copytree(recording, tmp_path / "bag")
    shutil.move(tmp_path / "bag" / "ground_truth.json", tmp_path)
    assert recorded_session(tmp_path, size=(160, 120)).motions == ["bow"]


def test_no_ground_truth(tmp_path: Path) -> None:
    with pytest.raises(CardboxError, match=r"ground_truth\.json"):
        recorded_session(tmp_path)


@pytest.mark.parametrize("segment", ["empty", "side", "neutral"])
def test_a_segment_that_is_missing_is_named(recording: Path, tmp_path: Path, segment: str) -> None:
    folder = tmp_path / "session"
    shutil.copytree(recording, folder)
    data = json.loads((folder / "ground_truth.json").read_text())
    data["segments"] = [entry for entry in data["segments"] if entry["name"] != segment]
    (folder / "ground_truth.json").write_text(json.dumps(data))
    with pytest.raises(CardboxError, match=f"segment '{segment}'"):
        recorded_session(folder)


def test_truth_of_another_recording_is_refused(recording: Path, tmp_path: Path) -> None:
    folder = tmp_path / "session"
    shutil.copytree(recording, folder)
    data = json.loads((folder / "ground_truth.json").read_text())
    for frame in data["frames"]:
        frame["stamp_ns"] += 1
    (folder / "ground_truth.json").write_text(json.dumps(data))
    with pytest.raises(CardboxError, match="of one session"):
        recorded_session(folder, size=(160, 120))
