"""The demo's report, of a session whose nodes are stood in for by the truth."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from cardbox_tracker.applications.simulation.session import SessionFormat, synthesize_session
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import load_body_model
from cardbox_tracker.recordings.truth import load_ground_truth
from cardbox_tracker.ros.demo.report import DemoResult, write_report

BODY = BodyModel.of(hip_height_m=-0.51)
LAST = 24
"""So many images of the session's end were tracked."""


@pytest.fixture(scope="module", params=(1, 2))
def session(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of one camera, and of two."""
    folder = tmp_path_factory.mktemp("demo") / "session"
    synthesize_session(folder, "bow", form=SessionFormat(4.0, 160, 120, request.param), body=BODY)
    return folder


@pytest.fixture(scope="module")
def result(session: Path) -> DemoResult:
    """What perfect nodes would have published."""
    truth = load_ground_truth(session / "ground_truth.json")
    archive = np.load(session / "masks.npz")
    masks = np.unpackbits(archive["packed"], axis=1).reshape(archive["shape"]) * np.uint8(255)
    stamps = sorted(truth.frames)[-LAST:]
    return DemoResult(
        BODY,
        truth,
        stamps[0],
        {stamp: truth.frames[stamp].posture for stamp in stamps},
        {stamp: truth.frames[stamp].keypoints_m for stamp in stamps},
        dict(zip(stamps, masks[-LAST:], strict=True)),
        29.5,
        0.87,
    )


def test_a_perfect_result_has_no_error(
    session: Path, result: DemoResult, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    returned = write_report(result, session, tmp_path, "paper", 7)
    report = json.loads((tmp_path / "report.json").read_text())
    assert report == returned
    assert (report["preset"], report["seed"]) == ("paper", 7)
    assert report["cameras"] == 1 + (session / "extrinsics.yaml").is_file()
    assert report["frames"] == report["frames_tracked"] == LAST
    assert report["mean_3d_error_m"] == pytest.approx(0.0, abs=1e-9)
    assert (report["fps"], report["initialization_iou"]) == (29.5, 0.87)
    assert 0.7 < report["mean_iou"] < 1.0
    assert report["mean_cost_px"] > 0
    assert set(report["error_by_keypoint_m"]) == {
        f"{side}_{joint}" for side in ("left", "right") for joint in ("shoulder", "elbow", "hand")
    }
    assert set(report["error_by_segment_m"]) <= {"neutral", "bow"}
    table = capsys.readouterr().out
    for text in (f"{LAST}", "0.0 cm", "0.87", "29.5", f"{tmp_path}/overlay.mp4"):
        assert text in table


def test_everything_to_look_at_is_there(session: Path, result: DemoResult, tmp_path: Path) -> None:
    write_report(result, session, tmp_path, "paper", 0)
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"report.json", "body.yaml", "joint_states.png", "overlay.mp4"}
    assert load_body_model(tmp_path / "body.yaml") == BODY
    assert cv2.imread(str(tmp_path / "joint_states.png")) is not None
    video = cv2.VideoCapture(str(tmp_path / "overlay.mp4"))
    images = []
    while (image := video.read()[1]) is not None:
        images.append(image)
    assert len(images) == LAST
    assert {image.shape for image in images} == {(240, 320, 3)}


def test_errors_and_lost_images_are_counted(
    session: Path, result: DemoResult, tmp_path: Path
) -> None:
    aside = np.array([0.03, 0.0, 0.04])
    wrong = replace(
        result,
        postures=dict(sorted(result.postures.items())[5:]),
        keypoints_m={stamp: p + aside for stamp, p in result.keypoints_m.items()},
    )
    report = write_report(wrong, session, tmp_path, "default", 0)
    assert (report["frames"], report["frames_tracked"]) == (LAST, LAST - 5)
    assert report["mean_3d_error_m"] == pytest.approx(0.05)
    assert report["lateral_error_m"] == pytest.approx(0.03)
    assert report["vertical_error_m"] == pytest.approx(0.0, abs=1e-9)
    assert report["depth_error_m"] == pytest.approx(0.04)


def test_a_demo_that_missed_most_images_fails_after_its_report(
    session: Path, result: DemoResult, tmp_path: Path
) -> None:
    few = replace(result, postures=dict(sorted(result.postures.items())[: LAST // 2 - 1]))
    with pytest.raises(CardboxError, match=f"only {LAST // 2 - 1} of {LAST} images were tracked"):
        write_report(few, session, tmp_path, "default", 0)
    assert (tmp_path / "report.json").is_file()


def test_an_image_without_its_silhouette_has_no_cost(
    session: Path, result: DemoResult, tmp_path: Path
) -> None:
    partial = replace(result, silhouettes=dict(list(result.silhouettes.items())[:3]))
    report = write_report(partial, session, tmp_path, "paper", 0)
    whole = write_report(result, session, tmp_path, "paper", 0)
    assert report["frames_tracked"] == LAST
    assert report["mean_cost_px"] != whole["mean_cost_px"]
    assert report["mean_3d_error_m"] == whole["mean_3d_error_m"]


def test_places_and_doubts_of_the_nodes_are_in_the_report(
    session: Path, result: DemoResult, tmp_path: Path
) -> None:
    """The same person, whose body model has them 0.3 m too far away, and torso_x says so."""
    report = write_report(result, session, tmp_path, "paper", 0)
    assert report["frames_uncertain"] == 0
    stamps = list(result.postures)
    misplaced = replace(
        result,
        body=BODY.with_values(distance_m=BODY.placement.distance_m + 0.3),
        places_m=dict.fromkeys(stamps, np.array([0.3, 0.0])),
        states=dict.fromkeys(stamps[:5], "uncertain"),
    )
    again = write_report(misplaced, session, tmp_path, "paper", 0)
    assert again["frames_tracked"] == LAST
    assert again["frames_uncertain"] == 5
    assert again["mean_iou"] == pytest.approx(report["mean_iou"])
    assert again["mean_cost_px"] == pytest.approx(report["mean_cost_px"])
