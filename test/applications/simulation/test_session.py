"""Recordings of synthetic people: the bag, its truth and its masks agree."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from cardbox_tracker.applications.simulation.person import person_frames
from cardbox_tracker.applications.simulation.session import (
    START_NS,
    TRUTH_TOPIC,
    SessionFormat,
    synthesize_session,
)
from cardbox_tracker.camera.extrinsics_files import load_extrinsics
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.skeleton import JOINT_NAMES
from cardbox_tracker.recordings.bag_reader import BagReader

SMALL = SessionFormat(2.0, 160, 120)


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("session") / "bag"
    synthesize_session(folder, "bow", form=SMALL)
    return folder


def pixels(folder: Path) -> bytes:
    with BagReader(folder) as bag:
        return b"".join(image.as_sent.tobytes() for image in bag.images())


def test_the_truth_beside_the_bag_is_that_of_its_messages(session: Path) -> None:
    truth = json.loads((session / "ground_truth.json").read_text())
    with BagReader(session) as bag:
        stamps = [image.stamp_ns for image in bag.images()]
        states = {m.time_ns: bag.deserialize(m) for m in bag.messages([TRUTH_TOPIC])}
    frames = truth["frames"]
    assert stamps[0] == START_NS
    assert stamps == [frame["stamp_ns"] for frame in frames]
    assert np.unique(np.diff(stamps)).tolist() == [500_000_000]
    present = [frame for frame in frames if "joints_m" in frame]
    assert list(states) == [frame["stamp_ns"] for frame in present]
    assert 0 < len(present) < len(frames)
    for frame in present:
        state = states[frame["stamp_ns"]]
        assert tuple(state.name) == JOINT_NAMES
        np.testing.assert_allclose(
            state.position[1:4], np.radians(frame["torso_rpy_deg"]), atol=1e-3
        )


def test_the_page_of_the_format_names_every_topic_and_every_key(session: Path) -> None:
    rows = (Path(__file__).parents[3] / "docs/synthetic-sessions.md").read_text().splitlines()
    with BagReader(session) as bag:
        for topic, kind in bag.topics.items():
            said = f"| `{topic}` | {kind.replace('/msg/', '/')} |"
            assert any(row.startswith(said) for row in rows), said
    text = "\n".join(row for row in rows if row.startswith("|"))
    truth = json.loads((session / "ground_truth.json").read_text())
    for key in (*truth, *truth["frames"][-1], *truth["segments"][0]):
        assert f"`{key}`" in text or key == "segment_index", key


def test_the_true_joints_are_those_of_the_person(session: Path) -> None:
    truth = json.loads((session / "ground_truth.json").read_text())
    body = BodyModel.of(hip_height_m=-0.51)
    with BagReader(session) as bag:
        camera = bag.calibration().camera(160, 120)
    for frame in truth["frames"]:
        if "joints_m" not in frame:
            continue
        frames = person_frames(body, np.array(list(frame["posture"].values())))
        for name, point in (("neck", frames.neck), ("left_hand", frames.left.hand)):
            optical = camera.reference_to_optical(point)
            np.testing.assert_allclose(frame["joints_m"][name], optical, atol=2e-4)
            np.testing.assert_allclose(frame["joints_px"][name], camera.project(optical), atol=0.02)


def test_masks_and_segments_fit_the_frames(session: Path) -> None:
    truth = json.loads((session / "ground_truth.json").read_text())
    archive = np.load(session / "masks.npz")
    count, height, width = archive["shape"]
    masks = np.unpackbits(archive["packed"], axis=1)[:, : height * width]
    assert (count, height, width) == (len(truth["frames"]), 120, 160)
    for mask, frame in zip(masks, truth["frames"], strict=True):
        assert mask.sum() == frame.get("mask_px", 0)
        segment = truth["segments"][frame["segment_index"]]
        assert segment["name"] == frame["segment"]
        time_s = (frame["stamp_ns"] - START_NS) / 1e9
        assert segment["start_s"] <= time_s < segment["end_s"]


def test_the_camera_of_the_bag_is_that_of_the_truth(tmp_path: Path) -> None:
    body = BodyModel.of(hip_height_m=-0.4, camera_pitch_rad=0.1, lateral_m=0.2, side_turn="right")
    truth = synthesize_session(tmp_path / "bag", "bow", form=SMALL, body=body)
    with BagReader(tmp_path / "bag") as bag:
        camera = bag.calibration().camera(160, 120)
    expected = truth["camera"]
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (
        expected["focal_px"],
        expected["focal_px"],
        expected["cx"],
        expected["cy"],
    )
    assert expected["pitch_down_deg"] == pytest.approx(np.degrees(0.1))
    assert truth["side_posture_turns_to"] == "right"
    hips = next(f for f in truth["frames"] if f["segment"] == "front")["joints_m"]["hips"]
    assert hips[0] == pytest.approx(0.2, abs=0.03)


def test_hips_stand_where_those_of_a_person_at_two_metres_do(tmp_path: Path) -> None:
    truth = synthesize_session(tmp_path / "bag", "bow", form=SessionFormat(1.0))
    front = next(f for f in truth["frames"] if f["segment"] == "front")
    assert front["joints_px"]["hips"][1] == pytest.approx(204, abs=2)
    assert front["joints_m"]["hips"][2] == pytest.approx(2.0)


def test_the_seed_alone_decides_the_images(session: Path, tmp_path: Path) -> None:
    synthesize_session(tmp_path / "same", "bow", form=replace(SMALL, storage="sqlite3"))
    synthesize_session(tmp_path / "other", "bow", 1, SMALL)
    assert pixels(tmp_path / "same") == pixels(session)
    assert pixels(tmp_path / "other") != pixels(session)


@pytest.mark.parametrize("encoding", ["bgr8", "rgb8"])
def test_colour_recordings_show_the_same(session: Path, tmp_path: Path, encoding: str) -> None:
    synthesize_session(tmp_path / "bag", "bow", form=replace(SMALL, encoding=encoding))
    with BagReader(tmp_path / "bag") as bag, BagReader(session) as grey:
        for got, expected in zip(bag.images(), grey.images(), strict=True):
            brightness = cv2.cvtColor(got.as_sent, cv2.COLOR_BGR2GRAY)
            np.testing.assert_allclose(brightness, expected.as_sent, atol=1)


def test_compressed_recordings_show_nearly_the_same(session: Path, tmp_path: Path) -> None:
    synthesize_session(tmp_path / "bag", "bow", form=replace(SMALL, compressed=True))
    with BagReader(tmp_path / "bag") as bag, BagReader(session) as grey:
        assert bag.image_topic() == "/camera/image_raw/compressed"
        for got, expected in zip(bag.images(), grey.images(), strict=True):
            assert np.abs(got.as_sent.astype(int) - expected.as_sent).mean() < 4


def test_progress_rises_to_one(tmp_path: Path) -> None:
    told: list[float] = []
    synthesize_session(tmp_path / "bag", "bow", form=SMALL, progress=told.append)
    assert told == sorted(told)
    assert told[-1] == 1.0


@pytest.mark.parametrize(("motion", "encoding"), [("dance", "mono8"), ("bow", "mono16")])
def test_what_cannot_be_synthesized_is_refused_and_nothing_written(
    tmp_path: Path, motion: str, encoding: str
) -> None:
    with pytest.raises(CardboxError, match="expected"):
        synthesize_session(tmp_path / "bag", motion, form=replace(SMALL, encoding=encoding))
    assert list(tmp_path.iterdir()) == []


def test_several_cameras_see_the_same_person(tmp_path: Path) -> None:
    truth = synthesize_session(tmp_path / "bag", "bow", form=replace(SMALL, cameras=3))
    names = [camera["name"] for camera in truth["cameras"]]
    assert names == ["cam0", "cam1", "cam2"]
    found = load_extrinsics(tmp_path / "bag" / "extrinsics.yaml", names)
    masks = np.load(tmp_path / "bag" / "masks.npz")
    with BagReader(tmp_path / "bag") as bag:
        for name, camera in zip(names, truth["cameras"], strict=True):
            assert len(list(bag.images(bag.image_topic(name)))) == len(truth["frames"])
            seen_by = bag.calibration(name).camera(160, 120)
            where = np.array(camera["from_first"])
            if name in found:
                np.testing.assert_allclose(found[name].rotation, where[:3, :3], atol=1e-6)
            _, height, width = masks[f"shape_{name}"]
            packed = masks[f"packed_{name}"]
            of_camera = np.unpackbits(packed, axis=1, count=height * width)
            for frame, mask in zip(truth["frames"], of_camera, strict=True):
                if frame["segment"] not in ("front", "arms"):
                    continue
                for joint in ("hips", "head", "left_elbow", "right_elbow"):
                    point = where[:3, :3] @ frame["joints_m"][joint] + where[:3, 3]
                    u, v = np.rint(seen_by.project(point)).astype(int)
                    assert mask.reshape(height, width)[v, u], (name, joint)
    with pytest.raises(CardboxError, match=r"5 cameras .* expected 1 to 4"):
        synthesize_session(tmp_path / "more", "bow", form=replace(SMALL, cameras=5))
