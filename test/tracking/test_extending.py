"""The worked examples of docs/extending.md are executed as they stand there, and checked."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.extrinsics import Extrinsics
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.camera.view import OtherCamera
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.terms.kernel_arguments import body_tuple
from cardbox_tracker.terms.term import ARM, TRUNK, WHOLE, Frame, Posed
from cardbox_tracker.tracking.observation import Observation
from cardbox_tracker.tracking.tracked_camera import TrackedCamera
from cardbox_tracker.tracking.tracker import Tracker

ROOT = Path(__file__).parents[2]
CODE = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "extending.md").read_text(), re.DOTALL)
DETECTOR, FORMAT, CLICKED, USE, SCHEME = CODE
FILES = {
    "my_detector.py": DETECTOR,
    "my_format.py": FORMAT,
    "clicked_points.py": CLICKED,
}
FRONT = reference_posture("front")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The examples' files in a folder on the path, with the configuration they read."""
    for name, code in FILES.items():
        (tmp_path / name).write_text(code)
    (tmp_path / "config").symlink_to(ROOT / "config")
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


def with_arms(degrees: float) -> np.ndarray:
    """A person who stands a little aside, with both arms raised sideways and bent."""
    state = np.append(FRONT, [0.1, -0.05])
    state[1:4] = 0.05, 0.1, 0.2
    state[[4, 8]], state[[6, 10]] = np.radians(degrees), np.radians(20.0)
    return state


SECOND = OtherCamera(
    Camera(320, 240, 350.0, 350.0, 161.0, 121.0),
    Extrinsics.of_vectors(np.radians((5.0, -35.0, 4.0)), (1.3, 0.05, 0.4)),
)


def seen_by_both(body: BodyModel, camera: Camera, state: np.ndarray) -> list[np.ndarray]:
    """Where the joints are in the images of both cameras, without the tracker's views."""
    first_m = camera.reference_to_optical(pose(body, state).keypoints_m)
    pose_of = SECOND.extrinsics
    second_m = first_m @ pose_of.rotation.T + pose_of.translation_m
    return [camera.project(first_m), SECOND.camera.project(second_m)]


@pytest.mark.parametrize("degrees", [20.0, 86.0, 149.0])
def test_clicked_points_cost_nothing_at_the_truth_in_any_camera(
    folder: Path, degrees: float
) -> None:
    tracker, clicked = made_by(USE), module_of("clicked_points")
    body, camera = tracker.body, tracker.camera
    state = with_arms(degrees)
    config = replace(tracker.config, terms=(clicked.ClickedPoints(weight=10.0),))
    dark = np.zeros((240, 320), np.uint8)
    for other, points_px in zip((None, SECOND), seen_by_both(body, camera, state), strict=True):
        seen = TrackedCamera(body, camera, config, other)
        seen.reset(config)
        frame = seen.frame(Observation(dark, clicked=points_px), None, True)
        there = seen.view.states(state) if seen.view else state
        observation = seen.terms[0].observe(frame)
        moved = there + np.eye(1, 14, 4)[0] * 0.1
        posed = body_tuple(seen.view.body if seen.view else body, frame.camera)
        for parts in (WHOLE, TRUNK, *ARM):
            right, wrong = observation.rate(Posed(posed, np.array([there, moved]), parts, there))
            assert right == pytest.approx(0.0, abs=1e-6)
            # The angle turns the left arm, and raises its shoulder beyond some elevation.
            assert (wrong > 10.0) == parts[1]


def test_clicked_points_rate_by_hand(folder: Path) -> None:
    tracker, clicked = made_by(USE), module_of("clicked_points")
    state = with_arms(20.0)
    at = Posed(body_tuple(tracker.body, tracker.camera), state[None])
    points_px = np.full((6, 2), np.nan)
    points_px[2] = at.keypoints_px[0, 2] + (3.0, 4.0)
    term = clicked.ClickedPoints(weight=10.0).build(tracker.body, tracker.camera)
    dark = np.zeros((240, 320), np.uint8)
    frame = Frame(tracker.camera, {"silhouette": dark, "clicked": points_px}, 240, 0)
    # 5 px away, and 10 px for each of them; no other joint has a point.
    assert term.observe(frame).rate(at).tolist() == pytest.approx([50.0])
    assert term.observe(Frame(tracker.camera, {"silhouette": dark}, 240, 0)) is None


def test_two_cameras_follow_clicked_points(folder: Path) -> None:
    """Outlines say little of a forearm before the belly; points say where the hand is."""
    tracker, clicked = made_by(USE), module_of("clicked_points")
    body, camera = tracker.body, tracker.camera
    state = np.append(FRONT, [0.0, 0.0])
    state[4:8] = np.radians((10, 25, -70, 40))
    wanted_m = camera.reference_to_optical(pose(body, state).keypoints_m)
    points = seen_by_both(body, camera, state)
    first = render(cardbox_patches(body, state[:12]), camera)
    away_m = []
    for given in (None, points):
        config = replace(tracker.config, terms=(clicked.ClickedPoints(),) if given else ())
        of = Tracker(body, camera, config, others=[SECOND])
        for number in range(8):
            one = Observation(first, stamp_ns=number, **({"clicked": points[0]} if given else {}))
            second = Observation(np.zeros((240, 320), np.uint8))
            if given:
                second = second.having(clicked=points[1])
            estimate = of.track([one, second])
        assert estimate.keypoints_m is not None
        away_m.append(float(np.linalg.norm(estimate.keypoints_m[2] - wanted_m[2])))
    assert away_m[1] < 0.05 < away_m[0], away_m


def test_a_new_channel_is_one_line_and_unknown_ones_are_refused(folder: Path) -> None:
    module_of("clicked_points")
    with pytest.raises(ValueError, match=r"no channel 'clickt'; expected any of .*clicked"):
        Observation(clickt=np.zeros((6, 2)))
    tracker = made_by(USE)
    silhouette = silhouette_of(tracker)
    with pytest.raises(ValueError, match=r"clicked of the first camera has the shape \(6,\)"):
        tracker.track(Observation(silhouette, clicked=np.zeros(6)))


def test_the_format_writes_a_line_for_each_image(folder: Path) -> None:
    motion = SimpleNamespace(stamp_ns=np.array([7, 9]), state=("tracking", "lost"))
    module_of("my_format").STATES.write(folder / "a.states", motion, None)
    assert (folder / "a.states").read_text() == "7 tracking\n9 lost\n"


def test_the_scheme_is_one() -> None:
    names: dict[str, Any] = {"np": np}
    exec(SCHEME, names)
    weights = np.array([0.0, 0.25, 0.75])
    drawn = names["multinomial"](weights, 4000, np.random.default_rng(0))
    assert np.bincount(drawn, minlength=3) / 4000 == pytest.approx(weights, abs=0.02)


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
    places = "terms/clicked_points.py", "applications/exporting/my_format.py"
    files = [package / place for place in places]
    (tmp_path / "ultralytics.pyi").write_text("from typing import Any\nYOLO: Any\n")
    for file in files:
        file.write_text(FILES[file.name])
    # The cache beside that of 'make lint' spares what has not changed since the last run.
    options = ("--config-file", ROOT / "pyproject.toml", "--cache-dir", ROOT / ".mypy_cache")
    done = subprocess.run(
        [sys.executable, "-m", "mypy", *options, *files, *FILES],
        cwd=tmp_path,
        env={"PATH": ""},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr
