"""The exports of a recorded person, read by other readers and compared with the truth."""

from __future__ import annotations

import csv
import importlib.util
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker import KEYPOINT_NAMES
from cardbox_tracker.commands.main import main
from cardbox_tracker.person.legs import floor_m
from cardbox_tracker.person.model_file import load_body_model
from lab.evaluation.session import load_session

SESSION = Path(__file__).resolve().parents[4] / "shared" / "data" / "person_a"
MARKERS = ("LShoulder", "LElbow", "LHand", "RShoulder", "RElbow", "RHand")
JOINTS = [f"{side}{limb}" for side in ("Left", "Right") for limb in ("Arm", "ForeArm", "Hand")]
# From the frame of the first camera, which is level here, into that of the laboratory.
TO_LABORATORY = np.array([(0, 0, -1), (0, -1, 0), (-1, 0, 0)])
BVH_TO_LABORATORY = np.array([(0, 0, 1), (0, 1, 0), (-1, 0, 0)])
MOST_M = 0.1
# Least share of the elbows' angles within two of the table's standard deviations.
LEAST_COVERED = 0.8


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the table of the tracked person and the files that it became."""
    if not SESSION.is_dir():
        pytest.skip("no recorded session person_a in ../shared/data")
    folder = tmp_path_factory.mktemp("person_a")
    truth = load_session(SESSION).truth
    spans = {name: f"{start + 0.2:g}:{end - 0.2:g}" for name, (start, end) in truth.spans.items()}
    scene, body = ("--background", spans["empty"]), str(folder / "person.yaml")
    references = [word for n in ("front", "side", "arms") for word in (f"--{n}", spans[n])]
    measured = ("--distance", f"{truth.distance_m}", "--output", body)
    assert main(["initialize", str(SESSION), *scene, *references, *measured]) == 0
    table = str(folder / "person.csv")
    # Who waves does the same again and again.
    start = ("--start", f"{np.mean(truth.spans['wave'])}", "--csv", table)
    assert main(["track", str(SESSION), *scene, "--model", body, *start]) == 0
    has_c3d = importlib.util.find_spec("ezc3d") is not None
    for name in ("trc", "mot", "bvh", "isb", *(["c3d"] if has_c3d else [])):
        output = ("--to", name, "--model", body, "--output", str(folder / f"person.{name}"))
        assert main(["export", table, *output]) == 0
    return folder


def table_of(path: Path) -> dict[str, np.ndarray]:
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def true_points_m(stamps_ns: np.ndarray) -> np.ndarray:
    """Return the true keypoints (n, 6, 3) in the camera's frame."""
    session = load_session(SESSION)
    by_stamp = dict(zip(session.stamps_ns.tolist(), session.keypoints_m, strict=True))
    return np.array([by_stamp[stamp] for stamp in stamps_ns.tolist()])


def trc_points_m(path: Path) -> np.ndarray:
    lines = [line.split("\t") for line in path.read_text(encoding="utf-8").splitlines()]
    names = [name for name in lines[3] if name][2:]
    values = np.array([line[2 : 2 + 3 * len(names)] for line in lines if line[0].isdigit()][1:])
    points = values.astype(float).reshape(len(values), len(names), 3)
    return points[:, [names.index(name) for name in MARKERS]]


def c3d_points_m(path: Path) -> np.ndarray:
    ezc3d = pytest.importorskip("ezc3d", reason="ezc3d is not installed")
    read = ezc3d.c3d(str(path))
    names = read["parameters"]["POINT"]["LABELS"]["value"]
    points = np.moveaxis(read["data"]["points"][:3], (0, 1, 2), (2, 1, 0)) / 1000
    return points[:, [names.index(name) for name in MARKERS]]


def bend_rad(points_m: np.ndarray) -> np.ndarray:
    """Return the angles (n, 2) between upper arm and forearm, left and right."""
    found = []
    for side in (0, 3):
        upper = points_m[:, side + 1] - points_m[:, side]
        fore = points_m[:, side + 2] - points_m[:, side + 1]
        lengths = np.linalg.norm(upper, axis=1) * np.linalg.norm(fore, axis=1)
        found.append(np.arccos(np.clip((upper * fore).sum(axis=1) / lengths, -1, 1)))
    return np.stack(found, axis=1)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:builtin type:DeprecationWarning")
def test_joints_have_the_error_of_the_table_in_all_formats(
    exported: Path, joints_of_bvh: Callable[[Path], dict[str, np.ndarray]]
) -> None:
    table = table_of(exported / "person.csv")
    columns = [[f"{name}_{axis}" for axis in "xyz"] for name in KEYPOINT_NAMES]
    tracked = np.array([[table[c] for c in three] for three in columns]).astype(float)
    tracked_m = tracked.transpose(2, 0, 1)
    truth_m = true_points_m(table["stamp_ns"].astype(np.int64))
    errors_m = {"csv": np.linalg.norm(tracked_m - truth_m, axis=2)}
    bones = joints_of_bvh(exported / "person.bvh")
    found_m = {
        "trc": trc_points_m(exported / "person.trc"),
        "c3d": c3d_points_m(exported / "person.c3d"),
        "bvh": np.stack([bones[name] for name in JOINTS], axis=1) @ BVH_TO_LABORATORY.T,
    }
    below_m = floor_m(load_body_model(exported / "person.yaml"))
    for name, points_m in found_m.items():
        assert points_m.shape == truth_m.shape, name
        points_m = points_m + np.array([0.0, below_m, 0.0])  # above the camera
        errors_m[name] = np.linalg.norm(points_m - truth_m @ TO_LABORATORY.T, axis=2)
    means_cm = {name: 100 * error.mean() for name, error in errors_m.items()}
    print({name: f"{mean:.2f} cm" for name, mean in means_cm.items()})
    assert errors_m["csv"].mean() < MOST_M
    # The bones of a BVH file turn, while the shoulders of the tracker rise on a line.
    rises_m = [table[f"{side}_clavicle_elevation"] for side in ("left", "right")]
    is_low = np.repeat(np.array(rises_m).astype(float).T < 1e-3, 3, axis=1)
    assert 0.2 < is_low.mean() < 1.0
    for name, error_m in errors_m.items():
        # Files have places to a tenth of a millimetre and angles to a thousandth of a degree.
        if name == "bvh":
            assert error_m == pytest.approx(errors_m["csv"], abs=4e-3)
            error_m = np.where(is_low, error_m, errors_m["csv"])
        assert error_m == pytest.approx(errors_m["csv"], abs=1e-3), name


@pytest.mark.slow
def test_elbows_bend_as_the_truth_does_within_the_deviations_of_the_table(exported: Path) -> None:
    table, isb = table_of(exported / "person.csv"), table_of(exported / "person.isb")
    sides = ("left", "right")
    found = np.array([isb[f"{side}_elbow_flexion_deg"] for side in sides]).astype(float).T
    two = [
        [table[f"{side}_elbow_{way}_stddev_rad"] for way in ("abduction", "flexion")]
        for side in sides
    ]
    deviation = np.linalg.norm(np.array(two).astype(float), axis=1).T
    error = np.radians(found) - bend_rad(true_points_m(isb["stamp_ns"].astype(np.int64)))
    covered = np.mean(np.abs(error) <= 2 * deviation)
    print(f"mean error {np.degrees(np.abs(error).mean()):.1f} degrees, {covered:.0%} within two")
    assert covered >= LEAST_COVERED
