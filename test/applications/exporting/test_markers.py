"""Markers by hand, and files of them as other people's readers see them."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker.applications.exporting.markers import markers_of, write_c3d, write_trc
from cardbox_tracker.applications.exporting.mot import write_mot
from cardbox_tracker.applications.exporting.motion import images_of_body
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.model import BodyModel

GAP = np.full(14, np.nan)
# The floor below the hips of a body with the default sizes.
FLOOR_M = 0.53 * 1.72
NAMES = ["LShoulder", "LElbow", "LHand", "RShoulder", "RElbow", "RHand", "Hip", "Neck"]


def test_places_by_hand(motion_of: Callable) -> None:
    """A person two metres before a level camera: torso 0.53 m, shoulders 0.05 m below its top.

    The stature is 1.72 m, of which the hips are at 53 %.
    """
    body = BodyModel.of(distance_m=2.0, hip_height_m=-0.5)
    names, points_m, _ = markers_of(motion_of(np.zeros(14), body), body)
    points_m = points_m - (0.0, 0.5 + FLOOR_M, 0.0)  # as above the camera
    assert list(names) == NAMES
    assert points_m[0] == pytest.approx(
        np.array(
            [
                *[(-2, -0.02, -0.18), (-2, -0.29, -0.18), (-2, -0.65, -0.18)],
                *[(-2, -0.02, 0.18), (-2, -0.29, 0.18), (-2, -0.65, 0.18)],
                *[(-2, -0.5, 0), (-2, 0.03, 0)],
            ]
        )
    )


def test_the_place_moves_all_markers(motion_of: Callable, body: BodyModel) -> None:
    still, moved = np.zeros(14), np.zeros(14)
    moved[[0, 12, 13]] = 0.3, 0.2, -0.1  # to the person's left, nearer, lower
    points_m = markers_of(motion_of([still, moved], body), body).points_m
    assert points_m[1] - points_m[0] == pytest.approx(np.tile([0.2, -0.1, -0.3], (8, 1)))


def test_without_a_body_the_camera_is_level(motion_of: Callable, body: BodyModel) -> None:
    motion = motion_of(np.zeros(14), body)
    names, points_m, _ = markers_of(motion, None)
    x, y, z = motion.keypoints_m[0].T
    assert list(names) == NAMES[:6]
    # Without a body there is no floor either.
    assert points_m[0] == pytest.approx(np.stack([-z, -y, -x], axis=1))
    upright = markers_of(motion, body).points_m[0]
    assert upright[0, 0] == pytest.approx(upright[2, 0])
    assert abs(points_m[0, 0, 0] - points_m[0, 2, 0]) > 0.1


def test_another_body_is_refused(motion_of: Callable, body: BodyModel) -> None:
    motion = motion_of(np.zeros((3, 14)), body, (0.05, 0.07))
    same = images_of_body(motion, body)
    assert same.is_seen.all()
    longer = body.with_values(sizes=body.sizes * 1.02)
    with pytest.raises(CardboxError, match=r"joints differ by 0\.0.* give the model"):
        images_of_body(motion, longer)
    with pytest.raises(CardboxError, match=r"joints differ by 0\.2"):
        images_of_body(motion, body.with_values(distance_m=2.7))
    raised = motion_of(np.zeros((3, 14)), body, (0.2, 0.0))
    with pytest.raises(CardboxError, match=r"shoulders rise by 0\.2"):
        images_of_body(raised, body)


def test_images_of_another_body_are_gaps(motion_of: Callable, body: BodyModel) -> None:
    """In the first image the person is 0.2 m farther than with the body that follows."""
    motion = motion_of(np.zeros((3, 14)), body)
    joints = motion.joints.copy()
    joints[0, 12] = 0.2
    fitted = images_of_body(replace(motion, joints=joints), body)
    assert fitted.is_seen.tolist() == [False, True, True]
    assert np.isnan(markers_of(fitted, body).points_m[0]).all()


def test_legs_and_hands_by_hand(motion_of: Callable) -> None:
    """A left thigh forwards and its shank down; a right leg that hangs; a left palm to the body."""
    body = BodyModel.of(distance_m=2.0, hip_height_m=-0.5)
    legs, palms = np.radians([[90.0, 0, 0, 90, 0, 0, 0, 0]]), np.full((1, 2, 3), np.nan)
    palms[0, 0] = -1.0, 0.0, 0.0  # to the left of the image, optical frame
    # A bag has no points of the legs, so the bones have the lengths of people of this stature.
    names, points_m, _ = markers_of(motion_of(np.zeros(14), body, legs=legs, palms=palms), body)
    at = dict(zip(names, points_m[0], strict=True))
    thigh, shank, aside, ankle = 0.245 * 1.72, 0.246 * 1.72, 0.06 * 1.72, 0.039 * 1.72
    assert at["LKnee"] == pytest.approx([-2 + thigh, FLOOR_M, -aside])
    assert at["LAnkle"] == pytest.approx([-2 + thigh, FLOOR_M - shank, -aside])
    assert at["RAnkle"] == pytest.approx([-2, ankle, aside])
    wrist = 0.73 * at["LHand"] + 0.27 * at["LElbow"]
    assert at["LWrist"] == pytest.approx(wrist)
    assert at["LPalm"] == pytest.approx((wrist + at["LHand"]) / 2 + (0.0, 0.0, 0.05))
    assert np.isnan([at["RWrist"], at["RPalm"]]).all()


@pytest.mark.parametrize("roll_deg", [12.0, 25.0, -90.0])
def test_a_rolled_camera_gives_the_same_markers(
    motion_of: Callable, body: BodyModel, roll_deg: float
) -> None:
    """The points of the results are in the frame of the camera as it stands."""
    state = np.random.default_rng(3).uniform(-0.3, 0.5, 14)
    rolled = body.with_values(camera_roll_rad=np.radians(roll_deg))
    motion = motion_of(state, rolled)
    assert np.abs(motion.keypoints_m - motion_of(state, body).keypoints_m).max() > 0.1
    expected_m = markers_of(motion_of(state, body), body).points_m
    assert markers_of(motion, rolled).points_m == pytest.approx(expected_m)


@pytest.mark.parametrize("write", [write_trc, write_mot])
def test_a_name_with_tabs_and_line_breaks_stays_in_its_cell(
    motion_of: Callable, tmp_path: Path, write: Callable
) -> None:
    body = BodyModel.of(distance_m=2.0, hip_height_m=-0.5)
    motion, texts = motion_of([np.zeros(14)], body), []
    for name in ("a.trc", "a\tb\nc.trc"):
        write(tmp_path / name, motion, body)
        texts.append((tmp_path / name).read_text())
    assert "a\\tb\\nc" in texts[1]
    for character in "\t\n":
        assert texts[0].count(character) == texts[1].count(character)


def test_trc_by_hand(motion_of: Callable, tmp_path: Path) -> None:
    body = BodyModel.of(distance_m=2.0, hip_height_m=-0.5)
    motion = motion_of([np.zeros(14), GAP, np.zeros(14)], body)
    write_trc(tmp_path / "a.trc", motion, body)
    rows = [line.split("\t") for line in (tmp_path / "a.trc").read_text().split("\n")]
    assert rows[0] == ["PathFileType", "4", "(X/Y/Z)", "a.trc"]
    assert rows[1] == [
        *("DataRate", "CameraRate", "NumFrames", "NumMarkers", "Units"),
        *("OrigDataRate", "OrigDataStartFrame", "OrigNumFrames"),
    ]
    assert rows[2] == ["10", "10", "3", "8", "m", "10", "1", "3"]
    assert rows[3][:5] == ["Frame#", "Time", "LShoulder", "", ""]
    assert rows[4][:6] == ["", "", "X1", "Y1", "Z1", "X2"]
    assert rows[6][:5] == ["1", "0.000000", "-2.000000", f"{0.48 + FLOOR_M:.6f}", "-0.180000"]
    assert rows[7] == ["2", "0.100000", *[""] * 25]
    assert rows[8][:2] == ["3", "0.200000"]
    # A row ends in a tab, without which OpenSim misses the last cell of a gap.
    assert {len(row) for row in (rows[4], *rows[6:9])} == {2 + 24 + 1}
    assert rows[9:] == [[""]]


@pytest.mark.filterwarnings("ignore:builtin type:DeprecationWarning")
def test_ezc3d_reads_the_same_places(motion_of: Callable, body: BodyModel, tmp_path: Path) -> None:
    ezc3d = pytest.importorskip("ezc3d", reason="ezc3d is not installed")
    postures = np.random.default_rng(1).uniform(-0.3, 0.6, (5, 14))
    postures[2] = GAP
    motion = motion_of(postures, body, (0.05, 0.02))
    write_c3d(tmp_path / "a.c3d", motion, body)
    read = ezc3d.c3d(str(tmp_path / "a.c3d"))
    about = read["parameters"]["POINT"]
    assert about["LABELS"]["value"] == NAMES
    assert (about["UNITS"]["value"], about["RATE"]["value"].tolist()) == (["mm"], [10.0])
    points_m = np.moveaxis(read["data"]["points"][:3], (0, 1, 2), (2, 1, 0)) / 1000
    expected_m = markers_of(motion, body).points_m
    assert points_m == pytest.approx(expected_m, abs=1e-6, nan_ok=True)
    residuals = read["data"]["meta_points"]["residuals"][0]
    assert (residuals[:, 2] == -1).all()
    assert (residuals[:, [0, 1, 3, 4]] == 0).all()


def test_without_ezc3d_the_extra_is_named_and_nothing_is_left(
    motion_of: Callable, body: BodyModel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "ezc3d", None)
    with pytest.raises(CardboxError, match=r"pip install 'cardbox_tracker\[export\]'.*--to trc"):
        write_c3d(tmp_path / "a.c3d", motion_of(np.zeros(14), body), body)
    assert list(tmp_path.iterdir()) == []
