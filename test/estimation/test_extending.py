"""The worked examples of docs/extending.md are executed as they stand there, and checked."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from cardbox_tracker.body.cardbox import cardbox_patches
from cardbox_tracker.body.kinematics import pose
from cardbox_tracker.body.posture import reference_posture
from cardbox_tracker.body.skeleton import KEYPOINT_NAMES
from cardbox_tracker.estimation.config import PRESETS
from cardbox_tracker.estimation.cost.terms import ARMS, Frame, Silence
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost
from cardbox_tracker.estimation.cost.whole_body_config import WholeBodyCostConfig
from cardbox_tracker.estimation.tracker import Tracker
from cardbox_tracker.vision.rasterisation import render

ROOT = Path(__file__).parents[2]
CODE = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "extending.md").read_text(), re.DOTALL)
FILES = {"clicked_points.py": CODE[0], "linear_corrector.py": CODE[2]}
STAMP_NS = 7_000_000_000
FRONT = reference_posture("front")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The examples' files in a folder on the path, with the configuration they read."""
    for name, code in FILES.items():
        (tmp_path / name).write_text(code)
    (tmp_path / "config").symlink_to(ROOT / "config")
    (tmp_path / "points.csv").write_text(f"stamp_ns,joint,u,v\n{STAMP_NS},left_hand,180.0,50.0\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path
    for name in FILES:
        sys.modules.pop(Path(name).stem, None)


def made_by(code: str) -> Tracker:
    """What a piece of code calls ``tracker``."""
    names: dict[str, Any] = {}
    exec(code, names)
    found = names["tracker"]
    assert isinstance(found, Tracker)
    return found


def module_of(name: str) -> ModuleType:
    return __import__(name)


def silhouette_of(tracker: Tracker, posture: np.ndarray = FRONT) -> np.ndarray:
    return render(cardbox_patches(tracker.body, posture), tracker.camera)


def projected(tracker: Tracker, posture: np.ndarray) -> np.ndarray:
    points_m = pose(tracker.body, posture, tracker.camera.pitch_rad).keypoints_m
    return tracker.camera.project(points_m)


def frame(stamp_ns: int | None) -> Frame:
    return Frame(np.zeros((240, 320), np.uint8), 200, 0, stamp_ns=stamp_ns)


def test_clicked_points_rate_by_hand(folder: Path) -> None:
    tracker, clicked = made_by(CODE[1]), module_of("clicked_points")
    hand = KEYPOINT_NAMES.index("left_hand")
    at = projected(tracker, FRONT)[hand]
    points = {STAMP_NS: {"left_hand": (at[0] + 3.0, at[1] + 4.0)}}
    term = clicked.ClickedPoints(points, weight=10.0).build(tracker.body, tracker.camera)
    seen = term.observe(frame(STAMP_NS))
    # 5 px away, and 10 px for each of them; another arm has no point.
    states = np.stack([FRONT, np.append(FRONT, [0.0, 0.0])[:12]])
    assert seen.postures(states).tolist() == pytest.approx([50.0, 50.0])
    rate = seen.arms_beside(FRONT[:4])
    assert rate("left", FRONT[None, ARMS["left"]]).tolist() == pytest.approx([50.0])
    assert rate("right", FRONT[None, ARMS["right"]]).tolist() == [0.0]
    assert seen.torsos_beside(None)(np.zeros((3, 4))).tolist() == [0, 0, 0]
    assert isinstance(term.observe(frame(STAMP_NS + 1)), Silence)
    assert isinstance(term.observe(frame(None)), Silence)


@pytest.mark.parametrize("raised_deg", [20.0, 86.0, 149.0])
def test_clicked_points_are_where_the_body_is_placed(folder: Path, raised_deg: float) -> None:
    """A state of torso_x and torso_z is rated as the whole-body filter draws it."""
    tracker, clicked = made_by(CODE[1]), module_of("clicked_points")
    state = np.append(FRONT, [0.2, -0.05])
    state[[4, 8]] = np.radians(raised_deg)
    cost = WholeBodyCost(tracker.body, tracker.camera, WholeBodyCostConfig())
    points_px = tracker.camera.project(cost.keypoints(state))
    points = {STAMP_NS: dict(zip(KEYPOINT_NAMES, map(tuple, points_px), strict=True))}
    term = clicked.ClickedPoints(points, weight=1.0).build(tracker.body, tracker.camera)
    seen = term.observe(frame(STAMP_NS))
    assert seen.postures(state[None])[0] == pytest.approx(0.0, abs=1e-6)
    arm = seen.arms_beside(state[[0, 1, 2, 3, 12, 13]])("left", state[None, 4:8])
    assert arm[0] == pytest.approx(0.0, abs=1e-6)


def test_the_tracker_follows_clicked_points(folder: Path) -> None:
    """An outline says little of a forearm before the belly; a point says where the hand is."""
    tracker, clicked = made_by(CODE[1]), module_of("clicked_points")
    assert tracker.config.terms[-1].points_px == {STAMP_NS: {"left_hand": (180.0, 50.0)}}
    posture = FRONT.copy()
    posture[4:8] = np.radians((10, 25, -70, 40))
    names = ("left_elbow", "left_hand")
    hand = KEYPOINT_NAMES.index("left_hand")
    wanted_px = projected(tracker, posture)
    at = {name: tuple(wanted_px[KEYPOINT_NAMES.index(name)]) for name in names}
    away_px = []
    for points in ({}, {STAMP_NS + i: at for i in range(8)}):
        config = tracker.config.changed({"whole_body": {"corrector": "none"}})
        config = replace(config, terms=(clicked.ClickedPoints(points),))
        of = Tracker(tracker.body, tracker.camera, config)
        for i in range(8):
            estimate = of.track(silhouette_of(of, posture), stamp_ns=STAMP_NS + i)
        assert estimate.keypoints_m is not None
        found_px = of.camera.project(estimate.keypoints_m)
        away_px.append(float(np.linalg.norm(found_px[hand] - wanted_px[hand])))
    assert away_px[1] < 5.0 < away_px[0], away_px


def test_a_corrector_from_a_file_is_fitted_and_used(folder: Path) -> None:
    linear = module_of("linear_corrector")
    rng = np.random.default_rng(0)
    body_m = np.array([0.0, 0.0, 2.5]) + pose(made_by(CODE[1]).body.rigid, FRONT).keypoints_m
    found_m = body_m + 0.2 * rng.standard_normal((200, 6, 3))
    # All results are 10 cm too near.
    linear.fit(found_m, found_m + np.array([0.0, 0.0, 0.1]))
    tracker = made_by(CODE[3])
    nothing = PRESETS["default"]().changed({"whole_body": {"corrector": "none"}})
    ahead_m = []
    for of in (Tracker(tracker.body, tracker.camera, nothing), tracker):
        for _ in range(8):
            estimate = of.track(silhouette_of(of))
        assert estimate.keypoints_m is not None
        ahead_m.append(estimate.keypoints_m[:, 2].mean())
    assert ahead_m[1] - ahead_m[0] == pytest.approx(0.1, abs=0.03)


def test_the_examples_pass_ruff(folder: Path) -> None:
    for tool in (("ruff", "check", "--config"), ("ruff", "format", "--check", "--config")):
        done = subprocess.run(
            [sys.executable, "-m", *tool, ROOT / "pyproject.toml", *FILES],
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.slow
def test_the_examples_pass_strict_mypy_beside_and_in_the_package(
    folder: Path, tmp_path: Path
) -> None:
    ignored = shutil.ignore_patterns("__pycache__")
    package = shutil.copytree(
        ROOT / "cardbox_tracker", tmp_path / "cardbox_tracker", ignore=ignored
    )
    places = "cost/clicked_points.py", "filtering/linear_corrector.py"
    files = [package / "estimation" / place for place in places]
    for file in files:
        file.write_text(FILES[file.name])
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--config-file", ROOT / "pyproject.toml", *files, *FILES],
        cwd=tmp_path,
        env={"PATH": ""},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr
